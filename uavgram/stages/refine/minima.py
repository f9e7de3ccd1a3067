"""Minima of the likelihood: the distinct ones, from all first values, that explain the data."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import partial
from typing import NamedTuple

import numpy as np
from scipy.special import chdtri

from uavgram.errors import GeometryError
from uavgram.estimation.first_poses.first_values import FirstValues, add_first_ties
from uavgram.estimation.first_poses.known_frames import align_in_plane
from uavgram.estimation.measuring.scale import describe_line_faults
from uavgram.estimation.solver.levenberg_marquardt import MAX_ITERATIONS, Minimum
from uavgram.estimation.solver.normal_equations import SingularError
from uavgram.estimation.survey.adjustment import Adjustment, LeftOut, LeftOutCause, Refined
from uavgram.estimation.survey.ground_planes import compute_area_centroids, make_first_planes
from uavgram.estimation.survey.likelihood import SurveyProblem
from uavgram.estimation.survey.selection import (
    remove_known,
    remove_ties,
    select_lines,
    select_picks,
    widen_poses,
)
from uavgram.estimation.survey.unknowns import Layout, State
from uavgram.model.arrays import Bools
from uavgram.model.survey import Survey
from uavgram.stages.refine.first_values import (
    cost_with_lost,
    find_doubtful_frames,
    find_first_values,
    find_other_first_values,
    find_unusable_picks,
)
from uavgram.stages.refine.staged_sigmas import DAMPING, approach_minimum, iterate


class UndeterminedError(GeometryError):
    """Undetermined unknown; `dependent_picks` (P,) are the picks that depend on it alone."""

    def __init__(self, message: str, picks: Bools) -> None:
        self.dependent_picks = picks
        super().__init__(message)


def find_dependent_picks(index: int, layout: Layout, survey: Survey) -> Bools:
    """Mark the picks (P,) of the point, or of the frame, that an unknown belongs to.

    Parameters
    ----------
    index
        Column of the unknown.
    layout
        Columns of all unknowns.
    survey
        Survey with P picks.
    """
    if layout.first_tie <= index < layout.first_frame:
        return np.zeros(len(survey.pick_label), dtype=np.bool_)
    if index < layout.first_tie:
        return np.asarray(survey.pick_label == layout.label_of(index, survey))
    frame = (index - layout.first_frame) // layout.frame_size
    return np.asarray((survey.pick_frame == frame) & (index < layout.first_intrinsic))


def describe_weakness(survey: Survey, values: FirstValues, line_used: Bools) -> str:
    """Describe the weakness of the lengths as a set, if any, as the end of a sentence.

    Parameters
    ----------
    survey
        Survey with L known lengths.
    values
        First values, among them the places of the points.
    line_used
        (L,) lengths that take part.
    """
    start, end = survey.line_start[line_used], survey.line_end[line_used]
    if survey.telemetry is not None or survey.known or len(start) < 3:
        return ""
    faults = describe_line_faults(values.point_m[start], values.point_m[end], values.point_m)
    if not faults and len(start) == 3:
        faults = ("two of the poses that three lengths allow merge here: tape a fourth line",)
    return f" ({'; '.join(faults)})" if faults else ""


RIVAL_PROBABILITY = 0.001
"""Probability below which an alternative's extra cost rules it out."""

MAX_RIVAL_COST = float(chdtri(1, RIVAL_PROBABILITY))
"""Extra cost of that probability: likelihood ratio test with one degree of freedom."""

MAX_RETRIES, MIN_RETRY_GAIN = 3, 1.0
"""Rounds in which frames in doubt begin again; decrease of the cost that justifies another
round."""


