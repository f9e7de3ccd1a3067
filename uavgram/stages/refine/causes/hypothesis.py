"""Hypotheses on mistakes in a survey, and the comparison of their costs.

Each hypothesis is either a change of the input by people (a `SurveyCorrection`, tested by a
readjustment) or an error common to all observations of a kind (`Moved`, tested in the linear
model).
"""

from __future__ import annotations

from collections.abc import Callable, Collection
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from uavgram.estimation.reliability.hypotheses import (
    MIN_RESIDUAL_SHARE,
    HypothesisTest,
    ObservationChange,
)
from uavgram.estimation.survey.adjustment import Adjustment, LeftOutCause, Refined
from uavgram.estimation.survey.unknowns import State
from uavgram.model.arrays import Bools, Floats
from uavgram.model.message import Message
from uavgram.model.observations import Along
from uavgram.model.survey import Survey, SurveyCorrection
from uavgram.stages.refine.first_values import LOST_PICK_COST
from uavgram.stages.refine.minima import Participants

GROSS_ERROR_LOG_ODDS = 6.0
"""Logarithm of the odds against a gross error of an observed number at its specific value: the
range of gross errors over the sigma of the number."""

SURE_LOG_ODDS = float(np.log(20.0))
"""Logarithm of the odds above which a hypothesis is reported, or a less likely one no longer
tried."""

POSE_SIZE = 3
"""Number of observed numbers that a wrong pose of the log counts as: its position, or direction."""

HEIGHT_SIGMA_M = 2.0
"""Sigma of the height above the ground of an ordinary thing, such as a car [m]."""

MISFIT_PROBABILITY = 0.01
"""Probability of the core's sum of squares below which a cause is looked for."""

CONTRADICTING = (LeftOutCause.MISPLACED_FRAME, LeftOutCause.GROSS)
"""Causes of left-out picks that a person should check."""


class Diagnosis(NamedTuple):
    """Adjusted survey whose misfits are to be explained.

    Attributes
    ----------
    taking
        Observations that take part, and those that were left out.
    refined
        Its adjustment.
    others
        Count of numbers of control, heights and the like that were left out, and take part again
        with a hypothesis that changes the whole survey.
    """

    taking: Participants
    refined: Refined
    others: int = 0

    @property
    def survey(self) -> Survey:
        """All observations, with the corrections so far."""
        return self.taking.survey

    @property
    def adjustment(self) -> Adjustment:
        """Present adjustment."""
        return self.refined.adjustment

    @property
    def spoilt(self) -> Bools:
        """Picks (P,) that were left out because they contradict the rest."""
        out = np.zeros(len(self.survey.pick_frame), dtype=np.bool_)
        for index, why in self.refined.pick_reason.items():
            out[index] = why.cause in CONTRADICTING
        return out

    @property
    def cost(self) -> float:
        """Weighted sum of squares, with a price for each left-out or lost observation."""
        used = np.zeros(len(self.taking.keep), dtype=np.bool_)
        used[self.refined.pick_index] = True
        lost = int((self.taking.keep & ~used & ~self.spoilt).sum())
        return (
            self.adjustment.minimum.cost
            + 2.0 * GROSS_ERROR_LOG_ODDS * self.left_out
            + LOST_PICK_COST * lost
        )

    @property
    def left_out(self) -> int:
        """Count of numbers that were left out because they contradict the rest."""
        poses = POSE_SIZE * len(self.refined.pose_widened)
        return int(2 * self.spoilt.sum() + self.refined.line_removed.sum()) + poses + self.others

    def count_readings(self) -> int:
        """Count what was left out because it contradicts the rest.

        A misplaced photo and its pose count once.
        """
        refined, frame = self.refined, self.survey.pick_frame
        gross = [k for k, why in refined.pick_reason.items() if why.cause is LeftOutCause.GROSS]
        misplaced = {
            self.survey.frame_id[frame[k]]
            for k, why in refined.pick_reason.items()
            if why.cause is LeftOutCause.MISPLACED_FRAME
        }
        photos = misplaced | refined.pose_widened.keys()
        return len(gross) + int(refined.line_removed.sum()) + len(photos)

    def list_poses_left_out(self, picks: Collection[int]) -> frozenset[str]:
        """List photos of some picks whose poses by the log were left out."""
        survey = self.survey
        names = {survey.frame_id[k] for k in survey.pick_frame[list(picks)]}
        return frozenset(names & self.refined.pose_widened.keys())


