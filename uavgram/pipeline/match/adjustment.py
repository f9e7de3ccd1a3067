"""Adjustment with the finds so far, fast enough for every round.

The picks and measurements by people are adjusted in full once, with the search for blunders and
causes. Observations left out there stay out; afterwards only poses and points are readjusted.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from uavgram.errors import GeometryError
from uavgram.estimation.reliability.redundancy import compute_reductions
from uavgram.estimation.solver.normal_equations import SingularError
from uavgram.estimation.survey.adjustment import (
    Adjustment,
    LeftOutCause,
    Refined,
    compute_heights_at,
)
from uavgram.estimation.survey.selection import select_control, select_lines, select_picks
from uavgram.model.arrays import Bools, Floats, Ints
from uavgram.model.observations import Picks
from uavgram.model.survey import Survey
from uavgram.pipeline.match.selection import append_matches, list_labels_without_height
from uavgram.pipeline.measure.compute import adjust_survey, assemble_survey
from uavgram.pipeline.measure.inputs import Inputs
from uavgram.pipeline.measure.pose import PosedFrames
from uavgram.stages.ground_consensus import UNKNOWN_SIGMA_M, find_ground_points
from uavgram.stages.match import CONTRADICTED, REGION_SQUARED, Found, Pair
from uavgram.stages.refine.first_values import cost_with_lost
from uavgram.stages.refine.minima import Participants, find_best_minima
from uavgram.stages.refine.off_ground import count_photos, set_free_heights
from uavgram.stages.refine.readjustment import readjust
from uavgram.stages.refine.tie_outliers import remove_wrong_ties
from uavgram.stages.refine.tied_frames import add_tied_frames

MIN_ROUGHNESS_M = 0.1
"""Least roughness of ground without a larger statement [m]: crown, gutter and kerb of a road."""

RAISED_M = 0.8, 1.0
"""Height of a point without any information, and its sigma [m], while only one photo shows it: from
the ground to the roof of a van."""

MIN_HEIGHT_M = 0.25
"""Least height of a point off the ground [m]: below, the find is taken for the ground behind its
edge."""

MIN_AGREEING_PHOTOS = 3
"""Photos that must agree on an unknown height: any two agree on one."""

BESIDE = "what looks like it is the ground beside it"
ALONE = "its height is not known, and too few photos show it to be sure"

TRIED_AGAIN = (LeftOutCause.UNDETERMINED, LeftOutCause.NOT_JOINED)
"""Causes of left-out picks that finds may bring back."""


WRONG_CHI_SQUARE = 25.0
"""Squared sigmas above which a match is wrong: chi-square with two degrees of freedom exceeds it
with a probability of 1 in 270,000."""

WRONG_RAISED_CHI_SQUARE = 9.2
"""Squared sigmas for points off the ground, whose sigma is wide: exceeded with a probability of 1
in a hundred."""

MAX_ROUNDS = 8
"""Largest number of rounds in which such matches are left out."""

MIN_SPREAD_FACTOR = 2.0
"""Factor of the matches' sigmas above which one of them may have spread its error over all."""

