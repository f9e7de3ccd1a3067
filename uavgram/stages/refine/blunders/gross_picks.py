"""Picks that are wrong beyond doubt, where points may depart from their plane.

A departure has a prior, but a pick that is wrong by hundreds of its sigmas outweighs any: the point
leaves the plane by many times what was stated, poses follow, and the tests accuse whatever is bent.
So where a departure, or a residual, is larger than anything explains, each pick that could be the
cause is left out in turn, and the one without which all else fits stays out.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from uavgram.errors import GeometryError
from uavgram.estimation.reliability.test_statistics import cofactors
from uavgram.estimation.survey.adjustment import Adjustment, Refined
from uavgram.geometry.camera.projection import project
from uavgram.model.arrays import Bools, Floats, Ints
from uavgram.model.survey.survey import Survey
from uavgram.stages.refine.blunders.misfit import suspects
from uavgram.stages.refine.blunders.trial_adjustment import trial_adjustment

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


class _Without(NamedTuple):
    """A pick (of the survey), and the result without it."""

    pick: int
    rest: Refined

    @property
    def cost(self) -> float:
        return self.rest.adjustment.minimum.cost


def without_gross_picks(
    survey: Survey, keep: Bools, line_removed: Bools, reason: dict[int, str], refined: Refined
) -> tuple[Refined, Bools, dict[int, str]]:
    """The result without picks that are wrong beyond doubt, the picks left, and why others are not.

    Parameters
    ----------
    survey, keep, line_removed, reason
        As for `adjust`.
    refined
        With all of them.
    """
    most = max(1, int(MOST_LEFT_OUT * keep.sum()))
    for _ in range(most if _rough(survey) else 0):
        if not _out_of_order(refined.adjustment):
            break
        tried = _tried(survey, keep, line_removed, reason, refined)
        wrong = _wrong(survey, line_removed, refined, tried)
        if not wrong:
            break
        keep = keep.copy()
        keep[list(wrong)] = False
        reason = reason | wrong
        refined = trial_adjustment(survey, keep, line_removed, reason)
    return refined, keep, reason


def _rough(survey: Survey) -> bool:
    return any(ground.roughness_sigma_m > 0 for ground in survey.grounds)


def _out_of_order(adjustment: Adjustment) -> bool:
    blocks = adjustment.minimum.blocks
    departure = np.abs(blocks["roughness"].residual).max(initial=0.0)
    if departure > DEPARTURE or len(suspects(adjustment)):
        return True
    return bool(_falls(adjustment).max(initial=0.0) > RESIDUAL**2)


def _falls(adjustment: Adjustment) -> Floats:
    """(P,) by which the sum of squares falls without each pick, in the linear model."""
    block = adjustment.minimum.blocks["pixels"]
    inverse = np.linalg.pinv(cofactors(block, adjustment.covariance), rcond=1e-6, hermitian=True)
    return np.asarray(np.einsum("pi,pij,pj->p", block.residual, inverse, block.residual))


def _tried(
    survey: Survey, keep: Bools, line_removed: Bools, reason: dict[int, str], refined: Refined
) -> list[_Without]:
    """Results without each promising pick, best first."""
    tried = []
    for pick in refined.pick_index[_promising(refined.adjustment)].tolist():
        without = keep.copy()
        without[pick] = False
        try:
            rest = trial_adjustment(survey, without, line_removed, reason | {pick: ""})
        except GeometryError:  # without it nothing is left to hold on to
            continue
        tried.append(_Without(pick, rest))
    return sorted(tried, key=lambda each: each.cost)


def _promising(adjustment: Adjustment) -> Ints:
    """Picks without which the sum of squares would fall most in the linear model.

    And those of the points that depart most: they have bent it.
    """
    fall = _falls(adjustment)
    departure = np.abs(adjustment.minimum.blocks["roughness"].residual[:, 0])
    label = adjustment.survey.pick_label
    most = departure[label] >= min(float(departure.max()), DEPARTURE * 2)
    rank: Floats = np.where(most, np.inf, fall)
    first = np.argsort(-fall, kind="stable")[: MOST_TRIED // 2]
    second = np.argsort(-rank, kind="stable")[: MOST_TRIED // 2]
    return np.unique(np.concatenate([first, second]))


def _wrong(
    survey: Survey, line_removed: Bools, refined: Refined, tried: list[_Without]
) -> dict[int, str]:
    """The pick that is wrong, with the reason; or all of its point's, where nothing tells which."""
    cost = refined.adjustment.minimum.cost
    if not tried or cost - tried[0].cost < GAIN:
        return {}
    best = tried[0]
    rivals = [each for each in tried[1:] if each.cost - best.cost < GAIN]
    rivals = [each for each in rivals if not _wrong_too(survey, line_removed, best, each)]
    label = survey.pick_label
    if not rivals:
        return {best.pick: _why(survey, best)}
    if any(label[each.pick] != label[best.pick] for each in rivals):
        return {}
    name = survey.label[label[best.pick]]
    picks = [best.pick, *(each.pick for each in rivals)]
    images = ", ".join(survey.frame_id[survey.pick_frame[pick]] for pick in picks)
    text = (
        f"one of the picks of {name!r} in {images} is far off, and nothing tells which: the point "
        "would leave the ground by many times ground.roughness_sigma_m. Look at all of them"
    )
    return dict.fromkeys(picks, text)


def _wrong_too(survey: Survey, line_removed: Bools, best: _Without, other: _Without) -> bool:
    """Whether a pick stays wrong where the best is left out: two blunders, not one of two."""
    without = np.zeros(len(survey.pick_frame), dtype=np.bool_)
    without[best.rest.pick_index] = True
    without[other.pick] = False
    try:
        both = trial_adjustment(survey, without, line_removed, best.rest.pick_reason)
    except GeometryError:
        return False
    return best.cost - both.adjustment.minimum.cost > GAIN


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
    problem, state = adjustment.problem, adjustment.state
    world, _, _ = problem.world_points(state, np.array([at]))
    camera = (world - state.center[frame]) @ state.rotation[frame]
    pixel = project(survey.calibration.model, problem.intrinsics(state), camera)
    off = float(np.linalg.norm(pixel[0] - survey.pixel_px[best.pick]))
    return off if np.isfinite(off) else 0.0
