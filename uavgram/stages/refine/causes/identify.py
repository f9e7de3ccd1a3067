"""The likeliest causes of misfits, one after another, until the rest fits.

Detection, identification, adaptation (Teunissen 1990, "Quality control in integrated navigation
systems"): where a survey does not fit, hypotheses of all kinds are tested in the linear model, the
most promising ones by an adjustment of the mended survey, all at the stated noise; the likeliest
one is told, and the next is looked for in the survey without it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from uavgram.estimation.reliability.hypotheses import Explained, explained, log_probability
from uavgram.estimation.reliability.test_statistics import falls_without
from uavgram.estimation.survey.adjustment import Adjustment
from uavgram.model.survey.mend import Cause
from uavgram.stages.refine.blunders.misfit import trial_adjustment
from uavgram.stages.refine.blunders.outstanding import core_fit
from uavgram.stages.refine.causes.hypothesis import PRICE, Hypothesis, Standing, mended
from uavgram.stages.refine.causes.labels import swapped_in_a_photo, wrong_picks
from uavgram.stages.refine.causes.lengths import wrong_lengths

MISFIT = 0.01
"""Probability of the core's sum of squares below which a cause is looked for."""

BY_CHANCE = float(np.log(0.001))
"""Logarithm of the level of the whole survey: so often a cause is told where nothing is wrong."""

MOST_CAUSES, MOST_TRIED = 6, 8
"""Causes that are told, and hypotheses for which a mended survey is adjusted each time."""

SURE = float(np.log(20.0))
"""Logarithm of the odds against the next likeliest cause, from which on it is not told beside."""

PROPOSALS: tuple[Callable[[Standing], Iterable[Hypothesis]], ...] = (
    wrong_picks,
    wrong_lengths,
    swapped_in_a_photo,
)
"""What could be wrong, by kind: each looks at a survey that does not fit."""


@dataclass(frozen=True, eq=False)
class _Judged:
    """A hypothesis with what speaks for it.

    Attributes
    ----------
    hypothesis, found
        It, and what its linear test found.
    gain
        Fall of the weighted sum of squares.
    odds
        Logarithm of its odds against what stands.
    after
        The mended survey, adjusted; None where none was tried.
    """

    hypothesis: Hypothesis
    found: Explained | None
    gain: float
    odds: float
    after: Standing | None = None


def identify(standing: Standing) -> tuple[Cause, ...]:
    """Causes of the misfits of a survey, likeliest first; none where it fits.

    Parameters
    ----------
    standing
        The survey as it is adjusted at the stated noise.
    """
    causes: list[Cause] = []
    for _ in range(MOST_CAUSES):
        if not asks(standing):
            break
        best = _likeliest(standing)
        if best is None:
            break
        hypothesis = best.hypothesis
        if hypothesis.tell is not None:
            count = int(np.ceil(np.exp(min(hypothesis.price, 30.0))))
            causes.append(
                Cause(
                    message=hypothesis.tell(best.found),
                    mend=hypothesis.mend,
                    gain=best.gain,
                    log_probability=log_probability(best.gain, hypothesis.unknowns, count),
                    settles=hypothesis.settles,
                )
            )
        if best.after is None:
            break
        standing = best.after
    return tuple(causes)


def asks(standing: Standing) -> bool:
    """Whether something does not fit, or was left out for it."""
    adjustment = standing.adjustment
    if standing.left_out or not adjustment.minimum.converged:
        return True
    return core_fit(adjustment).probability < MISFIT or _worst(adjustment) < BY_CHANCE


def _worst(adjustment: Adjustment) -> float:
    """Logarithm of the probability of the worst observation, at the level of the survey."""
    worst = 0.0
    for name in ("pixels", "lengths", "known"):
        if name in adjustment.minimum.blocks:
            block = adjustment.minimum.blocks[name]
            fall = falls_without(block, adjustment.covariance)
            axes = block.residual.shape[1]
            worst = min(worst, log_probability(float(fall.max(initial=0.0)), axes, len(fall)))
    return worst


def _likeliest(standing: Standing) -> _Judged | None:
    """The likeliest hypothesis, if chance does not explain it as well."""
    judged = _screened(standing)
    tried = [_tried(standing, one) for one in judged[:MOST_TRIED]]
    tried = [one for one in tried if one.odds > SURE]
    if not tried:
        return None
    return max(tried, key=lambda one: one.odds)


def _screened(standing: Standing) -> list[_Judged]:
    """All hypotheses with what the linear model says of them, most promising first."""
    hypotheses = [one for propose in PROPOSALS for one in propose(standing)]
    linear = [one for one in hypotheses if one.moved]
    tests: Sequence[Explained] = ()
    if standing.adjustment.minimum.converged:
        tests = explained(standing.adjustment, [one.moved for one in linear])
    found = dict(zip(map(id, linear), tests, strict=False))
    judged = [_judged(standing, one, found.get(id(one))) for one in hypotheses]
    return sorted(judged, key=lambda one: -one.odds)


def _judged(standing: Standing, hypothesis: Hypothesis, found: Explained | None) -> _Judged:
    gain = hypothesis.promise
    if found is not None:
        gain = found.gain if hypothesis.value is None else found.gain_of(hypothesis.value)
    back = _brought_back(standing, hypothesis)
    return _Judged(hypothesis, found, gain, gain / 2.0 + PRICE * back - hypothesis.price)


def _brought_back(standing: Standing, hypothesis: Hypothesis) -> int:
    """Numbers that had been left out, and take part once it is mended."""
    mend = hypothesis.mend
    if mend is None:
        return 0
    picks = int(standing.spoilt[list(mend.picks)].sum())
    lines = int(standing.refined.line_removed[list(mend.lines)].sum())
    return 2 * picks + lines


def _tried(standing: Standing, judged: _Judged) -> _Judged:
    """What an adjustment of the mended survey says of a hypothesis."""
    hypothesis = judged.hypothesis
    if hypothesis.mend is None:
        return judged
    taking = mended(standing, hypothesis.mend)
    refined = trial_adjustment(taking)
    if refined is None or not refined.adjustment.minimum.converged:
        return _Judged(hypothesis, judged.found, 0.0, -np.inf)
    after = Standing(taking, refined)
    # What is left may still be noisier than stated: noise grows last, but must not be blamed.
    fit = core_fit(refined.adjustment)
    gain = (standing.cost - after.cost) / max(1.0, fit.squares / max(fit.degrees, 1.0))
    return _Judged(hypothesis, judged.found, gain, gain / 2.0 - hypothesis.price, after)
