"""Claims of output folders, for several processes that may write into the same one.

A cluster's worker that was stopped or cut off is abandoned, and another one repeats its work; when
it resumes, it must not overwrite the results of the other. Locks do not help, as it would hold
them.
"""

from __future__ import annotations

import uuid
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from uavgram.errors import OutputError
from uavgram.io.outputs import as_output_errors

CLAIM = ".uavgram-claim"


class SupersededError(OutputError):
    """Another process measures the same survey, or did meanwhile: this one writes no results."""

    def __init__(self, folder: Path | str) -> None:
        super().__init__(folder)
        self.folder = folder

    def __str__(self) -> str:
        return (
            f"{self.folder}: another process began to measure into it meanwhile, so this one wrote "
            "nothing: let one batch at a time measure a survey"
        )


@contextmanager
def claimed(folder: str | Path) -> Iterator[Callable[[], None]]:
    """Claim an output folder; the last claim wins. The yielded function raises if it is another's.

    Parameters
    ----------
    folder
        Made where there is none, and removed at the end if it is still empty.

    Raises
    ------
    OutputError
        The folder cannot be written to; `SupersededError` by the yielded function.
    """
    folder, token = Path(folder).absolute(), uuid.uuid4().hex
    existed = folder.is_dir()

    def is_ours() -> bool:
        try:
            return (folder / CLAIM).read_text(encoding="ascii") == token
        except (OSError, UnicodeError):
            return False

    def hold() -> None:
        if not is_ours():
            raise SupersededError(folder)

    try:
        with as_output_errors(folder):
            folder.mkdir(parents=True, exist_ok=True)
            (folder / CLAIM).unlink(missing_ok=True)  # never through a link
            (folder / CLAIM).write_text(token, encoding="ascii")
        yield hold
    finally:
        with suppress(OSError):
            if is_ours():
                (folder / CLAIM).unlink()
            if not existed:
                folder.rmdir()
