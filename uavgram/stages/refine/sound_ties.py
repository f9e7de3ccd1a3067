"""Which matches and ties are wrong, and how exact the others are, before anything rests on them.

The program found them, so no person is asked: what does not fit is left out. They are tested
against each other and the flight log, with what people picked and measured nearly without a say:
a label in the wrong place must not cost the matches that would show it.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from uavgram.errors import GeometryError
from uavgram.estimation.reliability.core import redundancy_of
from uavgram.estimation.reliability.test_statistics import falls_without
from uavgram.estimation.reliability.variance_components import Component, of_one_group
from uavgram.estimation.solver.normal_equations import SingularError
from uavgram.estimation.survey.adjustment import Adjustment
from uavgram.estimation.survey.likelihood import SurveyProblem
from uavgram.estimation.survey.unknowns import State
from uavgram.model.arrays import Bools, Ints
from uavgram.model.message import Message, Several
from uavgram.model.result.noise import PickNoise
from uavgram.model.survey.survey import Survey
from uavgram.model.survey.ties import Sightings
from uavgram.stages.refine.begin.softened import iterate, iterations_for
from uavgram.stages.refine.begin.starts import in_lens
from uavgram.stages.refine.continued import lines_used
from uavgram.stages.refine.minima import Participants, best_minima

Group = Literal["matches", "ties"]
GROUPS: tuple[Group, Group] = ("matches", "ties")

SOURCE: dict[Group, str] = {"matches": "match", "ties": "tie"}

SOFTER = 10.0
"""Factor of the sigmas of picks and lengths while matches and ties are tested."""

WRONG = 20.0
"""Fall of the sum of squares from which a sighting is wrong: chi-square of two degrees of freedom
is beyond it in one of 20,000."""

MEDIAN = 2.0 * float(np.log(2.0))
"""Of the chi-square distribution of two degrees of freedom."""

ROUNDS = 8
"""In each, the worst sighting of every point that has a wrong one is left out."""

STATED_WEIGHT = 20.0
"""Of their stated sigmas, as so many residuals."""

SMALLEST = 0.5
"""Factor of them that the sigmas never fall below."""


@dataclass(frozen=True, eq=False)
class SoundTies:
    """A survey whose matches and ties fit each other.

    Attributes
    ----------
    survey, as_stated
        Without wrong ones, and with sigmas of the others as they show them, and as stated.
    noise
        Of each group that there is.
    left_out
        (n,) rows of the picks, and (m,) of the ties, that are wrong.
    """

    survey: Survey
    as_stated: Survey
    noise: tuple[PickNoise, ...]
    left_out: dict[Group, Ints]


def with_sound_ties(survey: Survey) -> SoundTies:
    """The survey without matches and ties that do not fit the others."""
    none = np.zeros(0, dtype=np.int64)
    left_out: dict[Group, Ints] = dict.fromkeys(GROUPS, none)
    if not survey.matches.points + survey.ties.points:
        return SoundTies(survey, survey, (), left_out)
    try:
        every = np.zeros(len(survey.line_start), dtype=np.bool_)
        keep, _ = in_lens(survey)
        adjustment = best_minima(Participants(_softened(survey), keep, every, {})).adjustment
    except GeometryError:  # what is missing is told of the survey as it is
        return SoundTies(survey, survey, (), left_out)
    for _ in range(ROUNDS):
        out = {group: _wrong(adjustment, group) for group in GROUPS}
        if not any(wrong.any() for wrong in out.values()):
            break
        for group in GROUPS:
            wrong = sightings_of(adjustment.survey, group).row[out[group]]
            left_out[group] = np.concatenate([left_out[group], wrong])
        try:
            adjustment = _without(adjustment, out)
        except SingularError:
            break
    noise = tuple(
        _noise(adjustment, g) for g in GROUPS if sightings_of(adjustment.survey, g).points
    )
    as_stated = _sound(survey, left_out, ())
    return SoundTies(_sound(survey, left_out, noise), as_stated, noise, left_out)


def sightings_of(survey: Survey, group: Group) -> Sightings:
    """The matches or the ties of a survey."""
    return survey.matches if group == "matches" else survey.ties


def _softened(survey: Survey) -> Survey:
    return replace(
        survey,
        pick_sigma_px=SOFTER * survey.pick_sigma_px,
        length_sigma_m=SOFTER * survey.length_sigma_m,
        known=tuple(replace(one, sigma=SOFTER * one.sigma) for one in survey.known),
    )


def _wrong(adjustment: Adjustment, group: Group) -> Bools:
    """(N,) the worst sighting of each point that has one that is wrong.

    Sightings are wrong beside the scatter of the others: their sigmas may be too small for all. The
    picked pixel of a chain is never wrong, as it says by itself what the chain is of.
    """
    sightings = sightings_of(adjustment.survey, group)
    if not sightings.points:
        return np.zeros(0, dtype=np.bool_)
    fall = falls_without(adjustment.minimum.blocks[group], adjustment.covariance)
    fall = np.where(_is_picked(adjustment.survey, group), 0.0, fall)
    order = np.lexsort((-fall, sightings.point))
    worst = order[np.unique(sightings.point[order], return_index=True)[1]]
    scatter = max(1.0, float(np.median(fall[fall > 0])) / MEDIAN) if (fall > 0).any() else 1.0
    wrong = np.zeros(len(fall), dtype=np.bool_)
    wrong[worst] = fall[worst] > WRONG * scatter
    return wrong


def _is_picked(survey: Survey, group: Group) -> Bools:
    """(N,) which sightings are the picked pixels of chains."""
    sightings = sightings_of(survey, group)
    if group == "ties":
        return np.zeros(len(sightings.frame), dtype=np.bool_)
    pick = sightings.pick[sightings.point]
    same = survey.pick_frame[pick] == sightings.frame
    return np.asarray(same & (survey.pixel_px[pick] == sightings.pixel_px).all(axis=1))


def _without(adjustment: Adjustment, out: dict[Group, Bools]) -> Adjustment:
    """Adjusted without some sightings, from where it stands."""
    survey = adjustment.survey
    matches, chains = survey.matches.without(out["matches"])
    ties, points = survey.ties.without(out["ties"])
    kept = np.concatenate([chains, survey.matches.points + points])
    less = replace(survey, matches=matches, ties=ties)
    problem = SurveyProblem(less, adjustment.problem.pivot_m, lines_used(adjustment))
    size = problem.layout.point_size
    state: State = adjustment.state
    rates = state.turning[:, : problem.layout.frame_size - 6]
    start = replace(state, point=state.point[:, :size], tie=state.tie[kept, :size], turning=rates)
    minimum = iterate(problem, start, iterations_for(survey.calibration))
    return Adjustment(problem, minimum, minimum.factor.covariance())


def _noise(adjustment: Adjustment, group: Group) -> PickNoise:
    """How exact sightings are, as their residuals show it."""
    sightings, block = sightings_of(adjustment.survey, group), adjustment.minimum.blocks[group]
    component = Component(group, None, STATED_WEIGHT, SMALLEST)
    squares = float(np.sum(block.residual**2))
    found = of_one_group(squares, redundancy_of(adjustment, group), component)
    factor = float(found.factor[0])
    return PickNoise(
        source=SOURCE[group],
        stated_px=float(np.sqrt(np.mean(sightings.sigma_px**2))),
        factor=factor,
        sigma=factor * float(found.sigma[0]),
    )


def _sound(survey: Survey, left_out: dict[Group, Ints], noise: tuple[PickNoise, ...]) -> Survey:
    """The survey without what is wrong, and with the sigmas that were found.

    Parameters
    ----------
    survey
        All observations.
    left_out
        Rows of the tables that are wrong.
    noise
        Of the rest.
    """
    factor = {one.source: one.factor for one in noise}
    found = {}
    for group in GROUPS:
        sightings = sightings_of(survey, group)
        some, _ = sightings.without(np.isin(sightings.row, left_out[group]))
        found[group] = replace(some, sigma_px=factor.get(SOURCE[group], 1.0) * some.sigma_px)
    return replace(survey, matches=found["matches"], ties=found["ties"])


def remarks_on_ties(survey: Survey, sound: SoundTies) -> Iterator[Message]:
    """What was left out, by name where it was found from a pick.

    Parameters
    ----------
    survey
        As it was handed over.
    sound
        What is left of it.
    """
    matches = survey.matches
    for row in sound.left_out["matches"].tolist():
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
            several=Several(
                "{count} matches are left out: what the program found there does not fit what it "
                "found in other photos",
                f"{label} in {image}",
                ending="Look at them, and pick them by hand or delete these rows.",
            ),
        )
    wrong, all_ties = len(sound.left_out["ties"]), len(survey.ties.frame)
    if wrong:
        yield Message(
            "info",
            "ties-left-out",
            f"{wrong} of {all_ties} sightings of tie points are left out: they do not fit the "
            "others. There is nothing to do: the others are enough.",
        )
