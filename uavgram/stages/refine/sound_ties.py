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
from uavgram.estimation.reliability.test_statistics import falls_without
from uavgram.estimation.reliability.variance_components import Component, of_one_group
from uavgram.estimation.solver.normal_equations import SingularError
from uavgram.estimation.survey.adjustment import Adjustment
from uavgram.estimation.survey.likelihood import SurveyProblem
from uavgram.estimation.survey.unknowns import State
from uavgram.model.arrays import Bools
from uavgram.model.message import Message, MessagePlural
from uavgram.model.result.reliability import Noise, PickNoise
from uavgram.model.survey.survey import Survey
from uavgram.model.survey.ties import NO_SIGHTINGS, Sightings
from uavgram.stages.refine.begin.photo_motion import ask_for_shutter, is_in_question
from uavgram.stages.refine.begin.softened import iterate, iterations_for
from uavgram.stages.refine.begin.starts import in_lens
from uavgram.stages.refine.continued import lines_used
from uavgram.stages.refine.minima import Participants, best_minima
from uavgram.stages.refine.near_ties import with_near_ties
from uavgram.stages.refine.off_ground.shown import Shown, shown_by_sightings, with_shown

SOFTER = 10.0
"""Factor of the sigmas of picks and lengths while matches and ties are tested."""

WRONG = 20.0
"""Decrease of the sum of squares above which a sighting is wrong: chi-square with two degrees of
freedom exceeds it with a probability of 1 in 20,000."""

WORST = 3.0
"""Largest factor by which the sigmas of sightings may be too small: a wrong one among very few must
not count as scatter of all."""

MEDIAN = 2.0 * float(np.log(2.0))
"""Median of the chi-square distribution with two degrees of freedom."""

ROUNDS = 12
"""Largest number of rounds; each leaves out the worst sighting of every point that has a wrong
one."""

BENT = 0.2
"""Share of the largest decrease below which a sighting may only seem wrong, distorted by worse
ones."""

STATED_WEIGHT = 20.0
"""Weight of the stated sigmas, as a number of residuals."""

SMALLEST = 0.5
"""Lower limit of the factor of the stated sigmas."""


@dataclass(frozen=True, eq=False)
class SoundTies:
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
    shown: Shown = field(default_factory=Shown)
    noise: tuple[PickNoise, ...] = ()
    matches_left_out: frozenset[int] = frozenset()
    ties_left_out: frozenset[int] = frozenset()


def with_sound_ties(survey: Survey, *, learn: bool = True) -> SoundTies:
    """Leave out matches and ties that do not fit the others; `learn`: estimate their sigmas.

    Matches are tested as ties are, each chain a point of its own anywhere in space: the test
    whether it is on the ground comes later.
    """
    if not survey.matches.points + survey.ties.points:
        return SoundTies(survey)
    try:
        every = np.zeros(len(survey.line_start), dtype=np.bool_)
        keep, _ = in_lens(survey)
        begun = Participants(_softened(survey), keep, every, {})
        adjustment = best_minima(begun).adjustment
        # Keep the rolling shutter only if ties fit much better with it.
        if is_in_question(survey):
            still = replace(begun.survey, rolling=None)
            plain = best_minima(replace(begun, survey=still)).adjustment
            if not ask_for_shutter(plain, adjustment):
                survey, adjustment = replace(survey, rolling=None), plain
    except GeometryError:  # the main adjustment reports what is missing
        return SoundTies(replace(survey, rolling=None) if is_in_question(survey) else survey)
    wrong: list[tuple[bool, int]] = []
    # Remove the worst sighting of each point and readjust, until none is wrong.
    for left in reversed(range(ROUNDS)):
        out = _wrong(adjustment)
        if not out.any():
            break
        ties = adjustment.survey.ties
        wrong += zip(_is_match(ties)[out].tolist(), ties.row[out].tolist(), strict=True)
        try:
            adjustment = _without(adjustment, out) if left else adjustment
        except SingularError:
            break
    matches = frozenset(row for is_match, row in wrong if is_match)
    ties_ = frozenset(row for is_match, row in wrong if not is_match)
    shown, noise = shown_by_sightings(adjustment), tuple(_noise(adjustment))
    factor = {one.source: one.factor for one in noise if learn}
    sound = with_near_ties(with_shown(survey, shown), adjustment)
    sound = replace(
        sound,
        matches=_sound(survey.matches, matches, factor.get("match", 1.0)),
        ties=_sound(sound.ties, ties_, factor.get("tie", 1.0)),
    )
    return SoundTies(sound, shown, noise, matches, ties_)


