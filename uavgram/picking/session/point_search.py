"""Background search for picked points and targets in the other photos.

New picks are searched at once with the last adjustment. As soon as their own adjustment exists, all
picks are searched from the beginning, without results of earlier states: so the proposals depend on
the picks and lengths alone, not on the order in which they were entered.

Matches are proposed, never picked: a person decides. A match carries the click's error along; where
a person picked the centre of a target, that centre is measured in the other photos instead.
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Collection, Iterator
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from uavgram.errors import InputError, UavgramError
from uavgram.estimation.solver.normal_equations import SingularError
from uavgram.imaging.matching.least_squares import REASON_TEXTS, RefusalReason
from uavgram.imaging.matching.match import compute_worst_quarter_correlation
from uavgram.imaging.photos.cache import GreyPhotos
from uavgram.imaging.targets.uncoded import UncodedTarget
from uavgram.model.arrays import Floats, Ints
from uavgram.model.observations import Picks
from uavgram.model.work import report_work
from uavgram.picking.document import commands as c
from uavgram.picking.document.proposals import Outcome, Pair, source_of
from uavgram.picking.document.state import State, make_observations
from uavgram.picking.session.proposal_table import ProposalTable
from uavgram.picking.session.workers import LatestTask, StoppedError, WatchedWork
from uavgram.pipeline.match.height_evidence import collect_height_evidence
from uavgram.pipeline.match.places_by_features import FeaturePlaces
from uavgram.pipeline.match.search import search_places
from uavgram.pipeline.pick.live_survey import LiveAdjustment, LiveSurvey
from uavgram.pipeline.pick.places import predict_places
from uavgram.pipeline.targets import make_pick_row, recognise_picked, recognise_same
from uavgram.stages.match import (
    CONTRADICTED,
    MAX_RADIUS_PX,
    NARROWED_SHARE,
    Candidates,
    Found,
    Missed,
    Record,
    find_raised_labels,
)

log = logging.getLogger(__name__)

MIN_CORRELATION = 0.8
"""Least correlation, as in the matching, of a match's and its pick's surroundings to be alike."""

OFF_GROUND = "the point is probably not on the ground: pick it by hand, or state its height"

BATCH_SIZE = 64
"""Number of places searched between two reports."""


@dataclass(frozen=True)
class SearchInput:
    """Present picks, the last full adjustment, whether it is theirs, and the state's number.

    A picked state that cannot be adjusted has none.
    """

    state: State
    last: LiveAdjustment | None
    is_adjusted: bool
    version: int = 0

    @property
    def observed(self) -> tuple[object, ...]:
        """Picks and lengths, on which the proposals depend."""
        return self.state.picks, self.state.lines


class PointSearch(LatestTask[SearchInput]):
    """Worker that searches for picked points in the other photos.

    Parameters
    ----------
    survey
        The project.
    photos
        Grey pixels.
    proposed
        Receiver of the results.
    watched
        Shows the search, and stops it.
    """

    def __init__(
        self,
        survey: LiveSurvey,
        photos: GreyPhotos,
        proposed: ProposalTable,
        watched: WatchedWork,
    ) -> None:
        super().__init__({"seeker": self._work})
        self._survey, self._photos, self.proposed = survey, photos, proposed
        self.watched = watched
        self._targets = PickedTargets(survey, photos)
        self._features = FeaturePlaces(survey.inputs)
        self._known: frozenset[tuple[str, str, float, float]] = frozenset()
        # Picks, lengths and outcomes of the last finished search.
        self._finished: tuple[object, ...] = ()
        self._stopped: tuple[object, ...] = ()  # picks and lengths of the last one that was stopped
        self._outcomes: dict[Pair, Outcome] = {}  # of the present search
        self._shown: frozenset[Pair] = frozenset()  # with an outcome before it

    def is_outdated(self, task: SearchInput) -> bool:
        """Return whether there are newer picks or lengths, or their own adjustment, or the end."""
        newest = self.task or task
        is_newer = newest.observed != task.observed or newest.is_adjusted > task.is_adjusted
        return is_newer or self.is_over

    def _work(self) -> None:
        wanted: SearchInput | None = None
        while (wanted := self.newer(wanted)) is not None:
            try:
                self.watched.run(partial(self._seek, wanted), partial(self.is_outdated, wanted))
            except StoppedError:  # for a newer state
                continue
            except c.RefusedError:  # by a person: until the next change
                self._stopped = wanted.observed
            except Exception:  # a bug here must not end the worker: picking goes on
                log.exception("the search in other photos failed")
            if wanted.is_adjusted or wanted.observed == self._stopped:
                self.proposed.put({}, searched=wanted.version)

    def _seek(self, wanted: SearchInput) -> None:
        """Search for picks in the other photos."""
        self.proposed.let_go(wanted.state)
        before = self.proposed.outcomes
        self._shown = frozenset(before)
        picked = {pick.key for pick in wanted.state.picks}  # a person may still take the find
        self._outcomes = {k: one for k, one in before.items() if one.is_fixed or k in picked}
        if wanted.observed == self._stopped or (*wanted.observed, before) == self._finished:
            return
        if wanted.last is None and not wanted.is_adjusted and self._survey.flight() is not None:
            return  # nothing predicts a place yet
        picks, _ = make_observations(wanted.state)
        own = {(one.label, *source_of(one)) for one in wanted.state.picks if one.source != "match"}
        new = {label for label, *_ in own - self._known}
        self._seek_everywhere(wanted, picks, None if wanted.is_adjusted else new)
        self._known = frozenset(own)
        if wanted.is_adjusted:
            gone = [pair for pair in before if pair not in self._outcomes]
            self.proposed.put(self._outcomes, gone=gone)
            self._finished = *wanted.observed, self._outcomes

    def _seek_everywhere(
        self, wanted: SearchInput, picks: Picks, labels: Collection[str] | None
    ) -> None:
        """Search some labels, or all, in all other photos.

        First where poses predict the picks, then in photos whose pose is unknown or vague.
        """
        last, by_log = wanted.last, self._survey.flight() is not None
        if last is None and by_log:
            return
        sharp, vague = set[str](), set[str]()
        places = None if last is None else predict_places(self._survey, last, picks, labels)
        if last is not None and places is not None:
            self._seek_by_poses(wanted, places, picks)
            vague = self._find_vague_photos(places)
            sharp = {*last.adjustment.survey.frame_id, *(image for image, _ in places.pair)} - vague

        def is_vague(pair: Pair) -> bool:
            return (pair[0] in vague or not (by_log or pair[0] in sharp)) and (
                labels is None or pair[1] in labels
            )

        self._seek_by_features(wanted, picks, is_vague)
        if last is not None:
            self._seek_by_finds(wanted, last, picks, labels, is_vague)

    def _seek_by_poses(self, wanted: SearchInput, places: Candidates, picks: Picks) -> None:
        """Search where an adjustment predicts picks."""
        self._look(places, wanted, picks)
        self._withdraw(places)
        self._withdraw_raised(places, picks)

    def _find_vague_photos(self, places: Candidates) -> set[str]:
        """Return photos with a large region in which nothing was found as predicted."""
        outcomes = self._outcomes
        large, found = set[str](), set[str]()
        for row, pair in enumerate(places.pair):
            if places.radius_px[row] > MAX_RADIUS_PX:
                large.add(pair[0])
            one = outcomes.get(pair)
            if one is not None and one.found is not None and _is_judged(one, places, row):
                found.add(pair[0])
        return large - found

    def _seek_by_features(
        self, wanted: SearchInput, picks: Picks, is_vague: Callable[[Pair], bool]
    ) -> None:
        """Search where features predict picks."""
        outcomes = self._outcomes

        def is_wanted(pair: Pair) -> bool:
            return is_vague(pair) and (pair not in outcomes or outcomes[pair].found is None)

        for places in self._features.predict(picks, is_wanted):
            self._look(places, wanted, picks)

    def _seek_by_finds(
        self,
        wanted: SearchInput,
        last: LiveAdjustment,
        picks: Picks,
        labels: Collection[str] | None,
        is_vague: Callable[[Pair], bool],
    ) -> None:
        """Test finds in photos without a good pose by an adjustment, and search what it predicts.

        With these finds the photos have a pose.
        """
        observed = last.observed.picks
        keys = zip(observed.label, observed.image, *observed.pixel_px.T.tolist(), strict=True)
        number = {key: i for i, key in enumerate(keys)}
        picked = {pick.key for pick in wanted.state.picks}
        outcomes = self._outcomes
        found = {
            pair: _as_find(number[pair[1], *one.source], one.found, one.radius_px)
            for pair, one in sorted(outcomes.items())  # the order of their search varies
            if one.found is not None
            and one.source is not None
            and pair not in picked
            and (pair[1], *one.source) in number
        }
        if not any(map(is_vague, found)):
            return
        try:
            adjusted, contradicted = self._survey.adjust_with_finds(last, found)
        except (SingularError, UavgramError):  # they do not determine the poses
            return
        for pair, why in contradicted.items():
            outcomes[pair] = replace(outcomes[pair], found=None, why=why)
        places = predict_places(self._survey, adjusted, picks, labels)
        if places is not None:
            self._seek_by_poses(wanted, places, picks)

    def _look(self, places: Candidates, wanted: SearchInput, picks: Picks) -> None:
        """Search unknown places."""
        rows, done = self._unknown(places, wanted.state), 0
        for some in self._batches(places, rows):
            report_work(f"look in other photos: {done} of {len(rows)} places")
            self._take(places, some, picks)
            done += len(some)
        report_work()

    def _withdraw(self, places: Candidates) -> None:
        """Withdraw proposals that other matches in the same photo contradict."""
        at = {pair: row for row, pair in enumerate(places.pair)}
        outcomes, found = self._outcomes, dict[int, Found]()
        for pair, one in outcomes.items():
            if one.found is None or one.source is None or pair not in at:
                continue
            if _is_judged(one, places, at[pair]):
                found[at[pair]] = _as_find(int(places.pick[at[pair]]), one.found, one.radius_px)
        for pair in places.list_contradicted(found):
            outcomes[pair] = replace(outcomes[pair], found=None, why=CONTRADICTED)

    def _withdraw_raised(self, places: Candidates, picks: Picks) -> None:
        """Withdraw proposals on the ground of labels that are more likely off it.

        They remain evidence, and are proposed again once they show the label on the ground.
        """
        outcomes = self._outcomes
        keys = zip(picks.label, picks.image, *picks.pixel_px.T.tolist(), strict=True)
        number = {key: i for i, key in enumerate(keys)}
        picked = set(zip(picks.image, picks.label, strict=True))
        results: dict[Pair, Found | Missed] = {}
        for pair, one in outcomes.items():
            if one.source is None or pair in picked:
                continue
            pick = number.get((pair[1], *one.source))
            place = one.found or one.withdrawn
            if pick is not None and place is not None:
                results[pair] = _as_find(pick, place, one.radius_px)
            elif pick is not None:
                results[pair] = Missed(pick, one.radius_px, one.why)
        record = Record().add_results(results)
        raised = self._find_raised_labels(places, picks, record)
        for pair in record.found:
            one = outcomes[pair]
            if pair[1] in raised and one.found is not None:
                outcomes[pair] = replace(one, found=None, why=OFF_GROUND, withdrawn=one.found)
            elif pair[1] not in raised and one.withdrawn is not None:
                outcomes[pair] = replace(one, found=one.withdrawn, why="", withdrawn=None)

    def _find_raised_labels(self, places: Candidates, picks: Picks, record: Record) -> set[str]:
        """Find labels without a height that are more likely off the ground than on it."""
        if places.adjustment is None:
            return set()
        sigma_px = self._survey.inputs.project.picks_sigma_px
        evidence = collect_height_evidence(places.adjustment, picks, places, record, sigma_px)
        return find_raised_labels(evidence)

    def _unknown(self, places: Candidates, state: State) -> Ints:
        """Return the rows (n,) of places to search, the best predicted first."""
        picked = {pick.key for pick in state.picks}
        outcomes, rows = self._outcomes, []
        for row, pair in enumerate(places.pair):
            if pair not in picked and _is_open(outcomes.get(pair), places, row):
                rows.append(row)
        order = np.argsort(places.radius_px[rows], kind="stable")
        return np.array(rows, dtype=np.int64)[order]

    def _batches(self, places: Candidates, rows: Ints) -> Iterator[Ints]:
        """Yield the places in decoded photos; then the others, photo by photo."""
        ready = np.array([self._photos.photos.has(places.pair[row][0]) for row in rows], np.bool_)
        for first in range(0, int(ready.sum()), BATCH_SIZE):
            yield rows[ready][first : first + BATCH_SIZE]
        later: dict[str, list[int]] = {}
        for row in rows[~ready].tolist():
            later.setdefault(places.pair[row][0], []).append(row)
        for own in later.values():
            yield np.array(own, dtype=np.int64)

    def _search_places(
        self, places: Candidates, rows: Ints, picks: Picks
    ) -> dict[Pair, Found | Missed]:
        """Return the results at some places; those in photos that cannot be read are missed."""
        try:
            return search_places(self._photos.photos, places, rows, picks)
        except InputError as why:
            log.warning("not sought: %s", why)
            text = f"the photo cannot be read: {why}"
            return {
                places.pair[row]: Missed(int(places.pick[row]), float(places.radius_px[row]), text)
                for row in rows.tolist()
            }

    def _take(self, places: Candidates, rows: Ints, picks: Picks) -> None:
        """Search some places (n,) for picks; store and report the results."""
        new = {}
        found = self._search_places(places, rows, picks)
        for row, (pair, one) in zip(rows.tolist(), found.items(), strict=True):
            (u, v), at = picks.pixel_px[one.pick].tolist(), picks.image[one.pick]
            outcome = Outcome(source=(at, u, v), radius_px=one.radius_px)
            if isinstance(one, Missed):
                asked = one.why != REASON_TEXTS[RefusalReason.OUTSIDE]
                new[pair] = replace(outcome, why=one.why, is_asked=asked)
            else:
                place = c.Place(
                    image=pair[0],
                    label=pair[1],
                    u_px=one.pixel_px[0],
                    v_px=one.pixel_px[1],
                    sigma_px=one.sigma_px,
                    source="match",
                    score=one.score,
                    from_image=at,
                    from_u_px=u,
                    from_v_px=v,
                )
                turn = places.places.affine[row]
                alike = self._likeness(place, turn) >= MIN_CORRELATION
                own = self._targets.target_at(place, turn)
                new[pair] = replace(outcome, found=own, is_alike=alike)
        self._outcomes |= new
        self.proposed.put({pair: one for pair, one in new.items() if pair not in self._shown})

    def _likeness(self, place: c.Place, affine: Floats) -> float:
        """Return the worst correlation of the surroundings of a match and its pick, -1 to 1."""
        source, target = map(self._photos.photos.get, (place.from_image, place.image))
        at = np.array([place.from_u_px, place.from_v_px], dtype=np.float64)
        return compute_worst_quarter_correlation(
            source, target, at, np.array([place.u_px, place.v_px]), affine
        )


def _as_find(pick: int, place: c.Place, radius_px: float) -> Found:
    """Convert a proposal, found from the pick of that number, to the input of an adjustment."""
    pixel = place.u_px, place.v_px
    return Found(pick, pixel, place.sigma_px or np.nan, place.score or np.nan, radius_px)


def _is_open(outcome: Outcome | None, places: Candidates, row: int) -> bool:
    """Return whether to search a place: for the first time, or since it is far better predicted."""
    if outcome is None:
        return True
    if outcome.is_fixed:
        return False
    if outcome.found is not None:
        here = outcome.found.u_px, outcome.found.v_px
        return _is_judged(outcome, places, row) and not places.holds(row, here)
    return bool(places.radius_px[row] < NARROWED_SHARE * outcome.radius_px)


def _is_judged(outcome: Outcome, places: Candidates, row: int) -> bool:
    """Return whether a place is predicted at least as well as what was found there before."""
    return bool(places.radius_px[row] <= outcome.radius_px)


class PickedTargets:
    """Targets at picks, and their centres at matches of those picks.

    Parameters
    ----------
    survey
        The project.
    photos
        Grey pixels.
    """

    def __init__(self, survey: LiveSurvey, photos: GreyPhotos) -> None:
        self._survey, self._photos = survey, photos
        self._known: dict[tuple[Pair, float, float], UncodedTarget | None] = {}

    def target_at(self, match: c.Place, affine: Floats) -> c.Place:
        """Return the target's centre if the pick is on a target that is clear at the match too.

        Otherwise return the match.

        Parameters
        ----------
        match
            Match, with the pick that it was found from.
        affine
            (2, 2) d pixel there / d pixel of the pick.
        """
        own = self._at_pick(match)
        if own is None:
            return match
        # map the offset from click to centre into the other photo: p' = p_match + A d
        aside = own.pixel_px - [match.from_u_px, match.from_v_px]
        place = np.array([match.u_px, match.v_px]) + affine @ aside
        photo = self._photos.photos.get(match.image)
        there = recognise_same(photo, own.kind, place, match.sigma_px or 0.0)
        if there is None:
            return match
        focal = float(self._survey.inputs.calibration.parameters[0])
        row = make_pick_row(match.image, match.label, there, focal)
        return c.Place(**vars(row), source="target")

    def _at_pick(self, match: c.Place) -> UncodedTarget | None:
        """Return the target at the source pick of a match; each pick is searched once."""
        u, v = match.from_u_px or 0.0, match.from_v_px or 0.0
        key = (match.from_image, match.label), u, v
        if key not in self._known:
            photo = self._photos.photos.get(match.from_image)
            self._known[key] = recognise_picked(photo, match.label, np.array([u, v]), np.nan)
        return self._known[key]
