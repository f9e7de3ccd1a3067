"""Apply corrections to a survey, record each change, and readjust the corrected survey."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from uavgram.estimation.first_poses.resection import MIN_PICKS, sight_adjusted_points
from uavgram.estimation.reliability.redundancy import compute_core_fit
from uavgram.estimation.solver.normal_equations import SingularError
from uavgram.estimation.survey.adjustment import Adjustment, Refined, Removal
from uavgram.estimation.survey.likelihood import SurveyProblem
from uavgram.estimation.survey.observations.lengths import describe_ends
from uavgram.estimation.survey.observations.observation import Member, Suspicion
from uavgram.estimation.survey.selection import Selection, remove_known, select_picks, widen_poses
from uavgram.estimation.survey.unknowns import State
from uavgram.geometry.camera.projection import back_project
from uavgram.geometry.ground.plane import intersect_ground
from uavgram.model.arrays import Bools, Ints
from uavgram.model.survey import Cause, Survey, SurveyCorrection
from uavgram.stages.refine.causes.hypothesis import (
    Diagnosis,
    Hypothesis,
    correct_participants,
    correct_survey,
)
from uavgram.stages.refine.minima import (
    QUICK_TRIAL,
    TRIAL_ITERATIONS,
    Participants,
    Patience,
    adjust_on_trial,
)
from uavgram.stages.refine.readjustment import convert_state
from uavgram.stages.refine.staged_sigmas import iterate

MAX_LISTED = 4
"""Changes of a correction that are listed; the cause's message names the rest."""


class CorrectedSurvey(NamedTuple):
    """Corrected survey.

    Attributes
    ----------
    survey
        The survey with the corrections.
    without
        (P,) picks that were removed.
    removals
        A record of each correction.
    """

    survey: Survey
    without: Bools
    removals: tuple[Removal, ...]


def apply_corrections(survey: Survey, causes: Sequence[Cause], before: Refined) -> CorrectedSurvey:
    """Apply all possible corrections of certain causes.

    Parameters
    ----------
    survey
        The survey before the corrections.
    causes
        Causes of its misfits, in the order in which they were found.
    before
        Its adjustment.
    """
    without = np.zeros(len(survey.pick_frame), dtype=np.bool_)
    removals = []
    for cause in causes:
        if cause.mend is None:
            continue
        is_now = correct_survey(survey, cause.mend)
        without[list(cause.mend.without_picks)] = True
        size = float(np.sqrt(max(cause.gain, 0.0)))
        removals.append(
            Removal(
                kind="mend",
                index=-1,
                suspicion=Suspicion(Member("mend", -1, 0), size, (), ()),
                before=before,
                cause=cause,
                mended=(_describe_values(survey, cause.mend), _describe_values(is_now, cause.mend)),
            )
        )
        survey = is_now
    return CorrectedSurvey(survey, without, tuple(removals))


def _describe_values(survey: Survey, mend: SurveyCorrection) -> str:
    """Describe a survey's values of all items that a correction changes."""
    label, frame = survey.label, survey.frame_id
    parts = [
        f"{label[survey.pick_label[pick]]!r} in {frame[survey.pick_frame[pick]]!r} at "
        f"({survey.pixel_px[pick, 0]:.1f}, {survey.pixel_px[pick, 1]:.1f}) px"
        for pick in sorted(mend.picks | mend.without_picks)
    ]
    for line in sorted(mend.lines | mend.without_lines):
        name = survey.line_name[line] if survey.line_name else ""
        ends = describe_ends(name, label[survey.line_start[line]], label[survey.line_end[line]])
        parts.append(f"length {ends} {survey.length_m[line]:.3f} m")
    for of in sorted(mend.free):
        height = "at a height to be found" if survey.is_free[of] else "on the ground"
        parts.append(f"{label[of]!r} {height}")
    parts += [
        f"control point {label[survey.control_label[row]]!r}"
        for row in sorted(mend.label_of_control)
    ]
    more = len(parts) - MAX_LISTED
    return "; ".join(parts[:MAX_LISTED]) + (f"; and {more} more" if more > 0 else "")


MIN_FIT_PROBABILITY = 1e-5
"""Probability of the core's squares below which a state is unsuitable as first values."""


def adjust_with_all(
    diagnosis: Diagnosis, mend: SurveyCorrection, most: Patience = QUICK_TRIAL
) -> Diagnosis | None:
    """Adjust a corrected survey with all that was left out; None without a result.

    Parameters
    ----------
    diagnosis
        The survey under diagnosis.
    mend
        Correction, by index into its survey.
    most
        Largest numbers of iterations.
    """
    back = frozenset(np.flatnonzero(diagnosis.spoilt).tolist())
    taking = correct_participants(diagnosis, mend, back, lines_back=True)
    refined = adjust_on_trial(taking, most)
    return None if refined is None else Diagnosis(taking, refined)


