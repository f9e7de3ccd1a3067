"""Refine: poses, points and all that is shared, in one maximum-likelihood adjustment."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.stats import chi2

from uavgram.errors import GeometryError
from uavgram.estimation.adjustment import Adjustment, Refined, Removal
from uavgram.estimation.first_values import (
    FirstValues,
    PlaneNetwork,
    align_in_plane,
    from_telemetry,
    length_candidates,
    lines_per_frame,
)
from uavgram.estimation.least_squares import Minimum, minimise
from uavgram.estimation.normal_equations import SingularError
from uavgram.estimation.reliability import critical_value, reliability
from uavgram.estimation.survey_problem import SurveyProblem
from uavgram.estimation.survey_select import select_lines, select_picks
from uavgram.estimation.survey_state import State, move
from uavgram.geometry.back_projection import back_project
from uavgram.model.arrays import Bools, Floats
from uavgram.model.message import Message
from uavgram.model.options import SolveOptions
from uavgram.model.survey import Survey

AS_GOOD = 0.001
"""Probability below which an alternative's extra cost rules it out."""

TIE = 1e-3
"""Relative difference of standardised residuals below which they do not tell blunders apart."""

BEYOND_LENS = "the lens model cannot be inverted at that pixel"
NO_GROUND = "its ray does not meet the ground in front of the camera"
NOT_JOINED = (
    "its frame has neither telemetry, nor three known lengths, nor four points in common with "
    "the frames that do"
)


@dataclass(frozen=True, eq=False)
class _Start:
    """A survey reduced to usable picks, with one or more sets of first values."""

    survey: Survey
    values: tuple[FirstValues, ...]


def refine(survey: Survey, options: SolveOptions) -> tuple[Refined, tuple[Message, ...]]:
    """Adjust a survey.

    Parameters
    ----------
    survey
        Observations and priors.
    options
        What to do about blunders: with ``remove`` the observation with the largest standardised
        residual above the critical value is taken out and everything adjusted anew, one at a
        time, until none is left.

    Raises
    ------
    GeometryError
        The observations do not determine the survey; the message names what is missing.
    """
    keep, reason = _in_lens(survey)
    out = {
        "pick": np.zeros(len(survey.pick_frame), dtype=bool),
        "line": np.zeros(len(survey.line_start), dtype=bool),
    }
    removals: list[Removal] = []
    remarks: list[Message] = []
    refined = _adjust(survey, keep, out["line"], reason)
    while options.outliers == "remove":
        blunders = _blunders(refined, options)
        if len(blunders) != 1:
            remarks += [_not_located(survey, blunders)] if blunders else []
            break
        (blunder,) = blunders
        out[blunder.kind][blunder.index] = True
        try:
            refined = _adjust(survey, keep & ~out["pick"], out["line"], reason)
        except GeometryError as why:  # nothing is left to solve by: better with it than not at all
            out[blunder.kind][blunder.index] = False
            remarks.append(_indispensable(survey, blunder, why))
            break
        removals.append(blunder)
    result = replace(
        refined,
        removals=tuple(removals),
        pick_removed=out["pick"],
        line_removed=out["line"],
    )
    return result, (*_messages(survey, result), *remarks)


def _in_lens(survey: Survey) -> tuple[Bools, dict[int, str]]:
    ray = back_project(survey.calibration.model, survey.calibration.parameters, survey.pixel_px)
    keep: Bools = np.isfinite(ray.sum(axis=1))
    return keep, {int(i): BEYOND_LENS for i in np.flatnonzero(~keep)}


def _adjust(survey: Survey, keep: Bools, line_removed: Bools, reason: dict[int, str]) -> Refined:
    """One adjustment of the picks in `keep`, all minima; picks without first values are left."""
    reason = dict(reason)
    while True:
        if not keep.any():
            raise GeometryError(
                "no usable pick is left; the picks were left out because: "
                + "; ".join(sorted(set(reason.values())))
            )
        selection = select_picks(survey, keep)
        line_used = ~line_removed[selection.line_index]
        starts = _first_values(select_lines(selection.survey, line_used))
        unusable = [_unusable(selection.survey, values) for values in starts]
        # Of several poses that explain the lengths, one that sees sky where points were picked
        # comes after those that see ground.
        fewest = min(unusable, key=len)
        if not fewest:
            break
        left = selection.pick_index[list(fewest)]
        reason |= dict(zip(left.tolist(), fewest.values(), strict=True))
        keep = keep.copy()
        keep[left] = False
    possible = [v for v, without in zip(starts, unusable, strict=True) if not without]
    adjustment, *alternatives = _minima(selection.survey, possible, line_used)
    return Refined(
        adjustment=adjustment,
        pick_index=selection.pick_index,
        line_index=selection.line_index,
        removals=(),
        pick_removed=np.zeros(0, dtype=bool),
        line_removed=line_removed,
        pick_reason=reason,
        alternatives=tuple(alternatives),
    )


