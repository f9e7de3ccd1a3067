"""Gain of one more reference line in a real survey, based on its own adjustment."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
from scipy.spatial import ConvexHull, QhullError

from uavgram.errors import InputError
from uavgram.estimation.measuring.propagation import MeasuredValues, propagate
from uavgram.estimation.survey.adjustment import Adjustment
from uavgram.estimation.survey.likelihood import SurveyProblem
from uavgram.estimation.survey.unknowns import Layout
from uavgram.geometry.ground.row_projection import RowPoses, project_rows
from uavgram.model.arrays import Floats, Ints
from uavgram.model.frames import Frames
from uavgram.model.observations import KnownLines
from uavgram.model.planned import NextLines
from uavgram.model.survey import NO_SIGHTINGS, Survey
from uavgram.pipeline.measure.compute import compute
from uavgram.pipeline.measure.inputs import Inputs, read_inputs
from uavgram.pipeline.measure.pose import pose_frames
from uavgram.pipeline.threads import limit_blas_threads
from uavgram.synthetic.observations import is_inside
from uavgram.synthetic.plan.layouts import (
    Candidates,
    Functions,
    Objective,
    compute_criterion_with_one_more,
    eliminate_points,
    invert,
    whiten_readings,
)
from uavgram.synthetic.plan.scene import compute_equal_weights, join_spots, make_spots

MIN_LENGTH_M, MAX_LENGTH_M = 3.0, 15.0
MAX_SPOTS = 150
REPORTED_COUNT = 3
"""Number of additional lines that are reported."""

MIN_RELATIVE_DISTANCE = 0.3
"""Smallest distance between reported lines, relative to the length."""

MIN_REDUNDANCY = 1e-9
"""Redundancy below which no other observation determines a reading."""


class _Places(NamedTuple):
    """Possible line ends in the world, and their pixels in photos: (F, K, 2), NaN if hidden."""

    world_m: Floats
    pixel_px: Floats


@limit_blas_threads
def find_next_lines(project: Path) -> NextLines:
    """Compute the effect of more and fewer reference lines on a project.

    Parameters
    ----------
    project
        The project file; it is run again, no file is written.

    Raises
    ------
    InputError
        An input is wrong, there is no measurement, or no line fits between its points.
    """
    return find_next_lines_of_inputs(read_inputs(project), project)


def find_next_lines_of_inputs(inputs: Inputs, project: Path) -> NextLines:
    """Compute the same for inputs that are already read."""
    posed = pose_frames(inputs)
    adjustment = compute(inputs, posed=posed, curved=False).refined.adjustment
    values = _values(adjustment, inputs, posed.frames, project)
    places = _places(adjustment, project)
    shown = np.isfinite(places.pixel_px[..., 0]).astype(np.float64)
    pairs = join_spots(places.world_m, (), shown.T @ shown > 0, (MIN_LENGTH_M, MAX_LENGTH_M))
    if not len(pairs):
        raise InputError(
            project,
            f"no line of {MIN_LENGTH_M:g} to {MAX_LENGTH_M:g} m fits between its points in a "
            "photo: pick points that are farther apart",
        )
    aim = _aim(adjustment, values)
    candidates = _candidates(adjustment, places, pairs, _tape_sigma(inputs.lines))
    covariance = invert(aim.information)
    found = compute_criterion_with_one_more(aim, candidates, covariance, np.arange(len(pairs)))
    best = _keep_different(places.world_m, pairs, found)
    ends = places.world_m[pairs[best]]
    near, near_m = _nearest(adjustment, ends)
    return NextLines(
        mean_sigma=aim.criterion(covariance),
        unit="m" if "m" in values.unit else values.unit[0],
        start_world_m=ends[:, 0],
        end_world_m=ends[:, 1],
        near=near,
        near_m=near_m,
        with_it=found[best],
        name=tuple(adjustment.survey.line_name[i] for i in adjustment.problem.line_index),
        without_it=_compute_without(adjustment, values, aim.weight),
    )


def _values(
    adjustment: Adjustment, inputs: Inputs, frames: Frames, project: Path
) -> MeasuredValues:
    """Return the measured values, without those that cannot be computed."""
    values = propagate(adjustment, inputs.requests, frames)
    measured = [row.request for row in values.rows if row.gradient is not None]
    kept = tuple(one for one in inputs.requests if one in measured)
    if not kept:
        raise InputError(
            project, "measures nothing, so nothing can become better known: add `measure:`"
        )
    return propagate(adjustment, kept, frames)


def _core(layout: Layout) -> Ints:
    """Return the unknowns shared by photos: the poses (without turning), and all behind them."""
    frames = layout.frame_columns(np.arange(layout.frames)).ravel()
    return np.concatenate([frames, np.arange(layout.first_intrinsic, layout.size)])


def _weights(values: MeasuredValues) -> Floats:
    return compute_equal_weights([row.request.kind for row in values.rows], values.unit)


def _aim(adjustment: Adjustment, values: MeasuredValues) -> Objective:
    """Return the measured values as functions of the core: regression on it, and remainder."""
    core = _core(adjustment.problem.layout)
    joint = adjustment.minimum.factor.joint(core)
    # regression of the values on the core: gradient = S_core^-1 S_core,values
    information = invert(joint)
    across = values.solved[core]
    gradient = (information @ across).T
    own = np.diag(values.covariance) - np.sum(gradient.T * across, axis=0)
    return Objective(information, Functions(gradient, np.maximum(own, 0.0)), _weights(values))


def _places(adjustment: Adjustment, project: Path) -> _Places:
    state, survey = adjustment.state, adjustment.survey
    point = state.point[:, :2]
    try:
        hull = point[ConvexHull(point).vertices]
    except QhullError:
        raise InputError(project, "has points in one line only: nothing can be planned") from None
    place = make_spots(hull, (), MAX_LENGTH_M, MAX_SPOTS)
    middle = int(np.argmin(np.linalg.norm(point - point.mean(axis=0), axis=1)))
    label = np.full(len(place), middle)
    own = np.zeros((len(place), adjustment.problem.layout.point_size))
    own[:, :2] = place
    world, _, _ = adjustment.problem.place_points(state, own, label)
    world[:, 2] -= survey.height_above_m[middle]
    poses = RowPoses(state.center[:, None], state.rotation[:, None], adjustment.sweep()[:, None])
    camera = survey.calibration
    pixel = project_rows(camera, adjustment.problem.intrinsics(state), poses, world[None])
    shown = is_inside(camera, pixel)[..., None]
    return _Places(world, np.where(shown, pixel, np.nan))


def _tape_sigma(lines: KnownLines) -> float:
    return float(np.median(lines.sigma_m)) if len(lines.name) else 0.01


def _candidates(adjustment: Adjustment, places: _Places, pairs: Ints, sigma_m: float) -> Candidates:
    """Return lines between possible ends, picked as the survey's points are, in its likelihood."""
    survey, state = adjustment.survey, adjustment.state
    seen = np.isfinite(places.pixel_px[..., 0])
    used = np.flatnonzero(seen.any(axis=0))
    row = np.full(len(places.world_m), -1)
    row[used] = np.arange(len(used))
    # possible ends that at least one photo shows, picked in all photos that show them
    pick_label, pick_frame = np.nonzero(seen[:, used].T)
    candidate = _select_part(survey, len(used), row[pairs], adjustment.problem.tapes, sigma_m)
    candidate = replace(
        candidate,
        pick_frame=pick_frame,
        pick_label=pick_label,
        pixel_px=places.pixel_px[:, used][pick_frame, pick_label],
        pick_sigma_px=np.full(len(pick_frame), float(np.median(survey.pick_sigma_px))),
    )
    problem = SurveyProblem(
        candidate, adjustment.problem.pivot_m, np.ones(len(pairs), dtype=np.bool_)
    )
    point = np.zeros((len(used), problem.layout.point_size))
    point[:, :2] = places.world_m[used, :2]
    # linearise at the adjusted state of the survey, with the possible ends as points
    there = replace(
        state,
        point=point,
        picked=np.zeros((0, problem.layout.point_size)),
        tie=np.zeros((0, problem.layout.point_size)),
        turning=np.zeros((len(state.center), 0)),
    )
    blocks = problem.evaluate(there)
    if blocks is None:
        raise ValueError("places that photos show lie in front of them")
    tapes = blocks["lengths"]
    # eliminate the possible ends; whitened rows of the tape readings on the core
    points = eliminate_points(problem, {k: v for k, v in blocks.items() if k in POINT_KINDS})
    ends = row[pairs]
    whitened = whiten_readings(points, problem.layout, tapes.columns[:, None], tapes.jacobian, ends)
    return Candidates(whitened, ends, points.root)


