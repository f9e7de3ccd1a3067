"""Write tie points into the project's table, or remove them."""

from __future__ import annotations

import os
from contextlib import nullcontext
from dataclasses import dataclass
from pathlib import Path

from uavgram.config.project import load_project, project_file
from uavgram.io.outputs import replace_bytes
from uavgram.io.tables.picks import EMPTY_TIES, count_made, update_ties
from uavgram.model.message import Message
from uavgram.model.options import TIES_FILE, Project
from uavgram.model.survey import NO_TIES, TiePicks
from uavgram.pipeline.measure.inputs import check_ties, read_inputs, ties_path
from uavgram.pipeline.measure.tie_points import find_project_ties, pose_before_ties
from uavgram.pipeline.picks_table import lock_tables
from uavgram.pipeline.progress import Progress, silent
from uavgram.pipeline.threads import with_one_blas_thread
from uavgram.stages.messages import order_messages


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


@with_one_blas_thread
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