@dataclass(frozen=True, eq=False)
class Participants:
    """Observations of a survey that take part in an adjustment.

    Attributes
    ----------
    survey
        All observations.
    keep
        (P,) picks that take part.
    line_removed
        (L,) lengths that do not.
    reason
        Reasons why picks do not, by their index.
    known_removed
        Numbers of known things that do not.
    pose_widened
        Factors by which the sigmas of wrong poses of the log are enlarged, by photo.
    """

    survey: Survey
    keep: Bools
    line_removed: Bools
    reason: Mapping[int, LeftOut]
    known_removed: frozenset[int] = frozenset()
    pose_widened: Mapping[str, float] = field(default_factory=dict)

    def leave_out_picks(self, reason: Mapping[int, LeftOut]) -> Participants:
        """Leave out some picks."""
        keep = self.keep.copy()
        keep[list(reason)] = False
        return replace(self, keep=keep, reason={**self.reason, **reason})

    def leave_out_frame(self, frame: int, why: LeftOut) -> Participants:
        """Leave out the picks of a frame."""
        picks = np.flatnonzero(self.keep & (self.survey.pick_frame == frame))
        return self.leave_out_picks(dict.fromkeys(picks.tolist(), why))

    def leave_out_frames(self, names: Sequence[str], why: LeftOut) -> Participants:
        """Leave out the picks of some frames, by name."""
        taking = self
        for name in names:
            taking = taking.leave_out_frame(self.survey.frame_id.index(name), why)
        return taking

    def leave_out_lines(self, lines: Sequence[int]) -> Participants:
        """Leave out some known lengths."""
        removed = self.line_removed.copy()
        removed[list(lines)] = True
        return replace(self, line_removed=removed)


class Patience(NamedTuple):
    """Largest numbers of iterations.

    Attributes
    ----------
    single
        Iterations from the only first values.
    several
        Iterations from each of several: a rival that is interrupted goes unreported.
    goal
        Sum of squares above which a result is of no use, and the iterations may end.
    limit
        Cost above which a robust adjustment that begins at the result is of no use.
    """

    single: int = MAX_ITERATIONS
    several: int = MAX_ITERATIONS
    goal: float = np.inf
    limit: float = np.inf


TRIAL_ITERATIONS = 20
"""Iterations of an adjustment that only has to show whether the left-out observation was the fault:
if it was, few are needed."""

FULL = Patience()
TRIAL = Patience(single=TRIAL_ITERATIONS)
QUICK_TRIAL = Patience(TRIAL_ITERATIONS, TRIAL_ITERATIONS)
"""All iterations, few where there is one start, and few from each start, where rivals do not
matter."""


def find_best_minima(taking: Participants, most: Patience = FULL) -> Refined:
    """Adjust all picks that can be placed; return the best minimum and its rivals.

    Parameters
    ----------
    taking
        Participating observations.
    most
        Largest numbers of iterations.

    Notes
    -----
    Picks without first values are left out, and so are frames and points that are undetermined:
    `pick_reason` of the result holds the reasons. The rest is adjusted. Without telemetry, frames
    in doubt begin again in another pose, without an influence on the poses of others.
    """
    tried: list[tuple[Survey, FirstValues]] = []

    def begin(survey: Survey) -> list[FirstValues]:
        found = find_first_values(survey)
        tried.extend((survey, one) for one in found)
        return found

    refined = find_minima_from(taking, begin, most)
    if taking.survey.telemetry is not None:
        return refined
    picks = int(taking.keep.sum())
    for _ in range(MAX_RETRIES):
        doubtful = find_doubtful_frames(taking.survey, refined)
        other = (
            _minima_from_other_poses(taking, refined, doubtful, most, tried) if doubtful else None
        )
        if other is None:
            break
        gain = cost_with_lost(refined, picks) - cost_with_lost(other, picks)
        refined = _add_rivals(*((other, refined) if gain > 0 else (refined, other)))
        if gain < MIN_RETRY_GAIN:
            break
    return refined


def adjust_on_trial(taking: Participants, most: Patience = TRIAL) -> Refined | None:
    """Adjust in few iterations, to see the effect of a change; None without a result."""
    try:
        return find_best_minima(taking, most)
    except GeometryError:
        return None


def _add_rivals(best: Refined, other: Refined) -> Refined:
    """Add minima of another adjustment that explain the same picks nearly as well."""
    minima = [best.adjustment, *best.alternatives]
    if np.array_equal(best.pick_index, other.pick_index):
        for one in (other.adjustment, *other.alternatives):
            if one.minimum.converged and _is_rival(one.minimum, minima):
                minima.append(one)
    return replace(best, alternatives=tuple(minima[1:]))


