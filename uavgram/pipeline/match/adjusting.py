"""The adjustment with what was found so far, quick enough to be made after every round.

What people picked and measured is adjusted in full once, with the search for blunders and causes.
What that left out stays out; afterwards only poses and points are adjusted anew.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from uavgram.estimation.first_poses.first_points import seen_labels
from uavgram.estimation.reliability.test_statistics import falls_without
from uavgram.estimation.survey.adjustment import Adjustment, LeftOutCause, Refined
from uavgram.estimation.survey.departures import heights_at
from uavgram.model.arrays import Bools, Floats, Ints
from uavgram.model.survey.observations import Picks
from uavgram.model.survey.survey import Survey
from uavgram.pipeline.match.rows import with_found
from uavgram.pipeline.measure.compute import assembled_survey, refined_survey
from uavgram.pipeline.measure.inputs import Inputs
from uavgram.pipeline.measure.pose import Posed
from uavgram.stages.match import CONTRADICTED, Found, Pair
from uavgram.stages.refine.minima import Participants, best_minima
from uavgram.stages.refine.off_ground.heights import with_free
from uavgram.stages.refine.sound_ties import with_sound_ties

UNEVEN_M = 0.1
"""Roughness of ground of which nobody said that it is rougher: crown, gutter and kerb of a road."""

RAISED_M = 0.8, 1.0
"""Height of a point of which nothing is known, and its sigma, while one photo alone shows it: from
the ground to the roof of a van."""

LEAST_HEIGHT_M = 0.25
"""Of a point off the ground, below which what was found is taken for the ground behind its edge."""

ENOUGH = 3
"""Photos that must agree on a height of which nothing is known: any two agree on one."""

BESIDE = "what looks like it is the ground beside it"
ALONE = "its height is not known, and too few photos show it to be sure"

TRIED_AGAIN = (LeftOutCause.UNDETERMINED, LeftOutCause.NOT_JOINED)
"""Why picks were left out that what is found may bring back."""


WRONG = 25.0
"""Squared sigmas from which a match is wrong: chi-square of two degrees of freedom is beyond it in
one of 270,000."""

WRONG_RAISED = 9.2
"""The same of points off the ground, whose sigma is wide: beyond it in one of a hundred."""

MOST_ROUNDS = 8
"""Rounds in which such matches are left out."""

SPREAD = 2.0
"""Factor of the matches' sigmas from which on one of them may have spread its error over all."""

BETTER = 0.8
"""To this share the square of that factor must fall without a find that spread its error."""


class _Tried(NamedTuple):
    """An adjustment with some finds.

    Attributes
    ----------
    adjustment
        Without those that stand out.
    kept
        The others.
    factor
        By which their sigmas are too small, as their residuals show it.
    worst
        The one that fits worst, where that is a large factor.
    out
        Numbers of all picks that stand out, earlier matches among them.
    """

    adjustment: Adjustment
    kept: frozenset[Pair]
    factor: float
    worst: Pair | None
    out: frozenset[int]


