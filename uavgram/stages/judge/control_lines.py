"""Places of lines of known position, and the distances of their points from them."""

from __future__ import annotations

from typing import cast

import numpy as np

from uavgram.estimation.survey.adjustment import Adjustment
from uavgram.geometry.ground.line_of_position import compute_line_offsets
from uavgram.model.arrays import Floats
from uavgram.model.result.known import (
    NO_LINES_OF_POSITION,
    ControlLineResults,
    KnownResults,
    LineOfPositionStatus,
)
from uavgram.model.survey.known import KnownThings, LinePosition


def judge_control_lines(
    adjustment: Adjustment, known: KnownThings, judged: KnownResults
) -> ControlLineResults:
    """Return lines of known position among all known things; none without a world frame.

    Parameters
    ----------
    adjustment
        Adjustment of the survey.
    known, judged
        All known things, and their fit.
    """
    placed = [(i, line) for i, line in enumerate(known.position) if line is not None]
    if not placed or adjustment.survey.gauge == "plane":
        return NO_LINES_OF_POSITION
    rows = [i for i, _ in placed]
    ends = np.stack([_ends(adjustment, line) for _, line in placed])
    return ControlLineResults(
        name=tuple(known.name[i] for i in rows),
        points=tuple(known.points[i] for i in rows),
        start_world_m=ends[:, 0],
        end_world_m=ends[:, 1],
        has_height=np.array([line.has_height for _, line in placed]),
        sigma_m=known.sigma[rows],
        offset_m=np.array([_offset(adjustment, line, known.points[i]) for i, line in placed]),
        w=judged.w[rows],
        redundancy=judged.redundancy[rows],
        mdb_m=judged.mdb[rows],
        status=tuple(cast("LineOfPositionStatus", judged.status[i]) for i in rows),
    )


def _ends(adjustment: Adjustment, line: LinePosition) -> Floats:
    """Return the ends (2, 3); on the ground of the first area, where no height is known."""
    ends = line.ends_m.copy()
    if not line.has_height:
        state, none = adjustment.state, np.zeros(2, dtype=np.int64)
        ground = adjustment.problem.ground.at(state.plane, state.relief, none, ends[:, :2])
        ends[:, 2] = ground.height_m
    return ends


def _offset(adjustment: Adjustment, line: LinePosition, points: tuple[str, ...]) -> float:
    label = adjustment.label_rows(points)
    label = label[label >= 0]
    if not len(label):
        return float("nan")
    world, _, _ = adjustment.problem.world_points(adjustment.state, label)
    off = compute_line_offsets(world, line.ends_m, upwards=False).value[:, 0]
    return float(off[np.abs(off).argmax()])