MAX_SPREAD_RATIO = 0.8
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
    unplaced
        Labels of unknown height that are not among those on the ground by consensus: they determine
        no pose.
    """

    adjustment: Adjustment
    kept: frozenset[Pair]
    factor: float
    worst: Pair | None
    out: frozenset[int]
    unplaced: frozenset[str]


class Adjusted(NamedTuple):
    """Adjustment with finds; contradicted ones, with the reason; and labels without a place.

    Labels without a place are those of unknown height which the consensus does not show on the
    ground.
    """

    adjustment: Adjustment
    contradicted: dict[Pair, str]
    unplaced: frozenset[str]


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
    contradictory
        Labels whose clicks contradict each other, without two that agree: no one knows which is
        wrong.
    """

    inputs: Inputs
    posed: PosedFrames
    keep: Bools
    refined: Refined
    contradictory: frozenset[str] = frozenset()

    def sources(self, adjustment: Adjustment) -> list[int]:
        """Return numbers of the project's picks by hand that take part in an adjustment."""
        survey, picks = adjustment.survey, self.inputs.picks
        frames, labels = survey.pick_frame.tolist(), survey.pick_label.tolist()
        there = {
            (survey.frame_id[frame], survey.label[label], *pixel)
            for frame, label, pixel in zip(frames, labels, survey.pixel_px.tolist(), strict=True)
            if survey.label[label] not in self.contradictory
        }
        by_hand = np.flatnonzero(picks.of_source("hand")).tolist()
        return [
            i
            for i in by_hand
            if (picks.image[i], picks.label[i], *picks.pixel_px[i].tolist()) in there
        ]

    def remove_unfit(self, asked: Bools) -> tuple[BaseAdjustment, Bools]:
        """Remove those of some earlier matches (P,) that no longer fit; also return their mask."""
        unfit = np.zeros(len(asked), dtype=np.bool_)
        if asked.any():
            unfit[list(self._try_finds({}).out)] = True
            unfit &= asked
        picks = self.inputs.picks.where(~unfit)
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

    def adjust_finds(self, found: Mapping[Pair, Found]) -> Adjusted:
        """Adjust with the finds.

        A find with a large error spreads it over few others, so that none is an outlier: a find
        without which all others fit much better is contradicted too.
        """
        tried = self._try_finds(found)
        while tried.factor > MIN_SPREAD_FACTOR and tried.worst is not None:
            kept = tried.kept - {tried.worst}
            rest = self._try_finds({pair: one for pair, one in found.items() if pair in kept})
            if rest.factor**2 > MAX_SPREAD_RATIO * tried.factor**2:
                break
            tried = rest
        wrong = dict.fromkeys(sorted(frozenset(found) - tried.kept), CONTRADICTED)
        return Adjusted(tried.adjustment, wrong | self._list_unsure(tried), tried.unplaced)

    def _list_unsure(self, tried: _Trial) -> dict[Pair, str]:
        """Return finds of points of unknown height that are, or may be, the ground behind an edge.

        Any two photos agree on some height; only a third one confirms that it is one
        object.
        """
        picks, survey = self.inputs.picks, tried.adjustment.survey
        free = {picks.label[i] for i in np.flatnonzero(picks.is_free).tolist()}
        height = compute_heights_at(tried.adjustment, tried.adjustment.state)
        photos = count_photos(survey)
        alone = {
            name
            for name, count in zip(survey.label, photos, strict=True)
            if count < MIN_AGREEING_PHOTOS
        }
        low = {survey.label[k] for k in np.flatnonzero(np.abs(height) < MIN_HEIGHT_M)}
        return {
            pair: ALONE if pair[1] in alone else BESIDE
            for pair in sorted(tried.kept)
            if pair[1] in free & (alone | low)
        }

    def _try_finds(self, found: Mapping[Pair, Found]) -> _Trial:
        """Adjust with some finds, without outliers."""
        picks = append_matches(self.inputs.picks, found)
        survey = assemble_survey(replace(self.inputs, picks=picks), self.posed).survey
        survey = self._prepare(survey)
        sound = remove_wrong_ties(survey)
        out = set(sound.matches_left_out)
        # Points of unknown height determine poses only where they are on the ground by consensus.
        survey = replace(sound.survey, is_free=survey.is_free)
        unplaced = self._find_unplaced(survey)
        is_unplaced = np.isin(survey.label, sorted(unplaced))
        keep = self.keep & ~_mark_repeated(survey, is_unplaced)
        label = survey.pick_label[survey.matches.pick][survey.matches.point]
        matches = survey.matches.remove(is_unplaced[label])[0]
        survey = replace(survey, matches=matches, is_free=survey.is_free & ~is_unplaced)
        adjustment = self._best(survey, keep)
        for _ in range(MAX_ROUNDS):  # now the ground and known heights take part
            wrong = _find_misfits(adjustment, picks)
            if not wrong:
                break
            out |= wrong
            gone = np.isin(survey.matches.row, list(wrong)) & _is_found(survey, picks)
            survey = replace(survey, matches=survey.matches.remove(gone)[0])
            adjustment = self._best(survey, keep)
        factor = max((one.factor for one in sound.noise if one.source == "match"), default=0.0)
        worst = _worst(adjustment, picks) if factor > MIN_SPREAD_FACTOR else None
        gone_pairs = {(picks.image[i], picks.label[i]) for i in out}
        denied = _find_denied_labels(adjustment)
        rest = {pair: one for pair, one in found.items() if pair[1] not in denied}
        if len(rest) < len(found):
            return self._try_finds(rest)
        kept = frozenset(found) - gone_pairs
        return _Trial(adjustment, kept, factor, worst, frozenset(out), unplaced)

    def _find_unplaced(self, survey: Survey) -> frozenset[str]:
        """Return labels of unknown height in several photos that are not on the ground.

        Where a label has finds, they show its height, and its clicks in other photos may not agree:
        what was found may be the ground behind it.
        """
        refined = self.refined
        known, poses = refined.known_removed, refined.pose_widened
        own = np.zeros(len(survey.pick_label), dtype=np.bool_)
        own[survey.matches.pick] = True
        is_found = np.isin(survey.pick_label, survey.pick_label[survey.matches.pick])
        keep = self.keep & (own | ~is_found)
        taking = Participants(survey, keep, refined.line_removed, {}, known, poses)
        return find_unplaced(taking, find_blank_labels(self.inputs.picks))

    def _best(self, survey: Survey, keep: Bools) -> Adjustment:
        """Return the best adjustment with some picks (P,), without what the full one left out."""
        refined = self.refined
        known, poses = refined.known_removed, refined.pose_widened
        taking = Participants(survey, keep, refined.line_removed, {}, known, poses)
        return find_best_minima(taking).adjustment

    def _prepare(self, survey: Survey) -> Survey:
        """Set first poses and heights of the full adjustment, and ground that may be uneven."""
        refined = self.refined
        survey = set_free_heights(survey, sorted(refined.off_ground))
        rough = tuple(
            replace(ground, roughness_sigma_m=max(ground.roughness_sigma_m, MIN_ROUGHNESS_M))
            for ground in survey.grounds
        )
        alone = survey.is_free & (count_photos(survey) < 2)
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
    picks = _mark_manual(inputs.picks)
    survey = assemble_survey(replace(inputs, picks=picks), posed).survey
    every, none = (
        np.ones(len(survey.pick_frame), np.bool_),
        np.zeros(len(survey.line_start), np.bool_),
    )
    tied = add_tied_frames(survey)[0]
    taking, blank = Participants(tied, every, none, {}), find_blank_labels(picks)
    sound = mark_sound_clicks(taking, blank)
    unplaced = find_unplaced(replace(taking, keep=sound), blank)
    free = _set_unknown_heights(survey, np.isin(survey.label, sorted(unplaced)))
    # Of two clicks that contradict each other, lengths and known points show the wrong one.
    unclear, measured = _mark_unclear(survey, sound), _mark_measured(survey)
    taken = sound | (unclear & measured)[survey.pick_label]
    refined, _ = adjust_survey(
        free if taken.all() else select_picks(free, taken).survey, inputs.project.solve
    )
    rows, fits = np.flatnonzero(taken), taken.copy()
    fits[rows[np.flatnonzero(refined.pick_removed)]] = False
    keep = fits.copy()
    for i, why in refined.pick_reason.items():
        fits[rows[i]] &= why.cause is not LeftOutCause.GROSS
        keep[rows[i]] &= why.cause in TRIED_AGAIN
    unclear = _mark_unclear(survey, fits) & ~measured
    contradictory = frozenset(np.array(survey.label)[unclear].tolist())
    return BaseAdjustment(inputs, posed, keep, refined, contradictory)


