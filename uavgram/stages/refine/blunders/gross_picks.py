"""Picks that are wrong beyond doubt, where points may depart from their plane.

A departure has a prior, but a pick that is wrong by hundreds of its sigmas outweighs any: the point
leaves the plane by many times what was stated, poses follow, and the tests accuse whatever is bent.
So where a departure, or a residual, is larger than anything explains, each pick that could be the
cause is left out in turn, and the one without which all else fits stays out.
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from uavgram.estimation.reliability.test_statistics import falls_without
from uavgram.estimation.survey.adjustment import Adjustment, LeftOut, LeftOutCause, Refined
from uavgram.model.arrays import Floats, Ints
from uavgram.model.survey.survey import Survey
from uavgram.stages.refine.blunders.misfit import TRIAL, suspects, trial_adjustment
from uavgram.stages.refine.minima import Participants, best_minima

DEPARTURE = 5.0
"""Sigmas, of what was stated, beyond which a point does not depart from its plane."""

RESIDUAL = 20.0
"""Test statistic of a pick beyond which something is out of order."""

GAIN = 100.0
"""Fall of the weighted sum of squares from which a pick is wrong beyond doubt (ten sigmas), and by
which it must fall further than without any other."""

MOST_TRIED = 6
"""Picks that are left out in turn: those that promise most."""

MOST_LEFT_OUT = 0.1
"""Share of the picks that may be left out: with more, the model is wrong and not picks."""

_WRONG = LeftOut(LeftOutCause.GROSS, "it is far off")


class _Without(NamedTuple):
    """A pick (of the survey), and the result without it."""

    pick: int
    rest: Refined

    @property
    def cost(self) -> float:
        return self.rest.adjustment.minimum.cost


def without_gross_picks(taking: Participants, refined: Refined) -> tuple[Refined, Participants]:
    """The result without picks that are wrong beyond doubt, and what then takes part.

    Parameters
    ----------
    taking
        What takes part.
    refined
        With all of it.
    """
    most = max(1, int(MOST_LEFT_OUT * taking.keep.sum()))
    for _ in range(most if len(refined.adjustment.problem.third.rough) else 0):
        if not _out_of_order(refined.adjustment):
            break
        wrong = _wrong(taking, refined, _tried(taking, refined))
        if not wrong:
            break
        taking = taking.without_picks(wrong)
        refined = best_minima(taking, TRIAL)
    return refined, taking


def _departure(adjustment: Adjustment) -> Floats:
    """(K,) how far points lie off rough ground, in its sigmas; 0 for all others."""
    departure = np.zeros(len(adjustment.survey.label))
    rough = adjustment.problem.third.rough
    if len(rough):
        departure[rough] = np.abs(adjustment.minimum.blocks["roughness"].residual[:, 0])
    return departure


def _out_of_order(adjustment: Adjustment) -> bool:
    if _departure(adjustment).max(initial=0.0) > DEPARTURE or len(suspects(adjustment)):
        return True
    return bool(_falls(adjustment).max(initial=0.0) > RESIDUAL**2)


def _falls(adjustment: Adjustment) -> Floats:
    """(P,) by which the sum of squares falls without each pick."""
    return falls_without(adjustment.minimum.blocks["pixels"], adjustment.covariance)


def _tried(taking: Participants, refined: Refined) -> list[_Without]:
    """Results without each promising pick, best first."""
    promising = refined.pick_index[_promising(refined.adjustment)].tolist()
    trials = ((k, trial_adjustment(taking.without_picks({k: _WRONG}))) for k in promising)
    tried = [_Without(pick, rest) for pick, rest in trials if rest is not None]
    return sorted(tried, key=lambda each: each.cost)


def _promising(adjustment: Adjustment) -> Ints:
    """Picks without which the sum of squares would fall most in the linear model.

    And those of the points that depart most: they have bent it.
    """
    fall = _falls(adjustment)
    label = adjustment.survey.pick_label
    departure = _departure(adjustment)
    most = departure[label] >= min(float(departure.max()), DEPARTURE * 2)
    rank: Floats = np.where(most, np.inf, fall)
    first = np.argsort(-fall, kind="stable")[: MOST_TRIED // 2]
    second = np.argsort(-rank, kind="stable")[: MOST_TRIED // 2]
    return np.unique(np.concatenate([first, second]))


def _wrong(taking: Participants, refined: Refined, tried: list[_Without]) -> dict[int, LeftOut]:
    """The pick that is wrong, with the reason; or all of its point's, where nothing tells which."""
    survey = taking.survey
    cost = refined.adjustment.minimum.cost
    if not tried or cost - tried[0].cost < GAIN:
        return {}
    best = tried[0]
    rivals = [each for each in tried[1:] if each.cost - best.cost < GAIN]
    rivals = [each for each in rivals if not _wrong_too(taking, best, each)]
    label = survey.pick_label
    if not rivals:
        return {best.pick: replace(_WRONG, text=_why(survey, best))}
    if any(label[each.pick] != label[best.pick] for each in rivals):
        return {}
    name = survey.label[label[best.pick]]
    picks = [best.pick, *(each.pick for each in rivals)]
    images = ", ".join(survey.frame_id[survey.pick_frame[pick]] for pick in picks)
    text = (
        f"one of the picks of {name!r} in {images} is far off, and nothing tells which: the point "
        "would leave the ground by many times ground.roughness_sigma_m. Look at all of them"
    )
    return dict.fromkeys(picks, replace(_WRONG, text=text))


def _wrong_too(taking: Participants, best: _Without, other: _Without) -> bool:
    """Whether a pick stays wrong where the best is left out: two blunders, not one of two."""
    without = np.zeros(len(taking.keep), dtype=np.bool_)
    without[best.rest.pick_index] = True
    without[other.pick] = False
    both = trial_adjustment(replace(taking, keep=without, reason=best.rest.pick_reason))
    return both is not None and best.cost - both.adjustment.minimum.cost > GAIN


def _why(survey: Survey, best: _Without) -> str:
    found = _off_px(survey, best)
    apart = f"it lies {found:.0f} px from where they show its point" if found else "look"
    return f"all other observations contradict it: {apart}; look at its place and its label"


def _off_px(survey: Survey, best: _Without) -> float:
    """Distance of a pick from where the result without it has its point; 0 where that is unseen."""
    adjustment = best.rest.adjustment
    at = adjustment.label_index(survey.label[survey.pick_label[best.pick]])
    frame_id = survey.frame_id[survey.pick_frame[best.pick]]
    if at < 0 or frame_id not in adjustment.survey.frame_id:
        return 0.0
    frame = adjustment.survey.frame_id.index(frame_id)
    pixel = adjustment.pixels(np.array([frame]), np.array([at]))[0]
    off = float(np.linalg.norm(pixel - survey.pixel_px[best.pick]))
    return off if np.isfinite(off) else 0.0