@dataclass(frozen=True, eq=False)
class Base:
    """A project whose own picks are adjusted.

    Attributes
    ----------
    inputs, posed
        As read, with the matches that stay; and where the photos were taken.
    keep
        (P,) picks of the survey that take part.
    refined
        The adjustment of what people picked and measured.
    """

    inputs: Inputs
    posed: Posed
    keep: Bools
    refined: Refined

    def sources(self, adjustment: Adjustment) -> list[int]:
        """Numbers of the project's picks by hand that take part in an adjustment."""
        survey, picks = adjustment.survey, self.inputs.picks
        pairs = zip(survey.pick_frame.tolist(), survey.pick_label.tolist(), strict=True)
        there = {(survey.frame_id[frame], survey.label[label]) for frame, label in pairs}
        by_hand = np.flatnonzero(picks.of_source("hand")).tolist()
        return [i for i in by_hand if (picks.image[i], picks.label[i]) in there]

    def without_unfit(self, asked: Bools) -> tuple[Base, Bools]:
        """Without those of some earlier matches (P,) that fit no longer, and which these are."""
        unfit = np.zeros(len(asked), dtype=np.bool_)
        if asked.any():
            unfit[list(self._tried({}).out)] = True
            unfit &= asked
        picks = with_found(self.inputs.picks, {}, keep=~unfit)
        return replace(self, inputs=replace(self.inputs, picks=picks)), unfit

    def with_free(self, labels: Collection[str]) -> Base:
        """With the heights of some labels unknown."""
        picks = self.inputs.picks
        free = picks.is_free | np.isin(picks.label, list(labels))
        return replace(self, inputs=replace(self.inputs, picks=replace(picks, is_free=free)))

    def of_unknown_height(self, survey: Survey) -> Bools:
        """(K,) labels of a survey off the ground, anywhere, which one photo alone shows."""
        picks = self.inputs.picks
        free = {picks.label[i] for i in np.flatnonzero(picks.is_free).tolist()}
        return np.isin(survey.label, sorted(free)) & (_photos_of_labels(survey) < 2)

    def adjusted(self, found: Mapping[Pair, Found]) -> tuple[Adjustment, dict[Pair, str]]:
        """The adjustment with what was found, and what of that it contradicts, with the reason.

        A find that is far off spreads its error over few others, so that none stands out of them:
        what makes all others fit much better is contradicted too.
        """
        tried = self._tried(found)
        while tried.factor > SPREAD and tried.worst is not None:
            kept = tried.kept - {tried.worst}
            rest = self._tried({pair: one for pair, one in found.items() if pair in kept})
            if rest.factor**2 > BETTER * tried.factor**2:
                break
            tried = rest
        wrong = dict.fromkeys(sorted(frozenset(found) - tried.kept), CONTRADICTED)
        return tried.adjustment, wrong | self._unsure(tried)

    def _unsure(self, tried: _Tried) -> dict[Pair, str]:
        """Finds of points of unknown height that are the ground behind an edge, or may be.

        Two photos agree on a height whatever they show; only a third one says that it is one thing.
        """
        picks, survey = self.inputs.picks, tried.adjustment.survey
        free = {picks.label[i] for i in np.flatnonzero(picks.is_free).tolist()}
        height = heights_at(tried.adjustment, tried.adjustment.state)
        photos = _photos_of_labels(survey)
        alone = {name for name, count in zip(survey.label, photos, strict=True) if count < ENOUGH}
        low = {survey.label[k] for k in np.flatnonzero(np.abs(height) < LEAST_HEIGHT_M)}
        return {
            pair: ALONE if pair[1] in alone else BESIDE
            for pair in sorted(tried.kept)
            if pair[1] in free & (alone | low)
        }

    def _tried(self, found: Mapping[Pair, Found]) -> _Tried:
        """Adjusted with some finds, but for those that stand out."""
        picks = with_found(self.inputs.picks, found)
        survey = assembled_survey(replace(self.inputs, picks=picks), self.posed).survey
        sound = with_sound_ties(self._prepared(survey))
        out = set(sound.matches_left_out)
        survey, adjustment = sound.survey, self._best(sound.survey)
        for _ in range(MOST_ROUNDS):  # the ground, and heights that are known, have a say now
            wrong = _standing_out(adjustment, picks)
            if not wrong:
                break
            out |= wrong
            gone = np.isin(survey.matches.row, list(wrong)) & _is_found(survey, picks)
            survey = replace(survey, matches=survey.matches.without(gone)[0])
            adjustment = self._best(survey)
        factor = max((one.factor for one in sound.noise if one.source == "match"), default=0.0)
        worst = _worst(adjustment, picks) if factor > SPREAD else None
        gone_pairs = {(picks.image[i], picks.label[i]) for i in out}
        return _Tried(adjustment, frozenset(found) - gone_pairs, factor, worst, frozenset(out))

    def _best(self, survey: Survey) -> Adjustment:
        """The best adjustment without what the full one left out."""
        refined = self.refined
        taking = Participants(survey, self.keep, refined.line_removed, {}, refined.known_removed)
        return best_minima(taking).adjustment

    def _prepared(self, survey: Survey) -> Survey:
        """With first poses and heights of the full adjustment, and ground that may be uneven."""
        refined = self.refined
        survey = with_free(survey, sorted(refined.off_ground))
        rough = tuple(
            replace(ground, roughness_sigma_m=max(ground.roughness_sigma_m, UNEVEN_M))
            for ground in survey.grounds
        )
        alone = survey.is_free & (_photos_of_labels(survey) < 2)
        height, sigma = RAISED_M
        if survey.telemetry is None:  # a few matches would not place frames again that ties place
            survey = replace(survey, candidate_poses=refined.adjustment.survey.candidate_poses)
        return replace(
            survey,
            grounds=rough,
            is_free=survey.is_free & ~alone,
            height_above_m=np.where(alone, height, survey.height_above_m),
            height_sigma_m=np.where(alone, sigma, survey.height_sigma_m),
        )