def _mark_unclear(survey: Survey, sound: Bools) -> Bools:
    """Mark labels (K,) with a wrong click and without two sound ones (P,) that agree."""
    agreeing = np.bincount(survey.pick_label[sound], minlength=len(survey.label))
    wrong = np.bincount(survey.pick_label[~sound], minlength=len(survey.label))
    return np.asarray((wrong > 0) & (agreeing < 2))


def _mark_measured(survey: Survey) -> Bools:
    """Mark labels (K,) of control points, and those of known lengths or other quantities."""
    known = [one.label for one in survey.known]
    some = np.concatenate([survey.control_label, survey.line_start, survey.line_end, *known])
    return np.isin(np.arange(len(survey.label)), some)


def find_blank_labels(picks: Picks) -> frozenset[str]:
    """Return labels whose height is neither stated nor free."""
    return frozenset(list_labels_without_height(picks, zip(picks.image, picks.label, strict=True)))


def mark_sound_clicks(taking: Participants, blank: Collection[str]) -> Bools:
    """Mark clicks (P,) that the other clicks do not contradict, at any height of their labels.

    Lengths and known points take no part, as one of them may be wrong as well. Where the clicks
    alone determine no poses, none is contradicted.

    Parameters
    ----------
    taking
        Participating observations.
    blank
        Labels of unknown height.
    """
    survey = _set_unknown_heights(taking.survey, _mark_unsure(taking, blank))
    survey = select_lines(survey, np.zeros(len(survey.line_start), np.bool_))
    survey = select_control(survey, np.zeros(len(survey.control_label), np.bool_))
    survey = replace(survey, known=())
    alone = replace(taking, survey=survey, line_removed=np.zeros(0, np.bool_))
    keep = taking.keep.copy()
    with suppress(GeometryError):
        for _ in range(MAX_ROUNDS):
            refined = find_best_minima(replace(alone, keep=keep))
            adjustment = refined.adjustment
            block, seen = adjustment.minimum.blocks["pixels"], adjustment.survey
            misfit = compute_reductions(block, adjustment.covariance)
            wrong = _mark_worst(misfit, WRONG_CHI_SQUARE, (seen.pick_frame, seen.pick_label))
            if not wrong.any():
                break
            keep[refined.pick_index[wrong]] = False
    return keep