def _softened(survey: Survey) -> Survey:
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
        pick_sigma_px=SOFTER * survey.pick_sigma_px,
        length_sigma_m=SOFTER * survey.length_sigma_m,
        known=tuple(replace(one, sigma=SOFTER * one.sigma) for one in survey.known),
    )


def _is_match(ties: Sightings) -> Bools:
    """Mark sightings (N,) that belong to chains of matches."""
    return np.asarray(ties.pick[ties.point] >= 0)


def _is_picked(survey: Survey) -> Bools:
    """Mark sightings (N,) that are the picked pixels of chains."""
    ties = survey.ties
    pick = ties.pick[ties.point]
    same = (pick >= 0) & (survey.pick_frame[pick] == ties.frame)
    return np.asarray(same & (survey.pixel_px[pick] == ties.pixel_px).all(axis=1))


def _wrong(adjustment: Adjustment) -> Bools:
    """Mark the worst sighting (N,) of each point that has a wrong one.

    The test is relative to the scatter of all sightings, since all their sigmas may be too small.
    The picked pixel of a chain is never wrong, as it defines the point of the chain.
    """
    ties = adjustment.survey.ties
    if not ties.points:
        return np.zeros(0, dtype=np.bool_)
    fall = falls_without(adjustment.minimum.blocks["ties"], adjustment.covariance)
    fall = np.where(_is_picked(adjustment.survey), 0.0, fall)
    order = np.lexsort((-fall, ties.point))
    worst = order[np.unique(ties.point[order], return_index=True)[1]]
    limit = np.zeros(len(fall))
    for own in (_is_match(ties), ~_is_match(ties)):
        # Robust variance factor of each kind: median of the decreases over that of chi-square.
        scatter = np.median(fall[own & (fall > 0)]) / MEDIAN if (own & (fall > 0)).any() else 1.0
        limit[own] = WRONG * float(np.clip(scatter, 1.0, WORST**2))
    limit = np.maximum(limit, BENT * float(fall.max()))
    wrong = np.zeros(len(fall), dtype=np.bool_)
    wrong[worst] = fall[worst] > limit[worst]
    return wrong


def _without(adjustment: Adjustment, out: Bools) -> Adjustment:
    """Readjust from the current estimate without some sightings."""
    survey = adjustment.survey
    ties, points = survey.ties.without(out)
    less = replace(survey, ties=ties)
    problem = SurveyProblem(less, adjustment.problem.pivot_m, lines_used(adjustment))
    size, rates = problem.layout.point_size, problem.layout.frame_size - 6
    state: State = adjustment.state
    start = replace(
        state,
        point=state.point[:, :size],
        picked=state.picked[:, :size],
        tie=state.tie[points, :size],
        turning=state.turning[:, :rates],
    )
    minimum = iterate(problem, start, iterations_for(survey.calibration))
    return Adjustment(problem, minimum, minimum.factor.covariance())


def _noise(adjustment: Adjustment) -> Iterator[PickNoise]:
    """Estimate the noise of matches and ties from their residuals."""
    ties, block = adjustment.survey.ties, adjustment.minimum.blocks.get("ties")
    if block is None:
        return
    leverage, picked = adjustment.covariance.leverage(block), _is_picked(adjustment.survey)
    for source, own in (("match", _is_match(ties)), ("tie", ~_is_match(ties))):
        if own.any():
            squares = float(np.sum(block.residual[own] ** 2))
            redundancy = float(np.sum(1.0 - leverage[own]))
            prior = Component("ties", None, STATED_WEIGHT, SMALLEST)
            found = of_one_group(squares, redundancy, prior)
            factor = float(found.factor[0])
            yield PickNoise(
                source=source,
                stated_px=float(np.sqrt(np.mean(ties.sigma_px[own & ~picked] ** 2))),
                factor=factor,
                sigma=factor * float(found.sigma[0]),
            )


def _sound(sightings: Sightings, wrong: frozenset[int], factor: float) -> Sightings:
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
    some, _ = sightings.without(np.isin(sightings.row, list(wrong)))
    return replace(some, sigma_px=factor * some.sigma_px)


def with_noise_of_ties(noise: Noise | None, stated: Survey, sound: SoundTies) -> Noise | None:
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


def remarks_on_ties(survey: Survey, sound: SoundTies) -> Iterator[Message]:
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
            f"{label} in {image} is left out: what the program found there does not fit what it "
            "found in the other photos (it may have moved, or look like something else). Look at "
            "it, and pick it by hand or delete the row.",
            frames=(image,),
            labels=(label,),
            several=MessagePlural(
                "{count} matches are left out: what the program found there does not fit what it "
                "found in other photos",
                f"{label} in {image}",
                ending="Look at them, and pick them by hand or delete these rows.",
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