def begun(inputs: Inputs, posed: Posed) -> Base:
    """Adjust what people picked and measured.

    Raises
    ------
    GeometryError
        That determines nothing yet; says what is missing.
    """
    survey = assembled_survey(replace(inputs, picks=_made_by_people(inputs.picks)), posed).survey
    refined, _ = refined_survey(survey, inputs.project.solve)
    keep = np.ones(len(survey.pick_frame), dtype=np.bool_)
    keep[: len(refined.pick_removed)] = ~refined.pick_removed
    out = [i for i, why in refined.pick_reason.items() if why.cause not in TRIED_AGAIN]
    keep[out] = False
    return Base(inputs, posed, keep, refined)


def _made_by_people(picks: Picks) -> Picks:
    return with_found(picks, {}, keep=~picks.of_source("match"))


def _photos_of_labels(survey: Survey) -> Ints:
    """(K,) number of photos that each label is seen in, matches included."""
    return np.bincount(seen_labels(survey)[1], minlength=len(survey.label))


def _is_found(survey: Survey, picks: Picks) -> Bools:
    """(N,) which sightings of chains are matches, and not the picked pixels they begin from."""
    return np.asarray(picks.of_source("match")[survey.matches.row])


def _misfits(adjustment: Adjustment, picks: Picks) -> Floats:
    """(N,) squared sigmas by which matches do not fit; -1 of picked pixels."""
    survey = adjustment.survey
    fall = falls_without(adjustment.minimum.blocks["matches"], adjustment.covariance)
    return np.where(_is_found(survey, picks), fall, -1.0)


def _worst(adjustment: Adjustment, picks: Picks) -> Pair | None:
    """The match that fits worst."""
    sightings = adjustment.survey.matches
    if not sightings.points:
        return None
    row = int(sightings.row[_misfits(adjustment, picks).argmax()])
    return picks.image[row], picks.label[row]


def _standing_out(adjustment: Adjustment, picks: Picks) -> set[int]:
    """Rows of picks: of matches that do not fit, the worst of each photo and of each chain."""
    sightings = adjustment.survey.matches
    if not sightings.points:
        return set()
    misfit = _misfits(adjustment, picks)
    survey = adjustment.survey
    label = survey.pick_label[sightings.pick][sightings.point]
    wrong = misfit > np.where(survey.off_ground[label], WRONG_RAISED, WRONG)
    for group in (sightings.frame, sightings.point):
        worst = np.zeros(int(group.max()) + 1)
        np.maximum.at(worst, group, misfit)
        wrong &= misfit >= worst[group]
    return set(sightings.row[wrong].tolist())