def _mark_unsure(taking: Participants, blank: Collection[str]) -> Bools:
    """Mark labels (K,) of unknown height that several photos show."""
    seen = select_picks(taking.survey, taking.keep).survey
    shown = {name for name, count in zip(seen.label, count_photos(seen), strict=True) if count > 1}
    return np.isin(taking.survey.label, sorted(shown & set(blank)))


def find_unplaced(taking: Participants, blank: Collection[str]) -> frozenset[str]:
    """Return labels of unknown height in several photos that are not on the ground by consensus.

    None where only they determine the poses.

    Parameters
    ----------
    taking
        Participating observations.
    blank
        Labels of unknown height.
    """
    survey = taking.survey
    unsure = _mark_unsure(taking, blank)
    if not unsure.any():
        return frozenset()
    try:
        adjustment = _adjust_heights(taking, unsure)
    except GeometryError:
        return frozenset()
    labels = adjustment.label_rows([survey.label[k] for k in np.flatnonzero(unsure)])
    if (labels < 0).any():
        return frozenset()
    # Joint distribution of the heights.
    columns = adjustment.problem.layout.point_columns(labels)[:, 2]
    some = np.zeros((adjustment.problem.layout.size, len(labels)))
    some[columns, np.arange(len(labels))] = 1.0
    spread = adjustment.minimum.factor.solve(some)[columns]
    height = compute_heights_at(adjustment, adjustment.state)[labels]
    uneven = [max(ground.roughness_sigma_m, MIN_ROUGHNESS_M) for ground in survey.grounds]
    on_ground = find_ground_points(height, spread, np.array(uneven)[survey.area[unsure]])
    return frozenset(survey.label[k] for k in np.flatnonzero(unsure)[~on_ground])