@dataclass(frozen=True, eq=False)
class Hypothesis:
    """Possible mistake in a survey.

    Attributes
    ----------
    message
        Function that makes the message from the result of the linear test (None where there is
        none). None for a hypothesis that is not a cause to be reported, but a competitor: a single
        wrong pick or length, which the tests of the residuals report.
    mend
        Correction of the input; None where there is none.
    remedy
        Correction on request, where it differs from `mend`; None: `mend`.
    equal
        Other corrections that lead to as good a fit, where nothing shows which mistake was made.
    is_clear
        Whether no other mistake would explain the same; otherwise it is reported, but not corrected
        on request.
    back
        Picks that stay unchanged and take part again where they had been left out.
    is_of_all
        Whether the whole survey changes with it: it is adjusted from first values.
    begun
        Function from the present state to the initial state of its adjustment; None: the present
        state, or first values where that is unsuitable.
    freed
        Function that returns the survey with less prior knowledge, for all later adjustments; it
        changes no reading. Without `mend` and `freed`, only the linear test judges the hypothesis.
    moved
        Derivatives of the observations with respect to its unknowns in the linear model; empty
        where unknown.
    amount
        Value of its only unknown, where that is known; None: any.
    checked
        Least share of its directions that has to show in the residuals (see `explained`).
    settled
        Function that returns its unknowns (q,) and their covariance (q, q) in the adjustment of the
        freed survey, for `message`; it returns None where they are impossible. None: those of the
        linear test are reported.
    adjusted
        The corrected survey, adjusted at the present noise with all that was left out; None where
        that is not yet known.
    price
        Logarithm of the number of possible hypotheses of its kind, and of the prior range of its
        unknowns over their posterior range (see `GROSS_ERROR_LOG_ODDS`).
    promise
        Expected decrease of the sum of squares, where `moved` does not give it, or gives less
        because it is linear.
    settles
        Lengths and frames, by name, whose misfit it explains.
    """

    message: Callable[[HypothesisTest | None], Message] | None
    mend: SurveyCorrection | None = None
    remedy: SurveyCorrection | None = None
    equal: tuple[SurveyCorrection, ...] = ()
    is_clear: bool = True
    back: frozenset[int] = frozenset()
    is_of_all: bool = False
    begun: Callable[[State], State] | None = None
    freed: Callable[[Survey], Survey] | None = None
    moved: tuple[ObservationChange, ...] = ()
    amount: float | None = None
    checked: float = MIN_RESIDUAL_SHARE
    settled: Callable[[Adjustment], tuple[Floats, Floats] | None] | None = None
    adjusted: Refined | None = None
    price: float = 0.0
    promise: float = 0.0
    settles: frozenset[str] = frozenset()


def correct_participants(
    diagnosis: Diagnosis,
    mend: SurveyCorrection,
    back: frozenset[int] = frozenset(),
    *,
    lines_back: bool = False,
) -> Participants:
    """Return the participating observations of the corrected survey.

    Picks and lengths that the correction changes take part again where they had been left out, and
    so do lengths that end where all picks get another label, and poses of the photos by the log.

    Parameters
    ----------
    diagnosis
        The survey under diagnosis.
    mend
        Correction, by index into its survey.
    back
        Picks that take part again unchanged.
    lines_back
        Whether lengths and poses of the log that were left out take part again.
    """
    taking, refined = diagnosis.taking, diagnosis.refined
    survey = correct_survey(diagnosis.survey, mend)
    used = np.zeros(len(survey.pick_frame), dtype=np.bool_)
    used[refined.pick_index] = True
    used[list(mend.picks | back)] = True
    used[list(mend.without_picks)] = False
    removed = refined.line_removed & (not lines_back)
    removed[find_changed_lines(diagnosis.survey, mend)] = False
    removed[list(mend.without_lines)] = True
    reason = {
        i: why
        for i, why in refined.pick_reason.items()
        if not used[i] and i not in mend.without_picks
    }
    poses_back = diagnosis.list_poses_left_out(mend.picks | back)
    widened = {
        name: factor
        for name, factor in refined.pose_widened.items()
        if not lines_back and name not in poses_back
    }
    usable = used & find_usable_picks(taking)
    return Participants(survey, usable, removed, reason, taking.known_removed, widened)


