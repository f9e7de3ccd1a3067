"""Tie points of a project: found in its photos, with prior poses."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from uavgram.io.files import digest_file
from uavgram.io.outputs import replace_bytes
from uavgram.io.tables.picks import read_ties, update_ties
from uavgram.model.message import Message
from uavgram.model.options import TIES_FOUND
from uavgram.model.survey import TiePicks
from uavgram.pipeline.measure.inputs import Inputs, find_project_duplicates, ties_path
from uavgram.pipeline.measure.pose import PosedFrames, list_unposed, pose_frames
from uavgram.pipeline.parallel import Progress, silent
from uavgram.stages.synchronise.event_times import has_events
from uavgram.stages.tie import report_ties

if TYPE_CHECKING:
    from uavgram.pipeline.ties import TieSearch


@dataclass(frozen=True, kw_only=True, eq=False)
class FoundTies:
    """Tie points that were found in a project's photos, with remarks."""

    found: TieSearch
    photos: Sequence[str]

    @property
    def ties(self) -> TiePicks:
        """Sightings of tie points."""
        return self.found.ties

    def messages(self, file: str) -> tuple[Message, ...]:
        """Return remarks; `file` is the table of the tie points."""
        return tuple(report_ties(self.ties, self.photos, file))


def pose_before_ties(inputs: Inputs) -> PosedFrames:
    """Return first poses of the photos; none where ties will determine the camera's clock."""
    time, log = inputs.project.time, inputs.log
    by_clock = time.source != "events" and inputs.photos.time_source != "none"
    if log is not None and by_clock and time.offset_s == "auto" and not has_events(log):
        return list_unposed(inputs)
    return pose_frames(inputs)


def find_project_ties(inputs: Inputs, posed: PosedFrames, progress: Progress = silent) -> FoundTies:
    """Find the tie points of a project.

    Parameters
    ----------
    inputs, posed
        The project as read, and the first poses of its photos.
    progress
        Shows long loops.

    Raises
    ------
    InputError
        A photo cannot be read.
    """
    from uavgram.pipeline.ties import Scene, find_ties  # noqa: PLC0415 - slow to load

    copies = find_project_duplicates(inputs).photos
    rows = [k for k, name in enumerate(inputs.photos.frame_id) if name not in copies]
    ground = inputs.project.ground
    scene = Scene(
        frame_id=tuple(inputs.photos.frame_id[k] for k in rows),
        path=tuple(inputs.photos.path[k] for k in rows),
        calibration=inputs.calibration,
        poses=None if posed.telemetry is None else posed.telemetry.poses,
        picked_image=inputs.picks.image,
        picked_px=inputs.picks.pixel_px,
        ground_m=ground.height_m,
        ground_sigma_m=ground.height_sigma_m,
    )
    return FoundTies(found=find_ties(scene, progress), photos=scene.frame_id)


def are_ties_missing(inputs: Inputs) -> bool:
    """Return whether a project requests tie points that are still to be found."""
    path = ties_path(inputs.project, inputs.folder)
    return inputs.project.ties == TIES_FOUND and path is not None and not path.is_file()


def add_found_ties(
    inputs: Inputs, posed: PosedFrames, *, write: bool, progress: Progress = silent
) -> Inputs:
    """Find tie points, and add them to the project.

    Parameters
    ----------
    inputs, posed
        The project as read, and the first poses of its photos.
    write
        Whether the project's table is written too, so that the next run finds it.
    progress
        Shows long loops.

    Raises
    ------
    InputError
        A photo cannot be read.
    OutputError
        The table cannot be written.
    """
    new = find_project_ties(inputs, posed, progress)
    path = ties_path(inputs.project, inputs.folder)
    messages = inputs.messages
    digests = inputs.digests
    ties = new.ties
    if path is not None:
        messages = (*messages, *new.messages(path.name))
        content = update_ties(path, ties)
        if write and content is not None:
            replace_bytes(path, content)
            digests = (*digests, digest_file(path, inputs.folder))
            ties = read_ties(path)
    return replace(inputs, ties=ties, digests=digests, messages=messages)
