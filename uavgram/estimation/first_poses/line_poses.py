"""First poses of frames from lines of known position alone, or with a few control points."""

from __future__ import annotations

import numpy as np

from uavgram.estimation.first_poses.known_height import known_height
from uavgram.estimation.first_poses.network import placing
from uavgram.estimation.methods.on_lines import OnLines, poses_from_lines
from uavgram.geometry.camera.back_projection import back_project_with_jacobian
from uavgram.model.arrays import Floats
from uavgram.model.flight.pose import CandidatePoses
from uavgram.model.survey.survey import Survey

FEWEST_ROWS = 6
"""A pose has six unknowns."""
WORSE = 25.0
"""Rise of the sum of squares over the best, up to which another minimum is worth a try."""


def line_poses(survey: Survey) -> tuple[CandidatePoses, ...]:
    """Poses of every frame in which points on lines of known position are enough for one.

    A control point counts as two lines, to the east and to the north: so a few may help out.
    """
    rows = _rows(survey)
    if not len(rows):
        return ()
    height = known_height(survey)
    parameters = survey.calibration.parameters
    ray, by_pixel, _ = back_project_with_jacobian(
        survey.calibration.model, parameters, survey.pixel_px
    )
    found = []
    for frame, name in enumerate(survey.frame_id):
        own = rows[survey.pick_frame[rows[:, 0].astype(np.int64)] == frame]
        pick = own[:, 0].astype(np.int64)
        if len(own) < FEWEST_ROWS or not np.isfinite(ray[pick]).all():
            continue
        root = by_pixel[pick, :2] * survey.pick_sigma_px[pick, None, None]
        ends = poses_from_lines(
            OnLines(
                ray=ray[pick][None],
                ray_root=root[None],
                start_m=own[None, :, 1:3],
                along=own[None, :, 3:5],
                sigma_m=own[None, :, 5],
            )
        )
        cost = ends.cost[0]
        near = np.flatnonzero(np.isfinite(cost) & (cost <= cost[0] + WORSE))
        if len(near):
            found.append(
                CandidatePoses(
                    frame_id=name,
                    center_world_m=ends.center[0, near] + [0.0, 0.0, height],
                    world_from_camera=ends.rotation[0, near],
                    misfit=np.sqrt(cost[near] / len(own)),
                )
            )
    return tuple(found)


def _rows(survey: Survey) -> Floats:
    """(R, 6) pick, place on a line, its direction, and its sigma, of points on the ground."""
    level = placing(survey) & (survey.height_above_m == 0.0)
    lines: dict[int, list[tuple[float, ...]]] = {}
    for one in survey.known:
        if one.position is None:
            continue
        start, end = one.position.ends_m[:, :2]
        along = (end - start) / np.linalg.norm(end - start)
        for label in one.label:
            lines.setdefault(label, []).append((*start, *along, one.sigma))
    if not lines:
        return np.zeros((0, 6))
    pairs = zip(
        survey.control_label.tolist(),
        survey.control_world_m.tolist(),
        survey.control_sigma_m.tolist(),
        strict=True,
    )
    for label, (east, north, _), (sigma_east, sigma_north, _) in pairs:
        to_north, to_east = (0.0, 1.0, sigma_east), (1.0, 0.0, sigma_north)
        lines.setdefault(label, []).extend((east, north, *each) for each in (to_north, to_east))
    rows = [
        (pick, *line)
        for pick, label in enumerate(survey.pick_label.tolist())
        if level[label]
        for line in lines.get(label, ())
    ]
    return np.array(rows, dtype=np.float64).reshape(-1, 6)