def _minima_from_other_poses(
    taking: Participants,
    refined: Refined,
    doubtful: frozenset[str],
    most: Patience,
    tried: list[tuple[Survey, FirstValues]],
) -> Refined | None:
    """Adjust from other poses of the frames in doubt; None where none of them is new.

    First values that were tried before lead to the same minima.

    Parameters
    ----------
    taking
        Participating observations.
    refined
        Their adjustment so far.
    doubtful
        Names of frames.
    most
        Largest numbers of iterations.
    tried
        Surveys and first values so far; those of this round are added.
    """
    state, names = refined.adjustment.state, refined.adjustment.survey.frame_id
    known = {name: (state.center[k], state.rotation[k]) for k, name in enumerate(names)}
    before = tuple(tried)

    def begin(survey: Survey) -> list[FirstValues]:
        every = find_other_first_values(survey, known, doubtful)
        found = [one for one in every if not any(_is_again(survey, one, *old) for old in before)]
        if not found:
            raise GeometryError("all first values were tried before")
        tried.extend((survey, one) for one in found)
        return found

    # Others are neither better than the present ones nor rivals of them.
    least = cost_with_lost(refined, int(taking.keep.sum())) + MAX_RIVAL_COST
    with suppress(GeometryError):
        return find_minima_from(taking, begin, most._replace(goal=min(most.goal, least)))
    return None


def _is_again(survey: Survey, values: FirstValues, of: Survey, earlier: FirstValues) -> bool:
    """Return whether first values, and their picks and lengths, are the same as earlier ones."""
    return (
        np.array_equal(survey.pixel_px, of.pixel_px)
        and np.array_equal(survey.length_m, of.length_m)
        and all(map(partial(np.array_equal, equal_nan=True), values, earlier))
    )


def find_minima_from(
    taking: Participants,
    begin: Callable[[Survey], list[FirstValues]],
    most: Patience = FULL,
) -> Refined:
    """Find the best minimum, and its rivals, from certain first values.

    Parameters
    ----------
    taking
        Participating observations.
    begin
        Function that returns first values of a survey; called again whenever picks had to be left
        out.
    most
        Largest numbers of iterations.

    Raises
    ------
    GeometryError
        There are no first values, or none leads to a minimum.
    """
    survey = remove_known(widen_poses(taking.survey, taking.pose_widened), taking.known_removed)
    undetermined = frozenset[int]()
    while True:
        if not taking.keep.any():
            raise GeometryError(
                "no pick can be used, so nothing can be computed: "
                + "; ".join(sorted({why.text for why in taking.reason.values()}))
            )
        selection = select_picks(survey, taking.keep)
        line_used = ~taking.line_removed[selection.line_index]
        # First values of the remaining observations.
        starts = begin(select_lines(selection.survey, line_used))
        lost = _find_unconnected(selection.survey, starts)
        if lost:
            survey = remove_ties(survey, lost)
            continue
        skipped = [find_unusable_picks(selection.survey, values) for values in starts]
        # Of several poses that explain the lengths, those that see sky at picked points
        # come after those that see ground.
        out = min(skipped, key=len)
        if not out:
            possible = [v for v, without in zip(starts, skipped, strict=True) if not without]
            try:
                adjustment, *alternatives = _find_minima(
                    selection.survey, possible, line_used, most
                )
                break
            except UndeterminedError as why:
                out = _picks_to_leave_out(why, skipped)
                if not out:
                    raise
                if not why.dependent_picks.all():
                    undetermined |= frozenset(selection.pick_index[why.dependent_picks].tolist())
        left = selection.pick_index[list(out)].tolist()
        taking = taking.leave_out_picks(dict(zip(left, out.values(), strict=True)))
    return Refined(
        adjustment=adjustment,
        pick_index=selection.pick_index,
        line_index=selection.line_index,
        removals=(),
        pick_removed=np.zeros(0, dtype=bool),
        line_removed=taking.line_removed,
        pick_reason=taking.reason,
        alternatives=tuple(alternatives),
        undetermined=undetermined,
        known_removed=taking.known_removed,
        pose_widened=taking.pose_widened,
    )


def _find_unconnected(survey: Survey, starts: Sequence[FirstValues]) -> frozenset[str]:
    """Find frames without picks whose ties do not place them."""
    nowhere = np.all([np.isnan(values.center[:, 0]) for values in starts], axis=0)
    nowhere[survey.pick_frame] = False
    return frozenset(survey.frame_id[f] for f in np.flatnonzero(nowhere))


def _picks_to_leave_out(
    why: UndeterminedError, skipped: list[dict[int, LeftOut]]
) -> dict[int, LeftOut]:
    """Return picks to leave out: those of the undetermined unknown.

    If all picks depend on it, the picks in the sky of another pose; empty without such a pose.
    """
    hanging = np.flatnonzero(why.dependent_picks)
    if 0 < len(hanging) < len(why.dependent_picks):
        return dict.fromkeys(hanging.tolist(), LeftOut(LeftOutCause.UNDETERMINED, str(why)))
    return min((out for out in skipped if out), key=len, default={})