def readjust_corrected(
    diagnosis: Diagnosis, taking: Participants, hypothesis: Hypothesis, goal: float
) -> Refined | None:
    """Adjust the participating observations from the present state; None without a result.

    It begins from first values instead where the present state is of no use: it did not converge or
    is distorted by misfits, the hypothesis changes everything, poses of the log take part again, or
    ties have other points. Misfits and poses are no reason for a hypothesis that begins at a state
    of its own, or that gives up a prior where the whole log was left out. So it does where the
    present state leads to no minimum.

    Parameters
    ----------
    diagnosis
        The survey under diagnosis.
    taking
        Participating observations of the changed survey.
    hypothesis
        The hypothesis by which it was changed.
    goal
        Sum of squares above which a result is of no use.
    """
    most = Patience(goal=goal)
    present = diagnosis.adjustment
    survey = remove_known(widen_poses(taking.survey, taking.pose_widened), taking.known_removed)
    selection = select_picks(survey, taking.keep)
    if hypothesis.is_of_all:
        return adjust_on_trial(taking, most)
    is_bent = compute_core_fit(present).probability < MIN_FIT_PROBABILITY
    # A photo whose pose by the log takes part again may be far from it.
    is_far = taking.pose_widened.keys() != diagnosis.refined.pose_widened.keys()
    # Without a log that is wrong as a whole, the present state is better than first values by it.
    is_without_log = diagnosis.refined.is_log_left_out and hypothesis.freed is not None
    is_suitable = hypothesis.begun is not None or is_without_log
    if (
        (not is_suitable and (is_bent or is_far))
        or not present.minimum.converged
        or selection.survey.matches.points + selection.survey.ties.points
    ):
        return adjust_on_trial(taking, most)
    start = _initial_state(diagnosis, selection)
    if start is None:
        return adjust_on_trial(taking, most)
    if hypothesis.begun is not None:
        start = hypothesis.begun(start)
    used = ~taking.line_removed[selection.line_index]
    problem = SurveyProblem(selection.survey, present.problem.pivot_m, used)
    try:
        # Express the interior orientation in the basis of the changed survey.
        lens = np.linalg.pinv(problem.intrinsic_basis) @ present.problem.intrinsic_basis
        start = replace(start, intrinsic=lens @ start.intrinsic)
        present = replace(present, minimum=replace(present.minimum, state=start))
        minimum = iterate(problem, convert_state(present, problem), TRIAL_ITERATIONS, goal=goal)
        adjustment = Adjustment(problem, minimum, minimum.factor.covariance())
    except (SingularError, ValueError):
        return adjust_on_trial(taking, most)
    refined = Refined(
        adjustment=adjustment,
        pick_index=selection.pick_index,
        line_index=selection.line_index,
        removals=(),
        pick_removed=np.zeros(0, dtype=np.bool_),
        line_removed=taking.line_removed,
        pick_reason=taking.reason,
        alternatives=(),
        undetermined=frozenset(),
        known_removed=taking.known_removed,
        pose_widened=taking.pose_widened,
    )
    is_hopeless = minimum.cost > goal  # a state that is far from it leads no nearer
    return refined if minimum.converged or is_hopeless else adjust_on_trial(taking, most) or refined


def _initial_state(diagnosis: Diagnosis, selection: Selection) -> State | None:
    """Return the present state for the frames and labels of a selection; None if not placed."""
    present, survey = diagnosis.adjustment, selection.survey
    state, ground = present.state, present.survey
    row = {name: k for k, name in enumerate(ground.frame_id)}
    frame = np.array([row.get(name, -1) for name in survey.frame_id], dtype=np.int64)
    label = _former_labels(diagnosis, selection)
    point = state.point[label].copy()
    center, rotation = state.center[frame].copy(), state.rotation[frame].copy()
    known = label >= 0
    # Frames that took no part: resection from the points on the ground.
    for new in np.flatnonzero(frame < 0).tolist():
        picks = np.flatnonzero(survey.pick_frame == new)
        sights = sight_adjusted_points(present, survey, label, picks, survey.pixel_px[picks])
        if len(sights.world_m) < MIN_PICKS:
            return None
        center[new], rotation[new] = sights.resect()
        if not np.isfinite(center[new]).all():
            return None
    # Labels that took no part: intersection of a ray with the ground.
    for new in np.flatnonzero(~known).tolist():
        pick = int(np.flatnonzero(survey.pick_label == new)[0])
        at = survey.pick_frame[pick]
        ray = back_project(
            survey.calibration.model, survey.calibration.parameters, survey.pixel_px[[pick]]
        )
        area = survey.area[new]
        there = intersect_ground(
            center[at],
            (rotation[at] @ ray[0]),
            state.plane[3 * area : 3 * area + 3],
            present.problem.pivot_m[area],
            survey.height_above_m[new],
        )
        if not np.isfinite(there).all():
            return None
        point[new, :2], point[new, 2:] = there[:2], 0.0
    turning = np.zeros((len(frame), state.turning.shape[1]))
    turning[frame >= 0] = state.turning[frame[frame >= 0]]
    return replace(state, point=point, center=center, rotation=rotation, turning=turning)


def _former_labels(diagnosis: Diagnosis, selection: Selection) -> Ints:
    """Find the labels (K,) of the adjustment for the points of a selection; -1 where there is none.

    Where all picks of a label had another one before, the point is that of the other label.
    """
    survey = selection.survey
    before = diagnosis.survey.pick_label[selection.pick_index]
    own = diagnosis.adjustment.label_rows(survey.label)
    whole = diagnosis.adjustment.label_rows(diagnosis.survey.label)
    for label in range(len(survey.label)):
        picks = np.flatnonzero(survey.pick_label == label)
        former = np.array([diagnosis.survey.label[k] for k in before[picks]])
        if not (former == survey.label[label]).any():
            own[label] = whole[before[picks[0]]]
    return own