def find_changed_lines(survey: Survey, mend: SurveyCorrection) -> Bools:
    """Mark lengths (L,) that a correction changes, or that end at a fully relabelled point."""
    relabelled = np.zeros(len(survey.pick_label), dtype=np.bool_)
    relabelled[list(mend.label_of_pick)] = True
    changed = np.setdiff1d(survey.pick_label[relabelled], survey.pick_label[~relabelled])
    touched: Bools = np.isin(survey.line_start, changed) | np.isin(survey.line_end, changed)
    touched[list(mend.lines)] = True
    return touched


def find_usable_picks(taking: Participants) -> Bools:
    """Mark the picks (P,) within the lens, which may take part."""
    may = np.ones(len(taking.keep), dtype=np.bool_)
    beyond = [i for i, why in taking.reason.items() if why.cause is LeftOutCause.BEYOND_LENS]
    may[beyond] = False
    return may


def correct_survey(survey: Survey, mend: SurveyCorrection) -> Survey:
    """Apply a correction to the observations, without removing any.

    Parameters
    ----------
    survey
        All observations.
    mend
        Correction, by index into them.
    """
    label, pixel = survey.pick_label.copy(), survey.pixel_px.copy()
    sigma_px = survey.pick_sigma_px.copy()
    start, end = survey.line_start.copy(), survey.line_end.copy()
    length, free = survey.length_m.copy(), survey.is_free.copy()
    control = survey.control_label.copy()
    for pick, right in mend.label_of_pick.items():
        label[pick] = right
    for pick, place in mend.pixel_of_pick.items():
        pixel[pick] = place
    for pick, factor in mend.enlarged.items():
        sigma_px[pick] *= factor
    for line, value in mend.length_m.items():
        length[line] = value
    for line, ends in mend.ends.items():
        start[line], end[line] = ends
    for of, height in mend.free.items():
        free[of] = height
    for row, right in mend.label_of_control.items():
        control[row] = right
    along: tuple[Along, ...] = survey.line_along
    if mend.level:
        written: list[Along] = [*along] or ["slope"] * len(start)
        for line in mend.level:
            written[line] = "horizontal"
        along = tuple(written)
    changed = replace(
        survey,
        pick_label=label,
        pixel_px=pixel,
        pick_sigma_px=sigma_px,
        line_start=start,
        line_end=end,
        length_m=length,
        is_free=free,
        line_along=along,
        control_label=control,
    )
    return _set_apart(changed, mend.apart) if mend.apart else changed


def name_moved(label: str) -> str:
    """Return the name of the other place of a point that was moved: no label has a semicolon."""
    return f"{label}; moved"


def _set_apart(survey: Survey, apart: frozenset[int]) -> Survey:
    """Give points that some picks show elsewhere a second label, for those picks."""
    picks = np.array(sorted(apart))
    moved, row = np.unique(survey.pick_label[picks], return_inverse=True)
    label = survey.pick_label.copy()
    label[picks] = len(survey.label) + row
    each = np.append(np.arange(len(survey.label)), moved)
    # At its second place a point of free height has the height of an ordinary thing: one photo may
    # show it alone.
    is_free, sigma_m = survey.is_free[each], survey.height_sigma_m[each]
    second = np.arange(len(each)) >= len(survey.label)
    sigma_m[second & is_free] = HEIGHT_SIGMA_M
    return replace(
        survey,
        pick_label=label,
        label=(*survey.label, *(name_moved(survey.label[k]) for k in moved)),
        height_above_m=survey.height_above_m[each],
        height_sigma_m=sigma_m,
        is_free=is_free & ~second,
        identification_sigma_m=survey.identification_sigma_m[each],
        area=survey.area[each],
    )
