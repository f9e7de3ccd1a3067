"""Write picks.csv again; the rows that people wrote stay unchanged, to the byte."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from uavgram.errors import InputError, OutputError
from uavgram.io.outputs import ProjectLock, replace_bytes
from uavgram.io.tables.updates import update_picks
from uavgram.model.observations import Picks
from uavgram.model.options import Project
from uavgram.pipeline.measure.inputs import Inputs


@contextmanager
def lock_tables(project: Project, project_path: str) -> Iterator[None]:
    """Lock a project's tables against picking pages and other searches.

    Parameters
    ----------
    project, project_path
        The project, and its file.

    Raises
    ------
    UavgramError
        One of them has the project open; with its process.
    OutputError
        The output folder, with the lock, cannot be written to.
    """
    folder = Path(project.output)
    existed = folder.is_dir()
    lock = ProjectLock(folder, project_path)
    try:
        yield
    finally:
        lock.release()
        if not existed:
            with suppress(OSError):  # other files are in it by now
                folder.rmdir()


def save_picks(inputs: Inputs, after: Picks) -> Path:
    """Write other picks into a project's table, made if absent, in one step; return its path.

    Parameters
    ----------
    inputs
        As read.
    after
        New content of the table.

    Raises
    ------
    InputError
        Another program changed the table since it was read.
    OutputError
        It cannot be written; it is unchanged.
    """
    path = Path(inputs.project.picks).resolve()  # resolves links, so that a link is kept
    before = path.read_bytes() if path.exists() else None
    if _changed(inputs, before):
        raise InputError(path, "was changed by another program meanwhile: run this once more")
    content = update_picks(before, inputs.picks, after)
    if content is None or content == before:
        return path
    if before is None:
        replace_bytes(path, content)
        return path
    if not os.access(path, os.W_OK):  # a replacement ignores permissions
        raise OutputError(f"{path}: may not be written to; it is as it was")
    mode = path.stat().st_mode
    replace_bytes(path, content)
    with suppress(OSError):
        path.chmod(mode)
    return path


def _changed(inputs: Inputs, content: bytes | None) -> bool:
    """Return whether a table differs from the one that was read."""
    if content is None:
        return bool(inputs.picks.image)
    return hashlib.sha256(content).hexdigest() not in {one.sha256 for one in inputs.digests}
