"""Adjustment with the finds so far, fast enough for every round.

The picks and measurements by people are adjusted in full once, with the search for blunders and
causes. Observations left out there stay out; afterwards only poses and points are readjusted.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from uavgram.estimation.first_poses.first_values import find_seen_labels
from uavgram.estimation.reliability.redundancy import compute_reductions
from uavgram.estimation.survey.adjustment import (
    Adjustment,
    LeftOutCause,
    Refined,
    compute_heights_at,
)
from uavgram.model.arrays import Bools, Floats, Ints
from uavgram.model.observations import Picks
from uavgram.model.survey import Survey
from uavgram.pipeline.match.selection import append_matches
from uavgram.pipeline.measure.compute import adjust_survey, assemble_survey
from uavgram.pipeline.measure.inputs import Inputs
from uavgram.pipeline.measure.pose import PosedFrames
from uavgram.stages.match import CONTRADICTED, Found, Pair
from uavgram.stages.refine.minima import Participants, find_best_minima
from uavgram.stages.refine.off_ground import set_free_heights
from uavgram.stages.refine.tie_outliers import remove_wrong_ties

UNEVEN_M = 0.1
"""Least roughness of ground without a larger statement [m]: crown, gutter and kerb of a road."""

RAISED_M = 0.8, 1.0
"""Height of a point without any information, and its sigma [m], while only one photo shows it: from
the ground to the roof of a van."""

MIN_HEIGHT_M = 0.25
"""Least height of a point off the ground [m]: below, the find is taken for the ground behind its
edge."""

ENOUGH = 3
"""Photos that must agree on an unknown height: any two agree on one."""

BESIDE = "what looks like it is the ground beside it"
ALONE = "its height is not known, and too few photos show it to be sure"

TRIED_AGAIN = (LeftOutCause.UNDETERMINED, LeftOutCause.NOT_JOINED)
"""Causes of left-out picks that finds may bring back."""


WRONG = 25.0
"""Squared sigmas above which a match is wrong: chi-square with two degrees of freedom exceeds it
with a probability of 1 in 270,000."""

WRONG_RAISED = 9.2
"""Squared sigmas for points off the ground, whose sigma is wide: exceeded with a probability of 1
in a hundred."""

MAX_ROUNDS = 8
"""Largest number of rounds in which such matches are left out."""

SPREAD = 2.0
"""Factor of the matches' sigmas above which one of them may have spread its error over all."""

BETTER = 0.8
"""Share to which the square of that factor must fall without a find that spread its error."""


class _Trial(NamedTuple):
    """Adjustment with some finds.

    Attributes
    ----------
    adjustment
        Adjustment without outliers among them.
    kept
        The others.
    factor
        Factor by which their sigmas are too small, estimated from their residuals.
    worst
        The find of largest misfit, where that factor is large.
    out
        Numbers of all picks that are outliers, earlier matches among them.
    """

    adjustment: Adjustment
    kept: frozenset[Pair]
    factor: float
    worst: Pair | None
    out: frozenset[int]


