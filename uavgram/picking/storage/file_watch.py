"""Detection of files of the open project that another program changed."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from uavgram.errors import InputError
from uavgram.io.files import digest_file
from uavgram.pipeline.measure.inputs import Inputs

Stamp = tuple[int, int] | None


class FileWatch:
    """Watch on the project file, the camera file and the tables of known points.

    The tables that the page writes itself are watched by `Tables`.

    Parameters
    ----------
    inputs
        Project as read.

    Attributes
    ----------
    last_changed
        Names of the changed files at the last look.
    """

    def __init__(self, inputs: Inputs) -> None:
        project = inputs.project
        known = (project.control, project.control_lines, project.check)
        names = (inputs.project_path, project.camera_file, *known)
        self._files = [Path(name) for name in names if name]
        self._known = {digest.sha256 for digest in inputs.digests}
        self._seen: dict[Path, tuple[Stamp, bool]] = {}
        self.last_changed: list[str] = []

    def changed(self, others: Sequence[str] = ()) -> list[str]:
        """Return the names of the files that differ from those read, `others` among them."""
        self.last_changed = sorted(
            {*(path.name for path in self._files if self._differs(path)), *others}
        )
        return self.last_changed

    def _differs(self, path: Path) -> bool:
        """Return whether the content differs; the file is read only if its size or time changed."""
        stamp = stamp_of(path)
        before = self._seen.get(path)
        if before is not None and before[0] == stamp:
            return before[1]
        try:
            differs = digest_file(path).sha256 not in self._known
        except InputError:  # the file was deleted
            differs = True
        self._seen[path] = (stamp, differs)
        return differs


def stamp_of(path: Path) -> Stamp:
    """Return time and size of a file, which change with its content; None if it does not exist."""
    try:
        status = path.stat()
    except OSError:
        return None
    return status.st_mtime_ns, status.st_size
