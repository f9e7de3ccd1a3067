"""Judge hypotheses in the linear model, then by an adjustment of the corrected survey."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np

from uavgram.estimation.reliability.hypotheses import HypothesisTest, compare_hypotheses
from uavgram.estimation.reliability.redundancy import (
    compute_core_fit,
    compute_redundancy,
    compute_upper_tail,
)
from uavgram.estimation.survey.adjustment import Adjustment
from uavgram.estimation.survey.observations.telemetry import TELEMETRY_PARTS
from uavgram.model.arrays import Floats
from uavgram.model.survey import SurveyCorrection
from uavgram.stages.refine.causes.correction import readjust_corrected
from uavgram.stages.refine.causes.hypothesis import (
    GROSS_ERROR_LOG_ODDS,
    MISFIT_PROBABILITY,
    POSE_SIZE,
    SURE_LOG_ODDS,
    Diagnosis,
    Hypothesis,
    correct_participants,
    find_changed_lines,
)
from uavgram.stages.refine.noise import estimate_noise


@dataclass(frozen=True, eq=False)
class JudgedHypothesis:
    """Hypothesis with its evidence.

    Attributes
    ----------
    hypothesis, found
        The hypothesis, and the result of its linear test.
    gain
        Decrease of the weighted sum of squares.
    odds
        Logarithm of its odds against the present state.
    after
        The corrected survey, adjusted; None where that was not tried.
    noise
        Variance factor of its core, where that does not fit; otherwise one.
    log_noise
        Likewise, of the poses of the log, where the hypothesis is about them.
    squares, regained
        Parts of the gain at a variance factor of one: the decrease of the sum of squares, and the
        price of the left-out observations that take part again.
    """

    hypothesis: Hypothesis
    found: HypothesisTest | None
    gain: float
    odds: float
    after: Diagnosis | None = None
    noise: float = 1.0
    log_noise: float = 1.0
    squares: float = 0.0
    regained: float = 0.0

    def rescale_odds(self, noise: float) -> JudgedHypothesis:
        """Rescale the odds to a variance factor, the same for all that are not of the log."""
        if self.after is None:
            return self
        # A step explains some of any correlated error of a log; a misfit that it leaves counts.
        own = max(noise, self.log_noise) if self.squares > 0.0 else noise
        gain = self.squares / own + self.regained
        return replace(self, gain=gain, odds=gain / 2.0 - self.hypothesis.price)


def screen_hypotheses(
    diagnosis: Diagnosis, hypotheses: Iterable[Hypothesis]
) -> list[JudgedHypothesis]:
    """Judge hypotheses in the linear model, and return the most promising first.

    Parameters
    ----------
    diagnosis
        The survey under diagnosis.
    hypotheses
        All possible mistakes.
    """
    every = list(hypotheses)
    found: dict[int, HypothesisTest] = {}
    for checked in {one.checked for one in every}:
        linear = [one for one in every if one.moved and one.checked == checked]
        if diagnosis.adjustment.minimum.converged:
            tests = compare_hypotheses(diagnosis.adjustment, [one.moved for one in linear], checked)
            found |= dict(zip(map(id, linear), tests, strict=True))
    judged = [_judge(diagnosis, one, found.get(id(one))) for one in every]
    return sorted(judged, key=lambda one: -one.odds)


def _judge(
    diagnosis: Diagnosis, hypothesis: Hypothesis, found: HypothesisTest | None
) -> JudgedHypothesis:
    gain = hypothesis.promise if found is None else max(hypothesis.promise, found.gain)
    if found is not None and hypothesis.amount is not None:
        away = hypothesis.amount - float(found.value[0])
        gain -= away**2 / float(found.covariance[0, 0])
    back = _count_explained(diagnosis, hypothesis, gain)
    return JudgedHypothesis(
        hypothesis, found, gain, gain / 2.0 + GROSS_ERROR_LOG_ODDS * back - hypothesis.price
    )


def _count_explained(diagnosis: Diagnosis, hypothesis: Hypothesis, gain: float) -> int:
    """Count left-out numbers that a hypothesis accounts for.

    An error common to a flight may have spoilt any of them: if it explains participating
    observations as well, or if these are unchecked, or if the whole log was left out.
    """
    is_of_log = any(moved.kind in TELEMETRY_PARTS for moved in hypothesis.moved)
    if is_of_log and diagnosis.refined.is_log_left_out:
        return POSE_SIZE * len(diagnosis.refined.pose_widened)
    if hypothesis.freed is not None and hypothesis.moved:
        shows = gain / 2.0 > hypothesis.price
        return (
            diagnosis.left_out
            if shows or compute_core_fit(diagnosis.adjustment).degrees < 1.0
            else 0
        )
    mend = hypothesis.mend or SurveyCorrection()
    back = mend.picks | mend.without_picks | hypothesis.back
    picks = int(diagnosis.spoilt[list(back)].sum())
    lines = int((diagnosis.refined.line_removed & find_changed_lines(diagnosis.survey, mend)).sum())
    poses = len(diagnosis.list_poses_left_out(mend.picks | hypothesis.back))
    return 2 * picks + lines + POSE_SIZE * poses


def try_hypothesis(
    diagnosis: Diagnosis, judged: JudgedHypothesis, limit: float = np.inf
) -> JudgedHypothesis:
    """Judge a hypothesis by an adjustment of the corrected survey.

    Parameters
    ----------
    diagnosis
        The survey under diagnosis.
    judged
        The hypothesis, as judged in the linear model.
    limit
        Sum of squares of the corrected survey above which the hypothesis is of no use.
    """
    hypothesis = judged.hypothesis
    if hypothesis.mend is None and hypothesis.freed is None:
        return screen_hypotheses(diagnosis, [hypothesis])[0]
    mend = hypothesis.mend or SurveyCorrection()
    # A freed unknown may account for all left-out observations.
    lines_back = hypothesis.freed is not None or hypothesis.is_of_all
    back = hypothesis.back | frozenset(np.flatnonzero(diagnosis.spoilt & lines_back).tolist())
    taking = correct_participants(diagnosis, mend, back, lines_back=lines_back)
    if hypothesis.freed is not None:
        taking = replace(taking, survey=hypothesis.freed(taking.survey))
    # The price of the hypothesis contains that of the lengths that it leaves out.
    paid = 2.0 * GROSS_ERROR_LOG_ODDS * len(mend.without_lines)
    goal = min(_bound_cost(diagnosis, hypothesis, paid), limit)
    refined = hypothesis.adjusted or readjust_corrected(diagnosis, taking, hypothesis, goal)
    useless = JudgedHypothesis(hypothesis, judged.found, 0.0, -np.inf)
    if refined is None or refined.adjustment.minimum.cost > limit:
        return useless
    # A freed unknown may end along a valley: its gain is at least that of its present state.
    if not (refined.adjustment.minimum.converged or hypothesis.freed):
        return useless
    after = Diagnosis(taking, refined)
    # Noise of the survey before and after: what the mistake adds to either is not noise.
    noise = min(_noise_of_core(diagnosis.adjustment), _noise_of_core(refined.adjustment))
    squares = diagnosis.adjustment.minimum.cost - refined.adjustment.minimum.cost
    gain, found = diagnosis.cost - after.cost + paid, judged.found
    regained = gain - squares
    if found is not None and hypothesis.freed is not None:
        # Bound the gain, as `freed` may remove more prior knowledge than that of the unknowns.
        gain = min(gain, judged.gain + 2.0 * GROSS_ERROR_LOG_ODDS * diagnosis.left_out)
        squares = gain - regained
    if hypothesis.settled is not None:
        settled = hypothesis.settled(refined.adjustment)
        # An amount that may as well be zero explains nothing, whatever the readjustment gained.
        if settled is None or _compute_wald(*settled) < 2.0 * SURE_LOG_ODDS:
            return useless
        value, covariance = settled
        found = HypothesisTest(gain, len(value), value, covariance)
    of_log = _noise_of_log(refined.adjustment, hypothesis)
    one = JudgedHypothesis(hypothesis, found, gain, 0.0, after, noise, of_log, squares, regained)
    return one.rescale_odds(noise)


def _compute_wald(value: Floats, covariance: Floats) -> float:
    """Compute the squared size of (q,) estimated amounts in their sigmas (Wald's statistic)."""
    return float(value @ np.linalg.pinv(covariance, hermitian=True) @ value)


def _bound_cost(diagnosis: Diagnosis, hypothesis: Hypothesis, paid: float) -> float:
    """Bound the sum of squares of a trial: above it, the hypothesis cannot be likely.

    Parameters
    ----------
    diagnosis, hypothesis
        The survey under diagnosis, and the hypothesis.
    paid
        Part of its price that its readjustment contains.
    """
    before = diagnosis.adjustment.minimum.cost
    least = 2.0 * (hypothesis.price - SURE_LOG_ODDS) - (diagnosis.cost - before) - paid
    # An increase of the squares counts less where the noise is larger than stated.
    return before - (least if least > 0.0 else least * _noise_of_core(diagnosis.adjustment))


def _noise_of_core(adjustment: Adjustment) -> float:
    """Compute the variance factor of picks, ground and the like, where they do not fit; else one.

    Parameters
    ----------
    adjustment
        Adjustment at the stated sigmas.
    """
    fit = compute_core_fit(adjustment)
    if fit.probability >= MISFIT_PROBABILITY:
        return 1.0
    return max(1.0, fit.squares / max(fit.degrees, 1.0))


def _noise_of_log(adjustment: Adjustment, hypothesis: Hypothesis) -> float:
    """Compute the variance factor of the log's poses, where a hypothesis is about them; else one.

    Errors of a log are correlated, as in gusts, and a step explains some of any of them.
    """
    block = adjustment.minimum.blocks.get("telemetry")
    if block is None or all(moved.kind != "telemetry" for moved in hypothesis.moved):
        return 1.0
    squares, degrees = float(np.sum(block.residual**2)), compute_redundancy(adjustment, "telemetry")
    if compute_upper_tail(squares, degrees) > MISFIT_PROBABILITY:
        return 1.0
    return max(1.0, squares / degrees)


def explain_by_noise(diagnosis: Diagnosis) -> Diagnosis:
    """Return the survey with the noise of the picks, and the relief, that would explain the misfit.

    A hypothesis of little gain then is no mistake: uneven ground distorts everything around it, and
    some of many picks and lengths always reduce that misfit.
    """
    survey, refined = estimate_noise(diagnosis.survey, diagnosis.refined)
    if survey is diagnosis.survey:
        return diagnosis
    return Diagnosis(replace(diagnosis.taking, survey=survey), refined)