def _minima(survey: Survey, starts: list[FirstValues], line_used: Bools) -> list[Adjustment]:
    """The best minimum, and every other one that explains the observations nearly as well."""
    found = []
    undetermined: GeometryError | None = None
    for values in starts:
        try:
            found.append(_minimise(survey, values, line_used))
        except GeometryError as error:  # one start may lie where two solutions merge
            undetermined = undetermined or error
    if undetermined is not None and not found:
        raise undetermined
    found.sort(key=lambda minimum: minimum[1].cost)
    limit = found[0][1].cost + float(chi2.ppf(1 - AS_GOOD, 1))
    minima = [_adjustment(*found[0])]
    for problem, minimum in found[1:]:
        as_good = minimum.converged and minimum.cost < limit
        if as_good and all(_apart(known, minimum.state) for known in minima):
            minima.append(_adjustment(problem, minimum))
    return minima


def _first_values(survey: Survey) -> list[FirstValues]:
    """Sets of first values, most likely first; picks they leave without a place are NaN."""
    ray = back_project(survey.calibration.model, survey.calibration.parameters, survey.pixel_px)
    if survey.telemetry is not None:
        return [from_telemetry(survey, ray)]
    counts = lines_per_frame(survey)
    candidates = {
        int(f): length_candidates(survey, ray, int(f)) for f in np.flatnonzero(counts >= 3)
    }
    planes = {f: found[0].plane for f, found in candidates.items() if found}
    if survey.gauge == "world":
        return [_over_control(survey, ray, planes)]
    if not planes:
        raise GeometryError(
            "without a flight log a pose needs three known lengths that one frame sees whole "
            f"(most here: {counts.max()} in {survey.frame_id[int(counts.argmax())]!r}): pick both "
            "ends of more lines in one frame, tape a fourth, or give the log"
        )
    first = max(planes, key=lambda f: (counts[f], -f))
    values = []
    for candidate in candidates[first]:
        network = PlaneNetwork(survey, ray)
        network.start(first, candidate.plane)
        network.grow(planes)
        values.append(_at_gauge(network))
    return values


def _over_control(survey: Survey, ray: Floats, planes: dict[int, Floats]) -> FirstValues:
    """First values over control points; their heights above the label's own give the plane's."""
    label = survey.control_label
    height = float(np.mean(survey.control_world_m[:, 2] - survey.height_above_m[label]))
    network = PlaneNetwork(survey, ray)
    network.place_points(label, survey.control_world_m[:, :2])
    network.grow(planes)
    if np.isnan(network.center).all():
        raise GeometryError(
            "without a flight log a pose needs four control points in one frame, or two and three "
            "known lengths: pick more of them, or give the log"
        )
    center = network.center + np.array([0.0, 0.0, height])
    return FirstValues(network.point, center, network.rotation, height)


def _at_gauge(network: PlaneNetwork) -> FirstValues:
    """The network turned and shifted so that its first frame meets the gauge's conditions."""
    placed = int(np.flatnonzero(np.isfinite(network.center[:, 0]))[0])
    image_up = -network.rotation[placed][:2, 1]
    size = np.linalg.norm(image_up)
    north = image_up / size if size > 0 else np.array([0.0, 1.0])
    center = network.center[placed, :2]
    turn, shift = align_in_plane(
        np.stack([center, center + north]), np.array([[0.0, 0.0], [0.0, 1.0]])
    )
    return FirstValues(
        network.point @ turn[:2, :2].T + shift[:2],
        network.center @ turn.T + shift,
        turn @ network.rotation,
        0.0,
    )


def _unusable(survey: Survey, values: FirstValues) -> dict[int, str]:
    """Picks without first values in front of their camera, and why."""
    frame, label = survey.pick_frame, survey.pick_label
    up = np.full(len(label), values.height_m) + survey.height_above_m[label]
    world = np.column_stack([values.point_m[label], up])
    depth = np.einsum("ni,ni->n", world - values.center[frame], values.rotation[frame][:, :, 2])
    placed = np.isfinite(values.center[frame, 0])
    usable = placed & (np.nan_to_num(depth, nan=-1.0) > 0)
    return {int(i): NO_GROUND if placed[i] else NOT_JOINED for i in np.flatnonzero(~usable)}


def _minimise(
    survey: Survey, values: FirstValues, line_used: Bools
) -> tuple[SurveyProblem, Minimum[State]]:
    pivot = values.point_m.mean(axis=0)
    problem = SurveyProblem(survey, pivot, line_used)
    layout = problem.layout
    point = np.zeros((layout.points, layout.point_size))
    point[:, :2] = values.point_m
    state = State(
        point=point,
        center=np.array(values.center),
        rotation=np.array(values.rotation),
        intrinsic=np.zeros(layout.intrinsics),
        plane=np.array([values.height_m, 0.0, 0.0]),
        telemetry=problem.telemetry_mean if layout.telemetry else np.zeros(0),
    )
    try:
        minimum = minimise(
            state,
            problem.evaluate,
            lambda now, step: move(layout, now, step),
            layout.size,
            layout.structure,
        )
    except SingularError as error:
        raise GeometryError(
            f"the observations do not determine {layout.describe(error.index, survey)}: add known "
            "lengths or picks there, or leave it out"
        ) from error
    return problem, minimum


