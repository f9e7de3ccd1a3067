"""Footprints of the photos: their borders on the ground, and in each other."""

from __future__ import annotations

import numpy as np
import rerun as rr

from uavgram.geometry.ground.row_projection import row_poses
from uavgram.model.arrays import Floats
from uavgram.model.result.result import Result
from uavgram.stages.products.map_layers import footprints
from uavgram.views.recording.photo_marks import log_batches, log_polylines
from uavgram.views.recording.stream import Recorder
from uavgram.views.style import OBSERVED, QUIET
from uavgram.views.survey.drawing import flight_order, project_from, sampled, visible_runs

ALL = "survey/footprints"
CURRENT = "survey/footprint_of_this_photo"
NEIGHBOURS = "footprints_before_and_after"
# Each piece of a border is short: its bend in another photo needs few samples.
SAMPLES = 7


def log_footprints(recorder: Recorder, result: Result, photo: str) -> None:
    """Log all borders on the ground, that of each frame, and those of its neighbours in it.

    Parameters
    ----------
    recorder
        The open recording.
    result
        Result of the run.
    photo
        Path of the photo's entity.
    """
    rings = {frame: closed(ring) for frame, ring in footprints(result).items()}
    if not rings:
        return
    width = rr.Radius.ui_points(0.4)
    recorder.static(ALL, rr.LineStrips3D(list(rings.values()), colors=QUIET, radii=width))
    recorder.static(
        CURRENT, rr.LineStrips3D.from_fields(colors=OBSERVED, radii=rr.Radius.ui_points(0.8))
    )
    frames = range(len(result.frames.frame_id))
    strips = [[rings[frame]] if frame in rings else [] for frame in frames]
    log_batches(
        recorder,
        CURRENT,
        [len(some) for some in strips],
        lambda rows: rr.LineStrips3D.columns(strips=[s for i in rows for s in strips[i]]),
    )
    log_polylines(recorder, f"{photo}/{NEIGHBOURS}", _in_photos(result, rings), QUIET, 1.0)


def closed(ring: Floats) -> Floats:
    """Close a border: (v + 1, 3), with its first corner repeated."""
    return np.concatenate([ring, ring[:1]])


def _in_photos(result: Result, rings: dict[int, Floats]) -> list[list[Floats]]:
    """Return the borders of the photos before and after each frame, in the frame's pixels."""
    flown = [int(frame) for frame in flight_order(result) if int(frame) in rings]
    lines: list[list[Floats]] = [[] for _ in result.frames.frame_id]
    borders = {frame: sampled(ring, SAMPLES) for frame, ring in rings.items()}
    for k, frame in enumerate(flown):
        if not result.has_refined[frame]:
            continue
        for other in (*flown[max(k - 1, 0) : k], *flown[k + 1 : k + 2]):
            pixel = project_from(result, row_poses(result, frame), borders[other])
            lines[frame] += visible_runs(pixel)
    return lines