def _adjust_heights(taking: Participants, unsure: Bools) -> Adjustment:
    """Adjust with unknown heights of some labels (K,), from the ground where that fits better.

    With many unknown heights, first values may lead to a minimum far from all points.

    Raises
    ------
    GeometryError
        The other observations do not determine the survey.
    """
    wide = find_best_minima(replace(taking, survey=_set_unknown_heights(taking.survey, unsure)))
    with suppress(GeometryError, SingularError):
        flat = find_best_minima(taking)
        names = [taking.survey.label[k] for k in np.flatnonzero(unsure)]
        rows = np.isin(flat.adjustment.survey.label, names)
        raised = _set_unknown_heights(flat.adjustment.survey, rows)
        other = replace(flat, adjustment=readjust(flat.adjustment, raised))
        # Far from all points, some picks find no place: each counts as a poor fit.
        cost, before = (cost_with_lost(one, int(taking.keep.sum())) for one in (other, wide))
        if other.adjustment.minimum.converged and cost < before:
            return other.adjustment
    return wide.adjustment


def _set_unknown_heights(survey: Survey, labels: Bools) -> Survey:
    """Make the heights of some labels (K,) unknown."""
    return replace(survey, height_sigma_m=np.where(labels, UNKNOWN_SIGMA_M, survey.height_sigma_m))


def _mark_repeated(survey: Survey, labels: Bools) -> Bools:
    """Mark picks (P,) of some labels (K,) in other photos than that of their first one."""
    first = np.full(len(survey.label), -1)
    first[survey.pick_label[::-1]] = survey.pick_frame[::-1]
    other = survey.pick_frame != first[survey.pick_label]
    return np.asarray(other & labels[survey.pick_label])


def _mark_manual(picks: Picks) -> Picks:
    return picks.where(~picks.of_source("match"))


def _is_found(survey: Survey, picks: Picks) -> Bools:
    """Mark sightings (N,) of chains that are matches, not the picked pixels of their beginning."""
    return np.asarray(picks.of_source("match")[survey.matches.row])


def _misfits(adjustment: Adjustment, picks: Picks) -> Floats:
    """Compute squared misfits (N,) of matches in sigmas; -1 for picked pixels."""
    survey = adjustment.survey
    fall = compute_reductions(adjustment.minimum.blocks["matches"], adjustment.covariance)
    return np.where(_is_found(survey, picks), fall, -1.0)


def _find_denied_labels(adjustment: Adjustment) -> set[str]:
    """Return labels whose finds a click contradicts, such as finds of the ground behind an edge."""
    survey, block = adjustment.survey, adjustment.minimum.blocks.get("pixels")
    if block is None or not survey.matches.points:
        return set()
    misfit = compute_reductions(block, adjustment.covariance)
    matched = np.zeros(len(survey.label), dtype=np.bool_)
    matched[survey.pick_label[survey.matches.pick]] = True
    denied = matched[survey.pick_label] & (misfit > REGION_SQUARED)
    return {survey.label[k] for k in survey.pick_label[denied].tolist()}


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
    most = np.where(survey.off_ground[label], WRONG_RAISED_CHI_SQUARE, WRONG_CHI_SQUARE)
    wrong = _mark_worst(misfit, most, (sightings.frame, sightings.point))
    return set(sightings.row[wrong].tolist())


def _mark_worst(misfit: Floats, most: Floats | float, groups: tuple[Ints, ...]) -> Bools:
    """Mark misfits (n,) above limits that are the largest of each of their groups."""
    wrong = misfit > most
    for group in groups:
        worst = np.zeros(int(group.max()) + 1)
        np.maximum.at(worst, group, misfit)
        wrong &= misfit >= worst[group]
    return np.asarray(wrong)
