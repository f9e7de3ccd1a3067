"""Noticing that another program changed a file of the project while it is open."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from uavgram.errors import InputError
from uavgram.io.inputs import digest_file
from uavgram.pipeline.measure.inputs import Inputs

Stamp = tuple[int, int] | None


class Outside:
    """Watches the project file, the camera file and the tables of known points.

    The tables that the page itself writes are watched by who writes them.

    Parameters
    ----------
    inputs
        The project as read.

    Attributes
    ----------
    last_changed
        Names of what was changed, as last found.
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
        """Names of the files that are not as they were read, `others` among them."""
        self.last_changed = sorted(
            {*(path.name for path in self._files if self._differs(path)), *others}
        )
        return self.last_changed

    def _differs(self, path: Path) -> bool:
        """Whether its content is another; read again only where size or time changed."""
        stamp = stamp_of(path)
        before = self._seen.get(path)
        if before is not None and before[0] == stamp:
            return before[1]
        try:
            differs = digest_file(path).sha256 not in self._known
        except InputError:  # it is gone
            differs = True
        self._seen[path] = (stamp, differs)
        return differs


def stamp_of(path: Path) -> Stamp:
    """Time and size of a file, which change where its content does; None where there is none."""
    try:
        status = path.stat()
    except OSError:
        return None
    return status.st_mtime_ns, status.st_size
