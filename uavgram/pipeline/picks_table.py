"""Write picks.csv and ties.csv again; the rows that people wrote stay unchanged, to the byte."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext, suppress
from dataclasses import dataclass
from pathlib import Path

from uavgram.config.project import load_project, project_file
from uavgram.errors import InputError, OutputError
from uavgram.io.outputs import ProjectLock, check_saved, replace_bytes
from uavgram.io.tables.picks import EMPTY_TIES, count_made, update_ties
from uavgram.io.tables.updates import update_picks
from uavgram.model.message import Message
from uavgram.model.observations import Picks
from uavgram.model.options import TIES_FILE, Project
from uavgram.model.survey import NO_TIES, TiePicks
from uavgram.pipeline.measure.inputs import Inputs, check_ties, read_inputs, ties_path
from uavgram.pipeline.measure.tie_points import find_project_ties, pose_before_ties
from uavgram.pipeline.parallel import Progress, silent
from uavgram.pipeline.threads import limit_blas_threads
from uavgram.stages.messages import order_messages


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
        One of them has the project open, with its process; or ended without saving.
    OutputError
        The output folder, with the lock, cannot be written to.
    """
    folder = Path(project.output)
    existed = folder.is_dir()
    lock = ProjectLock(folder, project_path)
    try:
        check_saved(folder)
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
    if _is_changed(inputs, before):
        raise InputError(path, "was changed by another program meanwhile: run this once more")
    content = update_picks(before, inputs.picks, after, inputs.unused_picks)
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


def _is_changed(inputs: Inputs, content: bytes | None) -> bool:
    """Return whether a table differs from the one that was read."""
    if content is None:
        return bool(inputs.picks.image)
    return hashlib.sha256(content).hexdigest() not in {one.sha256 for one in inputs.digests}


@dataclass(frozen=True, kw_only=True, eq=False)
class TiesWritten:
    """Tie points of a project after a change.

    Attributes
    ----------
    path
        The table.
    ties
        New tie points in it.
    taken_back
        Number of the program's rows that were removed.
    written
        Whether the table was written.
    messages
        Messages on them.
    """

    path: Path
    ties: TiePicks
    taken_back: int
    written: bool
    messages: tuple[Message, ...] = ()


@limit_blas_threads
def write_ties(
    project: str | os.PathLike[str], *, dry_run: bool = False, progress: Progress = silent
) -> TiesWritten:
    """Find tie points in a project's photos and write them to its table.

    Earlier ones by the program are replaced; rows from other sources stay.

    Parameters
    ----------
    project
        The project file, or its folder.
    dry_run
        Write nothing.
    progress
        Shows long loops.

    Raises
    ------
    UavgramError
        A problem that the user can solve; the table is unchanged.
    """
    inputs = read_inputs(Path(project), unfinished=True)
    path = _table(inputs.project, inputs.folder)
    with nullcontext() if dry_run else lock_tables(inputs.project, inputs.project_path):
        earlier = count_made(path)
        posed = pose_before_ties(inputs)
        found = find_project_ties(inputs, posed, progress)
        content = update_ties(path, found.ties)
        check_ties(str(path), found.ties, inputs.photos)
        if not dry_run:
            _replace(path, content)
    messages = (*posed.messages, *found.messages(path.name))
    if inputs.project.ties is None and found.ties.image:
        text = (
            f"The project does not use its tie points yet: write `ties: {path.name}` into "
            f"{Path(inputs.project_path).name}."
        )
        messages += (Message("info", "ties-unused", text, files=(path.name,)),)
    return TiesWritten(
        path=path,
        ties=found.ties,
        taken_back=earlier,
        written=not dry_run,
        messages=order_messages(*messages),
    )


def remove_ties(project: str | os.PathLike[str], *, dry_run: bool = False) -> TiesWritten:
    """Remove all tie points that the program found from a project's table.

    Parameters
    ----------
    project
        The project file, or its folder.
    dry_run
        Write nothing.

    Raises
    ------
    UavgramError
        A problem that the user can solve; the table is unchanged.
    """
    file = project_file(Path(project))
    settings = load_project(file, unfinished=True)
    path = _table(settings, file.absolute().parent)
    with nullcontext() if dry_run else lock_tables(settings, str(file)):
        count = count_made(path)
        if count and not dry_run:
            _replace(path, update_ties(path, NO_TIES) or EMPTY_TIES)
    return TiesWritten(path=path, ties=NO_TIES, taken_back=count, written=not dry_run)


def _table(project: Project, folder: Path) -> Path:
    return ties_path(project, folder) or folder / TIES_FILE


def _replace(path: Path, content: bytes | None) -> None:
    if content is not None:
        replace_bytes(path, content)
    else:
        path.unlink(missing_ok=True)
