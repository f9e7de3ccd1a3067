"""Readjust from the current estimate, after a change of the model or with a few more picks.

With more picks, gross errors are not looked for, and the noise stays as it was learnt: both are
tasks of the adjustment that follows. The purpose is to predict, from the poses and the new picks,
where other photos show the same points.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from uavgram.estimation.survey.adjustment import Adjustment
from uavgram.estimation.survey.likelihood import SurveyProblem
from uavgram.estimation.survey.unknowns import State
from uavgram.geometry.ground.plane import intersect_ground
from uavgram.geometry.ground.row_projection import RowPoses, sight_lines
from uavgram.model.arrays import Bools, Floats, Ints
from uavgram.model.survey import Survey
from uavgram.stages.refine.staged_sigmas import iterate


def readjust(adjustment: Adjustment, survey: Survey) -> Adjustment:
    """Readjust from the current estimate with other sigmas or another ground.

    Raises
    ------
    SingularError
        An unknown is not determined.
    """
    problem = SurveyProblem(survey, adjustment.problem.pivot_m, find_used_lines(adjustment))
    start = convert_state(adjustment, problem)
    minimum = iterate(problem, start)
    return Adjustment(problem, minimum, minimum.factor.covariance())


def convert_state(adjustment: Adjustment, problem: SurveyProblem) -> State:
    """Convert the state of an adjustment to the unknowns of another likelihood of the same survey.

    Unknowns that the adjustment does not have begin at zero.
    """
    state, before, survey = adjustment.state, adjustment.problem, problem.survey
    # Coordinates that both have; others, such as heights, begin at zero.
    point = np.zeros((problem.layout.points, problem.layout.point_size))
    shared = min(point.shape[1], state.point.shape[1])
    point[:, :shared] = state.point[:, :shared]
    picked = np.array(point[survey.identified])
    _, new, kept = np.intersect1d(survey.identified, before.survey.identified, return_indices=True)
    picked[new, :shared] = state.picked[kept, :shared]
    tie = np.zeros((problem.layout.ties, problem.layout.point_size))
    tie[:, :shared] = state.tie[:, :shared]
    # Relief of areas with the same kind of surface.
    relief = np.zeros(problem.layout.relief)
    for area, ground in enumerate(survey.grounds):
        old = before.survey.grounds[area].relief
        if ground.relief is not None and old is not None and old.kind == ground.relief.kind:
            relief[problem.ground.relief_rows(area)] = state.relief[before.ground.relief_rows(area)]
    turning = np.zeros((problem.layout.frames, problem.layout.frame_size - 6))
    if turning.shape == state.turning.shape:
        turning = state.turning
    readout = state.readout
    if len(readout) != problem.layout.readout:
        readout = np.zeros(0) if survey.rolling is None else survey.rolling.first_value
    scale = dict(zip(before.tapes, state.tape.tolist(), strict=True))
    tape = np.array([scale.get(name, 0.0) for name in problem.tapes])
    return replace(
        state,
        point=point,
        picked=picked,
        tie=tie,
        relief=relief,
        readout=readout,
        turning=turning,
        tape=tape,
    )


def find_used_lines(adjustment: Adjustment) -> Bools:
    """Mark the known lengths (L,) that take part."""
    used = np.zeros(len(adjustment.survey.line_start), dtype=np.bool_)
    used[adjustment.problem.line_index] = True
    return used


MAX_ITERATIONS = 4
"""Iterations: a pick of a new label changes only its point; another one of a known label little."""


@dataclass(frozen=True, eq=False)
class MorePicks:
    """New picks by name: label (m,), index of the frame (m,), pixel (m, 2), sigma (m,) [px].

    Picks that the adjustment has are moved. A label that it does not have is on the ground of the
    first area.
    """

    label: Sequence[str]
    frame: Ints
    pixel_px: Floats
    sigma_px: Floats


def add_picks(adjustment: Adjustment, more: MorePicks, uneven_m: float) -> Adjustment:
    """Readjust with picks that the adjustment does not have yet, or has elsewhere.

    Parameters
    ----------
    adjustment
        The adjusted survey.
    more
        Picks in its frames. New labels whose sight lines do not meet the ground are left out.
    uneven_m
        Least roughness of the ground [m].

    Raises
    ------
    SingularError
        An unknown is not determined.
    ValueError
        A pick is behind its camera.
    """
    ground = _on_ground(adjustment, more)
    known = {label: k for k, label in enumerate(adjustment.survey.label)}
    new: dict[str, int] = {}
    for row, label in enumerate(more.label):
        if label not in known and np.isfinite(ground[row]).all():
            new.setdefault(label, row)
    survey = _add_picks(_add_labels(adjustment.survey, tuple(new)), more)
    rough = tuple(
        replace(one, roughness_sigma_m=max(one.roughness_sigma_m, uneven_m))
        for one in survey.grounds
    )
    survey = replace(survey, grounds=rough)
    problem = SurveyProblem(survey, adjustment.problem.pivot_m, find_used_lines(adjustment))
    start = _initial_state(adjustment, problem, ground[list(new.values()), :2])
    minimum = iterate(problem, start, MAX_ITERATIONS)
    return Adjustment(problem, minimum, minimum.factor.covariance())


def _initial_state(adjustment: Adjustment, problem: SurveyProblem, new_m: Floats) -> State:
    """Return the state of an adjustment, with more labels at the end, at places (n, 2)."""
    count = len(new_m)
    padded = np.pad(adjustment.state.point, ((0, count), (0, 0)))
    padded[len(padded) - count :, :2] = new_m
    minimum = replace(adjustment.minimum, state=replace(adjustment.state, point=padded))
    return convert_state(replace(adjustment, minimum=minimum), problem)


def _add_labels(survey: Survey, labels: tuple[str, ...]) -> Survey:
    """Append labels on the ground of the first area.

    The learnt departure of points from the ground holds for them, too.
    """
    none = np.zeros(len(labels))
    plain = (survey.height_above_m == 0.0) & ~survey.is_free & (survey.area == 0)
    departs = float(survey.height_sigma_m[plain].max(initial=0.0))
    return replace(
        survey,
        label=(*survey.label, *labels),
        height_above_m=np.append(survey.height_above_m, none),
        height_sigma_m=np.append(survey.height_sigma_m, none + departs),
        identification_sigma_m=np.append(
            survey.identification_sigma_m,
            none + survey.identification_sigma_m.max(initial=0.0),
        ),
        is_free=np.append(survey.is_free, none.astype(np.bool_)),
        area=np.append(survey.area, none.astype(np.int64)),
    )


def _add_picks(survey: Survey, more: MorePicks) -> Survey:
    """Append picks, or move those that exist."""
    label = {name: k for k, name in enumerate(survey.label)}
    keys = zip(survey.pick_frame.tolist(), survey.pick_label.tolist(), strict=True)
    there = {key: k for k, key in enumerate(keys)}
    pixel, added = np.array(survey.pixel_px), []
    for row, (name, frame) in enumerate(zip(more.label, more.frame.tolist(), strict=True)):
        old = there.get((frame, label.get(name, -1)))
        if old is not None:
            pixel[old] = more.pixel_px[row]
        elif name in label:
            added.append(row)
    labels = np.array([label[more.label[row]] for row in added], dtype=np.int64)
    return replace(
        survey,
        pick_frame=np.append(survey.pick_frame, more.frame[added]),
        pick_label=np.append(survey.pick_label, labels),
        pixel_px=np.concatenate([pixel, more.pixel_px[added]]),
        pick_sigma_px=np.append(survey.pick_sigma_px, more.sigma_px[added]),
    )


def _on_ground(adjustment: Adjustment, more: MorePicks) -> Floats:
    """Intersect sight lines with the first area's plane (m, 3); NaN where they do not meet it."""
    state, problem = adjustment.state, adjustment.problem
    poses = RowPoses(
        state.center[more.frame], state.rotation[more.frame], adjustment.sweep()[more.frame]
    )
    lens = problem.intrinsics(state)
    lines = sight_lines(problem.survey.calibration, lens, poses, more.pixel_px)
    return intersect_ground(*lines, state.plane[:3], problem.pivot_m[0])