def _find_minima(
    survey: Survey, starts: list[FirstValues], line_used: Bools, patience: Patience
) -> list[Adjustment]:
    """Find the best minimum, and every other one that explains the observations nearly as well."""
    most = patience.several if len(starts) > 1 else patience.single
    found, loose, goal = [], [], patience.goal
    undetermined: GeometryError | None = None
    for values in starts:
        try:
            found.append(_minimise(survey, values, line_used, most, goal))
        except GeometryError as error:  # one start may be where two solutions merge
            undetermined = undetermined or error
            loose.append(values)
            continue
        # A minimum above this limit is neither the best one nor a rival.
        goal = min(goal, found[-1][1].cost + MAX_RIVAL_COST)
    if undetermined is not None and not found:
        raise undetermined
    found.sort(key=lambda minimum: minimum[1].cost)
    minima = [_adjustment(*found[0])]
    # A minimum that explains the observations as well is a rival, even if not determined.
    rivals = [one for one in found[1:] if one[1].converged]
    for values in loose:
        with suppress(GeometryError):  # undetermined even with damping
            rivals.append(_minimise(survey, values, line_used, most, goal, DAMPING))
    for problem, minimum in rivals:
        if _is_rival(minimum, minima):
            minima.append(_adjustment(problem, minimum))
    return minima


def _minimise(
    survey: Survey,
    values: FirstValues,
    line_used: Bools,
    most: int,
    goal: float,
    slack: float = 0.0,
) -> tuple[SurveyProblem, Minimum[State]]:
    survey, tied = add_first_ties(survey, values)
    pivot = compute_area_centroids(survey, values.point_m)
    problem = SurveyProblem(survey, pivot, line_used)
    layout = problem.layout
    point = np.zeros((layout.points, layout.point_size))
    point[:, :2] = values.point_m
    if layout.point_size == 3:
        point[:, 2] = values.departure_m
    state = State(
        point=point,
        center=np.array(values.center),
        rotation=np.array(values.rotation),
        intrinsic=np.zeros(layout.intrinsics),
        plane=make_first_planes(survey.grounds, values.height_m),
        relief=np.zeros(layout.relief),
        telemetry=problem.telemetry_mean if layout.telemetry else np.zeros(0),
        tape=np.zeros(layout.tape),
        readout=np.zeros(0) if survey.rolling is None else survey.rolling.first_value,
        picked=point[survey.identified],
        tie=tied[:, : layout.point_size],
        turning=np.zeros((layout.frames, layout.frame_size - 6)),
    )
    try:
        state = approach_minimum(survey, state, pivot, line_used)
        minimum = iterate(problem, state, most, slack, goal=goal)
    except SingularError as error:
        raise UndeterminedError(
            f"the observations do not determine {layout.describe(error.index, survey)}: add known "
            "lengths or picks there, or leave it out"
            f"{describe_weakness(survey, values, line_used)}",
            find_dependent_picks(error.index, layout, survey),
        ) from error
    return problem, minimum


def _adjustment(problem: SurveyProblem, minimum: Minimum[State]) -> Adjustment:
    return Adjustment(problem, minimum, minimum.factor.covariance())


def _is_rival(minimum: Minimum[State], minima: list[Adjustment]) -> bool:
    """Return whether a minimum fits nearly as well as the first, and differs from all."""
    limit = minima[0].minimum.cost + MAX_RIVAL_COST
    return minimum.cost < limit and all(_apart(known, minimum.state) for known in minima)


def _apart(adjustment: Adjustment, other: State) -> bool:
    """Return whether another minimum has points or cameras elsewhere.

    Points by more than a thousandth of the scene, cameras by more than a sigma. Where only a log
    determines the place of the scene, one minimum may be reached some hundredths of a sigma from an
    earlier result: a movement common to all points is left to the comparison of the cameras.
    """
    here, there = adjustment.state.point[:, :2], other.point[:, :2]
    if adjustment.survey.telemetry is not None and len(here) > 1:
        turn, shift = align_in_plane(there, here)
        there = there @ turn[:2, :2].T + shift[:2]
    if np.abs(here - there).max() > 1e-3 * np.ptp(here, axis=0).max():
        return True
    variance = np.einsum("fii->fi", adjustment.frame_covariance())[:, :3]
    return bool(((adjustment.state.center - other.center) ** 2 > variance).any())
