"""First poses of frames from lines of known position, and which line contradicts the others."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.special import chdtrc

from uavgram.estimation.first_poses.known_height import known_height
from uavgram.estimation.first_poses.network import placing
from uavgram.estimation.methods.damped import Ends
from uavgram.estimation.methods.line_search import poses_from_lines
from uavgram.estimation.methods.on_lines import OnLines
from uavgram.geometry.camera.back_projection import back_project_with_jacobian
from uavgram.model.arrays import Floats, Ints
from uavgram.model.flight.pose import CandidatePoses
from uavgram.model.survey.survey import Survey

FEWEST_ROWS = 6
"""A pose has six unknowns."""
WORSE = 25.0
"""Rise of the sum of squares over the best, up to which another minimum is worth a try."""
UNLIKELY = 1e-4
"""Probability of a frame's sum of squares below which some line is wrong."""
SURE = 2.0 * float(np.log(1000.0))
"""Fall of the sum of squares by which one line is a likelier fault than any other."""
MOST_FRAMES = 3
"""Frames by which a line is judged: those that show most."""
CONTROL = -1
"""Number, in place of a line's, of what a control point says."""


class _Rows(NamedTuple):
    """R picks on lines: pick, number of the thing; start, direction (R, 2), sigma (R,) [m]."""

    pick: Ints
    thing: Ints
    start_m: Floats
    along: Floats
    sigma_m: Floats


class _Rays(NamedTuple):
    """(P, 3) rays of all picks, and roots (P, 2, 2) of the covariances of their x and y."""

    ray: Floats
    root: Floats


def line_poses(survey: Survey) -> tuple[CandidatePoses, ...]:
    """Poses of every frame in which points on lines of known position are enough for one.

    A control point counts as two lines, to the east and to the north: so a few may help out. A line
    that contradicts the others has no say.
    """
    rows = _rows(survey)
    if not len(rows.pick):
        return ()
    rays, height, odd = _rays(survey), known_height(survey), odd_lines(survey)
    found = []
    for frame, own in _by_frame(survey, rows, rays).items():
        some = own[~np.isin(rows.thing[own], list(odd))]
        ends = _poses(rows, rays, some if len(some) >= FEWEST_ROWS else own)
        cost = ends.cost[0]
        near = np.flatnonzero(np.isfinite(cost) & (cost <= cost[0] + WORSE))
        if len(near):
            found.append(
                CandidatePoses(
                    frame_id=survey.frame_id[frame],
                    center_world_m=ends.center[0, near] + [0.0, 0.0, height],
                    world_from_camera=ends.rotation[0, near],
                    misfit=np.sqrt(cost[near] / len(own)),
                )
            )
    return tuple(found)


def odd_lines(survey: Survey) -> frozenset[int]:
    """Number of the line of known position without which alone all others agree; or none.

    Where several could be it, none is.
    """
    rows = _rows(survey)
    if not len(rows.pick):
        return frozenset()
    rays = _rays(survey)
    frames = _by_frame(survey, rows, rays)
    misfits = [own for own in frames.values() if _cost(rows, rays, own) == np.inf]
    if not misfits:
        return frozenset()
    misfits = sorted(misfits, key=len)[-MOST_FRAMES:]
    shown = [set(rows.thing[own].tolist()) - {CONTROL} for own in misfits]
    without = {
        thing: sum(_cost(rows, rays, own[rows.thing[own] != thing]) for own in misfits)
        for thing in set.intersection(*shown)
    }
    best, *others = sorted((cost, thing) for thing, cost in without.items()) or [(np.inf, CONTROL)]
    is_sure = best[0] < np.inf and all(cost - best[0] >= SURE for cost, _ in others)
    return frozenset([best[1]] if is_sure else ())


def _cost(rows: _Rows, rays: _Rays, own: Ints) -> float:
    """Sum of squares of lines that determine a pose, check it, and fit it; else infinite."""
    degrees = len(own) - FEWEST_ROWS
    if degrees <= 0:
        return float("inf")
    cost = float(_poses(rows, rays, own).cost[0, 0])
    return cost if np.isfinite(cost) and chdtrc(degrees, cost) >= UNLIKELY else float("inf")


def _poses(rows: _Rows, rays: _Rays, own: Ints) -> Ends:
    """Of one frame by some of its rows, over ground at z = 0."""
    pick = rows.pick[own]
    return poses_from_lines(
        OnLines(
            ray=rays.ray[pick][None],
            ray_root=rays.root[pick][None],
            start_m=rows.start_m[own][None],
            along=rows.along[own][None],
            sigma_m=rows.sigma_m[own][None],
        )
    )


def _by_frame(survey: Survey, rows: _Rows, rays: _Rays) -> dict[int, Ints]:
    """Rows of each frame that has enough of them."""
    usable = np.isfinite(rays.ray[rows.pick]).all(axis=1)
    frame = survey.pick_frame[rows.pick]
    found = {f: np.flatnonzero(usable & (frame == f)) for f in range(len(survey.frame_id))}
    return {f: own for f, own in found.items() if len(own) >= FEWEST_ROWS}


def _rays(survey: Survey) -> _Rays:
    lens = survey.calibration
    ray, by_pixel, _ = back_project_with_jacobian(lens.model, lens.parameters, survey.pixel_px)
    return _Rays(ray, by_pixel[:, :2] * survey.pick_sigma_px[:, None, None])


def _rows(survey: Survey) -> _Rows:
    """Picks of points on the ground that lie on a line; no rows where there is no line."""
    lines: dict[int, list[tuple[float, ...]]] = {}
    for one in survey.known:
        if one.position is None:
            continue
        start, end = one.position.ends_m[:, :2]
        along = (end - start) / np.linalg.norm(end - start)
        for label in one.label:
            lines.setdefault(label, []).append((one.index, *start, *along, one.sigma))
    if lines:
        _add_control(survey, lines)
    level = placing(survey) & (survey.height_above_m == 0.0)
    found = [
        (pick, *line)
        for pick, label in enumerate(survey.pick_label.tolist())
        if level[label]
        for line in lines.get(label, ())
    ]
    table = np.array(found, dtype=np.float64).reshape(-1, 7)
    index: Ints = table[:, :2].astype(np.int64)
    return _Rows(index[:, 0], index[:, 1], table[:, 2:4], table[:, 4:6], table[:, 6])


def _add_control(survey: Survey, lines: dict[int, list[tuple[float, ...]]]) -> None:
    """Add each control point as a line to the north and one to the east."""
    for label, (east, north, _), (sigma_east, sigma_north, _) in zip(
        survey.control_label.tolist(),
        survey.control_world_m.tolist(),
        survey.control_sigma_m.tolist(),
        strict=True,
    ):
        lines.setdefault(label, []).extend(
            [
                (CONTROL, east, north, 0.0, 1.0, sigma_east),
                (CONTROL, east, north, 1.0, 0.0, sigma_north),
            ]
        )


def are_alone(survey: Survey) -> bool:
    """Whether nothing but lines of known position places a survey on the map."""
    few = len(survey.control_label) < 2
    return survey.telemetry is None and few and survey.gauge == "world"