def _adjustment(problem: SurveyProblem, minimum: Minimum[State]) -> Adjustment:
    return Adjustment(problem, minimum, minimum.factor.covariance())


def _apart(adjustment: Adjustment, other: State) -> bool:
    """Whether another minimum has points elsewhere, by more than a thousandth of the scene."""
    here = adjustment.state.point[:, :2]
    span = np.ptp(here, axis=0).max()
    return bool(np.abs(here - other.point[:, :2]).max() > 1e-3 * span)


def _blunders(refined: Refined, options: SolveOptions) -> list[Removal]:
    """The pick or length with the largest standardised residual above the critical value.

    More than one where they tie: with a single redundancy every standardised residual is the
    same, and nothing tells which observation is wrong (Foerstner 1983, separability).
    """
    adjustment = refined.adjustment
    blocks, covariance = adjustment.minimum.blocks, adjustment.covariance
    pick = np.abs(reliability(blocks["pixels"], covariance).w).max(axis=1)
    found = [Removal("pick", int(refined.pick_index[k]), float(w)) for k, w in enumerate(pick)]
    if "lengths" in blocks:
        line = np.abs(reliability(blocks["lengths"], covariance).w)[:, 0]
        used = refined.line_index[adjustment.problem.line_index]
        found += [Removal("line", int(used[k]), float(w)) for k, w in enumerate(line)]
    largest = max(removal.w for removal in found)
    if largest <= critical_value(options.significance):
        return []
    return [removal for removal in found if removal.w >= (1.0 - TIE) * largest]


def _messages(survey: Survey, refined: Refined) -> tuple[Message, ...]:
    messages = []
    for index, why in sorted(refined.pick_reason.items()):
        label = survey.label[survey.pick_label[index]]
        frame = survey.frame_id[survey.pick_frame[index]]
        text = f"The pick of {label!r} in {frame!r} was left out: {why}."
        messages.append(Message("warning", "pick-left-out", text))
    messages += [
        Message("warning", f"{removal.kind}-removed", _removal(survey, removal))
        for removal in refined.removals
    ]
    if not refined.adjustment.minimum.converged:
        text = (
            "The adjustment did not come to rest: do not trust these numbers. Look for a swapped "
            "label or a wrong length."
        )
        messages.append(Message("error", "not-converged", text))
    return (*messages, *_ambiguity(refined))


def _removal(survey: Survey, removal: Removal) -> str:
    what = _observation(survey, removal)
    return f"{what} was removed as a blunder (w = {removal.w:.1f}); the rest was adjusted anew."


def _observation(survey: Survey, removal: Removal) -> str:
    if removal.kind == "pick":
        label = survey.label[survey.pick_label[removal.index]]
        frame = survey.frame_id[survey.pick_frame[removal.index]]
        return f"The pick of {label!r} in {frame!r}"
    start = survey.label[survey.line_start[removal.index]]
    end = survey.label[survey.line_end[removal.index]]
    return f"The length {start!r} to {end!r}"


def _not_located(survey: Survey, blunders: list[Removal]) -> Message:
    lines = [_observation(survey, b) for b in blunders if b.kind == "line"]
    named = ", ".join(lines or [_observation(survey, b) for b in blunders[:4]])
    text = (
        f"There is a blunder (w = {blunders[0].w:.1f}), but {len(blunders)} observations could be "
        f"the wrong one, so none was removed: {named}. Look at them, or tape another line."
    )
    return Message("warning", "blunder-not-located", text)


def _indispensable(survey: Survey, removal: Removal, why: GeometryError) -> Message:
    text = (
        f"{_observation(survey, removal)} looks like a blunder (w = {removal.w:.1f}), but was "
        f"kept: without it, {why}"
    )
    return Message("warning", "blunder-kept", text)


def _ambiguity(refined: Refined) -> list[Message]:
    survey = refined.adjustment.survey
    if survey.telemetry is not None or survey.gauge == "world":
        return []
    messages = []
    if refined.alternatives:
        text = (
            f"The lengths fit {len(refined.alternatives) + 1} different poses equally well; the "
            "measured values of the others stand under alternatives. Tape another line that does "
            "not close a triangle, or give the flight log."
        )
        messages.append(Message("warning", "ambiguous-pose", text))
    if len(refined.adjustment.problem.line_index) == 3:
        text = (
            "Three lengths alone: nothing checks them, and they may have several solutions. Tape "
            "a fourth line that does not close a triangle."
        )
        messages.append(Message("warning", "three-lengths", text))
    return messages