POINT_KINDS = ("pixels", "roughness", "idle")
"""Observations of the possible ends; all others are already in the survey."""


def _select_part(
    survey: Survey, count: int, pairs: Ints, tapes: tuple[str, ...], sigma_m: float
) -> Survey:
    """Return a survey of the same photos with other points and lines, without other priors."""
    names = tapes or ("",)
    return replace(
        survey,
        label=tuple(f"spot{i}" for i in range(count)),
        height_above_m=np.zeros(count),
        height_sigma_m=np.zeros(count),
        is_free=np.zeros(count, dtype=np.bool_),
        identification_sigma_m=np.zeros(count),
        area=np.zeros(count, dtype=np.int64),
        target_pick=np.zeros(0, dtype=np.int64),
        matches=NO_SIGHTINGS,
        ties=NO_SIGHTINGS,
        known=(),
        control_label=np.zeros(0, dtype=np.int64),
        control_world_m=np.zeros((0, 3)),
        control_sigma_m=np.zeros((0, 3)),
        line_start=pairs[:, 0],
        line_end=pairs[:, 1],
        length_m=np.ones(len(pairs)),
        length_sigma_m=np.full(len(pairs), sigma_m),
        line_name=(),
        line_tape=tuple(names[i % len(names)] for i in range(len(pairs))),
        line_along=(),
        tape_scale_sigma=survey.tape_scale_sigma if tapes else 0.0,
        own_scale_sigma=survey.own_scale_sigma if tapes else (),
    )