@dataclass(frozen=True, eq=False)
class BaseAdjustment:
    """Project whose own picks are adjusted.

    Attributes
    ----------
    inputs, posed
        As read, with the matches that stay; and poses of the photos.
    keep
        (P,) picks of the survey that take part.
    refined
        Adjustment of the picks and measurements by people.
    """

    inputs: Inputs
    posed: PosedFrames
    keep: Bools
    refined: Refined

    def sources(self, adjustment: Adjustment) -> list[int]:
        """Return numbers of the project's picks by hand that take part in an adjustment."""
        survey, picks = adjustment.survey, self.inputs.picks
        pairs = zip(survey.pick_frame.tolist(), survey.pick_label.tolist(), strict=True)
        there = {(survey.frame_id[frame], survey.label[label]) for frame, label in pairs}
        by_hand = np.flatnonzero(picks.of_source("hand")).tolist()
        return [i for i in by_hand if (picks.image[i], picks.label[i]) in there]

    def remove_unfit(self, asked: Bools) -> tuple[BaseAdjustment, Bools]:
        """Remove those of some earlier matches (P,) that no longer fit; also return their mask."""
        unfit = np.zeros(len(asked), dtype=np.bool_)
        if asked.any():
            unfit[list(self._tried({}).out)] = True
            unfit &= asked
        picks = append_matches(self.inputs.picks, {}, keep=~unfit)
        return replace(self, inputs=replace(self.inputs, picks=picks)), unfit

    def free_heights(self, labels: Collection[str]) -> BaseAdjustment:
        """Free the heights of some labels."""
        picks = self.inputs.picks
        free = picks.is_free | np.isin(picks.label, list(labels))
        return replace(self, inputs=replace(self.inputs, picks=replace(picks, is_free=free)))

    def mark_unknown_heights(self, survey: Survey) -> Bools:
        """Mark labels (K,) off the ground of unknown height: shown by picks of people alone."""
        picks = self.inputs.picks
        free = {picks.label[i] for i in np.flatnonzero(picks.is_free).tolist()}
        matched = np.zeros(len(survey.label), dtype=np.bool_)
        if survey.matches.points:
            matched[survey.pick_label[survey.matches.pick]] = True
        return (np.isin(survey.label, sorted(free)) | survey.is_free) & ~matched

    def adjusted(self, found: Mapping[Pair, Found]) -> tuple[Adjustment, dict[Pair, str]]:
        """Adjust with the finds; also return the contradicted finds, with the reason.

        A find with a large error spreads it over few others, so that none is an outlier: a find
        without which all others fit much better is contradicted too.
        """
        tried = self._tried(found)
        while tried.factor > SPREAD and tried.worst is not None:
            kept = tried.kept - {tried.worst}
            rest = self._tried({pair: one for pair, one in found.items() if pair in kept})
            if rest.factor**2 > BETTER * tried.factor**2:
                break
            tried = rest
        wrong = dict.fromkeys(sorted(frozenset(found) - tried.kept), CONTRADICTED)
        return tried.adjustment, wrong | self._list_unsure(tried)

    def _list_unsure(self, tried: _Trial) -> dict[Pair, str]:
        """Return finds of points of unknown height that are, or may be, the ground behind an edge.

        Any two photos agree on some height; only a third one confirms that it is one
        object.
        """
        picks, survey = self.inputs.picks, tried.adjustment.survey
        free = {picks.label[i] for i in np.flatnonzero(picks.is_free).tolist()}
        height = compute_heights_at(tried.adjustment, tried.adjustment.state)
        photos = _photos_of_labels(survey)
        alone = {name for name, count in zip(survey.label, photos, strict=True) if count < ENOUGH}
        low = {survey.label[k] for k in np.flatnonzero(np.abs(height) < MIN_HEIGHT_M)}
        return {
            pair: ALONE if pair[1] in alone else BESIDE
            for pair in sorted(tried.kept)
            if pair[1] in free & (alone | low)
        }

    def _tried(self, found: Mapping[Pair, Found]) -> _Trial:
        """Adjust with some finds, without outliers."""
        picks = append_matches(self.inputs.picks, found)
        survey = assemble_survey(replace(self.inputs, picks=picks), self.posed).survey
        sound = remove_wrong_ties(self._prepare(survey))
        out = set(sound.matches_left_out)
        survey, adjustment = sound.survey, self._best(sound.survey)
        for _ in range(MAX_ROUNDS):  # now the ground and known heights take part
            wrong = _find_misfits(adjustment, picks)
            if not wrong:
                break
            out |= wrong
            gone = np.isin(survey.matches.row, list(wrong)) & _is_found(survey, picks)
            survey = replace(survey, matches=survey.matches.without(gone)[0])
            adjustment = self._best(survey)
        factor = max((one.factor for one in sound.noise if one.source == "match"), default=0.0)
        worst = _worst(adjustment, picks) if factor > SPREAD else None
        gone_pairs = {(picks.image[i], picks.label[i]) for i in out}
        return _Trial(adjustment, frozenset(found) - gone_pairs, factor, worst, frozenset(out))

    def _best(self, survey: Survey) -> Adjustment:
        """Return the best adjustment without the observations left out of the full one."""
        refined = self.refined
        known, poses = refined.known_removed, refined.pose_widened
        taking = Participants(survey, self.keep, refined.line_removed, {}, known, poses)
        return find_best_minima(taking).adjustment

    def _prepare(self, survey: Survey) -> Survey:
        """Set first poses and heights of the full adjustment, and ground that may be uneven."""
        refined = self.refined
        survey = set_free_heights(survey, sorted(refined.off_ground))
        rough = tuple(
            replace(ground, roughness_sigma_m=max(ground.roughness_sigma_m, UNEVEN_M))
            for ground in survey.grounds
        )
        alone = survey.is_free & (_photos_of_labels(survey) < 2)
        height, sigma = RAISED_M
        if survey.telemetry is None:  # keep poses by ties
            survey = replace(survey, candidate_poses=refined.adjustment.survey.candidate_poses)
        return replace(
            survey,
            grounds=rough,
            is_free=survey.is_free & ~alone,
            height_above_m=np.where(alone, height, survey.height_above_m),
            height_sigma_m=np.where(alone, sigma, survey.height_sigma_m),
        )


def adjust_manual_picks(inputs: Inputs, posed: PosedFrames) -> BaseAdjustment:
    """Adjust the picks and measurements by people.

    Raises
    ------
    GeometryError
        They do not determine the survey yet; the message names the missing ones.
    """
    survey = assemble_survey(replace(inputs, picks=_mark_manual(inputs.picks)), posed).survey
    refined, _ = adjust_survey(survey, inputs.project.solve)
    keep = np.ones(len(survey.pick_frame), dtype=np.bool_)
    keep[: len(refined.pick_removed)] = ~refined.pick_removed
    out = [i for i, why in refined.pick_reason.items() if why.cause not in TRIED_AGAIN]
    keep[out] = False
    return BaseAdjustment(inputs, posed, keep, refined)


def _mark_manual(picks: Picks) -> Picks:
    return append_matches(picks, {}, keep=~picks.of_source("match"))


def _photos_of_labels(survey: Survey) -> Ints:
    """Count the photos (K,) of each label, matches included."""
    return np.bincount(find_seen_labels(survey)[1], minlength=len(survey.label))


def _is_found(survey: Survey, picks: Picks) -> Bools:
    """Mark sightings (N,) of chains that are matches, not the picked pixels of their beginning."""
    return np.asarray(picks.of_source("match")[survey.matches.row])


def _misfits(adjustment: Adjustment, picks: Picks) -> Floats:
    """Compute squared misfits (N,) of matches in sigmas; -1 for picked pixels."""
    survey = adjustment.survey
    fall = compute_reductions(adjustment.minimum.blocks["matches"], adjustment.covariance)
    return np.where(_is_found(survey, picks), fall, -1.0)


def _worst(adjustment: Adjustment, picks: Picks) -> Pair | None:
    """Return the match of largest misfit."""
    sightings = adjustment.survey.matches
    if not sightings.points:
        return None
    row = int(sightings.row[_misfits(adjustment, picks).argmax()])
    return picks.image[row], picks.label[row]


def _find_misfits(adjustment: Adjustment, picks: Picks) -> set[int]:
    """Return rows of picks: matches that do not fit, the worst of each photo and of each chain."""
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
