"""Find wrong matches and ties, and the noise of the others, before the adjustment uses them.

Since the program found them, no person is asked: those that do not fit are left out. They are
tested against each other and the flight log, with observations by people at nearly no weight: a
label in the wrong place must not remove the matches that would reveal it.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace

import numpy as np

from uavgram.errors import GeometryError
from uavgram.estimation.reliability.redundancy import compute_reductions
from uavgram.estimation.reliability.variance_components import VarianceComponent, estimate_single
from uavgram.estimation.solver.normal_equations import SingularError
from uavgram.estimation.survey.adjustment import Adjustment
from uavgram.estimation.survey.likelihood import SurveyProblem
from uavgram.estimation.survey.unknowns import State
from uavgram.model.arrays import Bools
from uavgram.model.message import Message, MessagePlural
from uavgram.model.result.reliability import Noise, PickNoise
from uavgram.model.survey import NO_SIGHTINGS, Sightings, Survey
from uavgram.stages.refine.first_values import find_picks_in_lens
from uavgram.stages.refine.ground_from_ties import constrain_by_near_ties
from uavgram.stages.refine.minima import Participants, find_best_minima
from uavgram.stages.refine.off_ground import (
    GroundEvidence,
    apply_ground_evidence,
    find_off_ground_labels,
)
from uavgram.stages.refine.readjustment import find_used_lines
from uavgram.stages.refine.rolling_shutter import is_shutter_needed, is_shutter_unknown
from uavgram.stages.refine.staged_sigmas import iterate

SIGMA_FACTOR = 10.0
"""Factor of the sigmas of picks and lengths while matches and ties are tested."""

WRONG_DECREASE = 20.0
"""Decrease of the sum of squares above which a sighting is wrong: chi-square with two degrees of
freedom exceeds it with a probability of 1 in 20,000."""

MAX_NOISE_FACTOR = 3.0
"""Largest factor by which the sigmas of sightings may be too small: a wrong one among very few must
not count as scatter of all."""

MEDIAN_CHI_SQUARE = 2.0 * float(np.log(2.0))
"""Median of the chi-square distribution with two degrees of freedom."""

MAX_ROUNDS = 12
"""Largest number of rounds; each leaves out the worst sighting of every point that has a wrong
one."""

MASKED_SHARE = 0.2
"""Share of the largest decrease below which a sighting may only seem wrong, distorted by worse
ones."""

STATED_WEIGHT = 20.0
"""Weight of the stated sigmas, as a number of residuals."""

MIN_NOISE_FACTOR = 0.5
"""Lower limit of the factor of the stated sigmas."""


@dataclass(frozen=True, eq=False)
class CheckedTies:
    """Survey whose matches and ties fit each other.

    Attributes
    ----------
    survey
        Survey without wrong ones, and with the ground as the others show it; with sigmas learnt
        from them, if requested.
    shown
        Properties of the ground that matches and ties show.
    noise
        Noise of matches and of ties, where there are any.
    matches_left_out, ties_left_out
        Rows of the picks, and of the ties, that are wrong.
    """

    survey: Survey
    shown: GroundEvidence = field(default_factory=GroundEvidence)
    noise: tuple[PickNoise, ...] = ()
    matches_left_out: frozenset[int] = frozenset()
    ties_left_out: frozenset[int] = frozenset()


def remove_wrong_ties(survey: Survey, *, learn: bool = True) -> CheckedTies:
    """Leave out matches and ties that do not fit the others; `learn`: estimate their sigmas.

    Matches are tested as ties are, each chain a point of its own anywhere in space: the test
    whether it is on the ground comes later.
    """
    if not survey.matches.points + survey.ties.points:
        return CheckedTies(survey)
    try:
        every = np.zeros(len(survey.line_start), dtype=np.bool_)
        keep, _ = find_picks_in_lens(survey)
        begun = Participants(_enlarge_stated_sigmas(survey), keep, every, {})
        adjustment = find_best_minima(begun).adjustment
        # Keep the rolling shutter only if ties fit much better with it.
        if is_shutter_unknown(survey):
            still = replace(begun.survey, rolling=None)
            plain = find_best_minima(replace(begun, survey=still)).adjustment
            if not is_shutter_needed(plain, adjustment):
                survey, adjustment = replace(survey, rolling=None), plain
    except GeometryError:  # the main adjustment reports what is missing
        return CheckedTies(replace(survey, rolling=None) if is_shutter_unknown(survey) else survey)
    wrong: list[tuple[bool, int]] = []
    # Remove the worst sighting of each point and readjust, until none is wrong.
    for left in reversed(range(MAX_ROUNDS)):
        out = _find_wrong(adjustment)
        if not out.any():
            break
        ties = adjustment.survey.ties
        wrong += zip(_is_match(ties)[out].tolist(), ties.row[out].tolist(), strict=True)
        try:
            adjustment = _readjust_without(adjustment, out) if left else adjustment
        except SingularError:
            break
    matches = frozenset(row for is_match, row in wrong if is_match)
    ties_ = frozenset(row for is_match, row in wrong if not is_match)
    shown, noise = find_off_ground_labels(adjustment), tuple(_estimate_noise(adjustment))
    factor = {one.source: one.factor for one in noise if learn}
    sound = constrain_by_near_ties(apply_ground_evidence(survey, shown), adjustment)
    sound = replace(
        sound,
        matches=_keep_sound(survey.matches, matches, factor.get("match", 1.0)),
        ties=_keep_sound(sound.ties, ties_, factor.get("tie", 1.0)),
    )
    return CheckedTies(sound, shown, noise, matches, ties_)


def _enlarge_stated_sigmas(survey: Survey) -> Survey:
    """Give observations by people little weight, and treat chains of matches as ties."""
    matches, ties = survey.matches, survey.ties
    joined = Sightings(
        frame=np.concatenate([matches.frame, ties.frame]),
        point=np.concatenate([matches.point, matches.points + ties.point]),
        pixel_px=np.concatenate([matches.pixel_px, ties.pixel_px]),
        sigma_px=np.concatenate([matches.sigma_px, ties.sigma_px]),
        row=np.concatenate([matches.row, ties.row]),
        pick=np.concatenate([matches.pick, ties.pick]),
    )
    return replace(
        survey,
        matches=NO_SIGHTINGS,
        ties=joined,
        pick_sigma_px=SIGMA_FACTOR * survey.pick_sigma_px,
        length_sigma_m=SIGMA_FACTOR * survey.length_sigma_m,
        known=tuple(replace(one, sigma=SIGMA_FACTOR * one.sigma) for one in survey.known),
    )


def _is_match(ties: Sightings) -> Bools:
    """Mark sightings (N,) that belong to chains of matches."""
    return np.asarray(ties.pick[ties.point] >= 0)


def _is_pick(survey: Survey) -> Bools:
    """Mark sightings (N,) that are the picked pixels of chains."""
    ties = survey.ties
    pick = ties.pick[ties.point]
    same = (pick >= 0) & (survey.pick_frame[pick] == ties.frame)
    return np.asarray(same & (survey.pixel_px[pick] == ties.pixel_px).all(axis=1))


def _find_wrong(adjustment: Adjustment) -> Bools:
    """Mark the worst sighting (N,) of each point that has a wrong one.

    The test is relative to the scatter of all sightings, since all their sigmas may be too small.
    The picked pixel of a chain is never wrong, as it defines the point of the chain.
    """
    ties = adjustment.survey.ties
    if not ties.points:
        return np.zeros(0, dtype=np.bool_)
    fall = compute_reductions(adjustment.minimum.blocks["ties"], adjustment.covariance)
    fall = np.where(_is_pick(adjustment.survey), 0.0, fall)
    order = np.lexsort((-fall, ties.point))
    worst = order[np.unique(ties.point[order], return_index=True)[1]]
    limit = np.zeros(len(fall))
    for own in (_is_match(ties), ~_is_match(ties)):
        # Robust variance factor of each kind: median of the decreases over that of chi-square.
        scatter = (
            np.median(fall[own & (fall > 0)]) / MEDIAN_CHI_SQUARE
            if (own & (fall > 0)).any()
            else 1.0
        )
        limit[own] = WRONG_DECREASE * float(np.clip(scatter, 1.0, MAX_NOISE_FACTOR**2))
    limit = np.maximum(limit, MASKED_SHARE * float(fall.max()))
    wrong = np.zeros(len(fall), dtype=np.bool_)
    wrong[worst] = fall[worst] > limit[worst]
    return wrong


def _readjust_without(adjustment: Adjustment, out: Bools) -> Adjustment:
    """Readjust from the current estimate without some sightings."""
    survey = adjustment.survey
    ties, points = survey.ties.remove(out)
    less = replace(survey, ties=ties)
    problem = SurveyProblem(less, adjustment.problem.pivot_m, find_used_lines(adjustment))
    size, rates = problem.layout.point_size, problem.layout.frame_size - 6
    state: State = adjustment.state
    start = replace(
        state,
        point=state.point[:, :size],
        picked=state.picked[:, :size],
        tie=state.tie[points, :size],
        turning=state.turning[:, :rates],
    )
    minimum = iterate(problem, start)
    return Adjustment(problem, minimum, minimum.factor.covariance())


def _estimate_noise(adjustment: Adjustment) -> Iterator[PickNoise]:
    """Estimate the noise of matches and ties from their residuals."""
    ties, block = adjustment.survey.ties, adjustment.minimum.blocks.get("ties")
    if block is None:
        return
    leverage, picked = adjustment.covariance.leverage(block), _is_pick(adjustment.survey)
    for source, own in (("match", _is_match(ties)), ("tie", ~_is_match(ties))):
        if own.any():
            squares = float(np.sum(block.residual[own] ** 2))
            redundancy = float(np.sum(1.0 - leverage[own]))
            prior = VarianceComponent("ties", None, STATED_WEIGHT, MIN_NOISE_FACTOR)
            found = estimate_single(squares, redundancy, prior)
            factor = found.factor
            yield PickNoise(
                source=source,
                stated_px=float(np.sqrt(np.mean(ties.sigma_px[own & ~picked] ** 2))),
                factor=factor,
                sigma=factor * found.sigma,
            )


def _keep_sound(sightings: Sightings, wrong: frozenset[int], factor: float) -> Sightings:
    """Leave out sightings of some rows, and scale the sigmas of the others.

    Parameters
    ----------
    sightings
        Sightings of a survey.
    wrong
        Rows of the table to leave out.
    factor
        Factor of the sigmas.
    """
    some, _ = sightings.remove(np.isin(sightings.row, list(wrong)))
    return replace(some, sigma_px=factor * some.sigma_px)


def add_noise_of_ties(noise: Noise | None, stated: Survey, sound: CheckedTies) -> Noise | None:
    """Add the noise of matches and ties to the learnt noise of picks and ground.

    Parameters
    ----------
    noise
        Noise of the survey with the ground as matches show it.
    stated
        The original survey.
    sound
        The survey without wrong matches and ties.
    """
    if noise is None:
        return None
    areas = [
        replace(
            area,
            stated_m=stated.grounds[k].roughness_sigma_m,
            probability=min(area.probability, sound.shown.probability.get(k, 1.0)),
        )
        for k, area in enumerate(noise.roughness)
    ]
    return replace(noise, picks=(*noise.picks, *sound.noise), roughness=tuple(areas))


def report_ties(survey: Survey, sound: CheckedTies) -> Iterator[Message]:
    """Report left-out sightings, by name where they were found from a pick.

    Parameters
    ----------
    survey
        The original survey.
    sound
        The survey without wrong matches and ties.
    """
    matches = survey.matches
    for row in sorted(sound.matches_left_out):
        at = int(np.flatnonzero(matches.row == row)[-1])
        label = survey.label[survey.pick_label[matches.pick[matches.point[at]]]]
        image = survey.frame_id[matches.frame[at]]
        yield Message(
            "warning",
            "match-left-out",
            f"{label} in {image} is left out: this match does not fit the matches in the other "
            "photos (the point may have moved, or look like something else). Look at "
            "it, and pick it by hand or delete the match.",
            frames=(image,),
            labels=(label,),
            several=MessagePlural(
                "{count} matches are left out: they do not fit the matches in other photos",
                f"{label} in {image}",
                ending="Look at them, and pick them by hand or delete the matches.",
            ),
        )
    wrong, all_ties = len(sound.ties_left_out), len(survey.ties.frame)
    if wrong:
        yield Message(
            "info",
            "ties-left-out",
            f"{wrong} of {all_ties} sightings of tie points are left out: they do not fit the "
            "others. There is nothing to do: the others are enough.",
        )