def _keep_different(world_m: Floats, pairs: Ints, found: Floats) -> Ints:
    """Return the (n,) best lines that are not nearly the same."""
    middle = world_m[pairs].mean(axis=1)
    length = np.linalg.norm(np.diff(world_m[pairs], axis=1)[:, 0], axis=1)
    chosen: list[int] = []
    for one in np.argsort(found).tolist():
        away = [np.linalg.norm(middle[one] - middle[other]) for other in chosen]
        if all(distance > MIN_RELATIVE_DISTANCE * length[one] for distance in away):
            chosen.append(one)
        if len(chosen) == REPORTED_COUNT:
            break
    return np.array(chosen, dtype=np.int64)


def _nearest(adjustment: Adjustment, ends_m: Floats) -> tuple[tuple[tuple[str, str], ...], Floats]:
    point, label = adjustment.state.point[:, :2], adjustment.survey.label
    away = np.linalg.norm(ends_m[:, :, None, :2] - point, axis=-1)
    which = away.argmin(axis=-1)
    return tuple((label[a], label[b]) for a, b in which), away.min(axis=-1)


def _compute_without(adjustment: Adjustment, values: MeasuredValues, weight: Floats) -> Floats:
    """Compute the (L,) mean sigma without each line, by removing its row from the normal matrix.

    Without an observation of gradient a and unit variance the covariance S grows by S a a^T S / (1
    - a^T S a) (Plackett 1950).
    """
    block = adjustment.minimum.blocks.get("lengths")
    if block is None:
        return np.zeros(0)
    rows = np.zeros((adjustment.problem.layout.size, len(block.columns)))
    at = np.arange(len(block.columns))[:, None]
    np.add.at(rows, (block.columns, at), block.jacobian[:, 0])
    left = 1.0 - np.sum(rows * adjustment.minimum.factor.solve(rows), axis=0)
    across = values.gradient.T @ adjustment.minimum.factor.solve(rows)
    held = left > MIN_REDUNDANCY
    more = across**2 / np.where(held, left, np.nan)
    return np.asarray(weight @ np.sqrt(np.diag(values.covariance)[:, None] + more))
