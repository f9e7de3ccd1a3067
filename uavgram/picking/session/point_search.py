"""Background search for picked points in the other photos, newest picks first.

Matches are proposed, never picked: a person decides.
"""

from __future__ import annotations

import logging
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from uavgram.errors import InputError
from uavgram.imaging.matching.matches import Matches, RefusalReason
from uavgram.imaging.matching.occlusion import compute_worst_quarter_correlation
from uavgram.imaging.photos.grey_photos import GreyPhotos
from uavgram.model.arrays import Bools, Floats, Ints
from uavgram.model.survey.observations import Picks
from uavgram.picking.document import commands as c
from uavgram.picking.document.proposals import Outcome, Pair, source_of
from uavgram.picking.document.state import State, make_observations
from uavgram.picking.session.latest_task import LatestTask
from uavgram.picking.session.picked_targets import PickedTargets
from uavgram.picking.session.proposal_table import ProposalTable
from uavgram.pipeline.match.patch_search import describe_miss, group_by_photos, search_places
from uavgram.pipeline.pick.live_survey import LiveAdjustment, LiveSurvey
from uavgram.pipeline.pick.places import PredictedPlaces, predict_places
from uavgram.stages.match import CONTRADICTED, NARROWED_SHARE, pick_sigmas

log = logging.getLogger(__name__)

ALIKE = 0.8
"""Least correlation, as in the matching, of a match's and its pick's surroundings to be alike."""

AT_ONCE = 64
"""Number of places searched between two reports."""


@dataclass(frozen=True)
class SearchInput:
    """Present picks, and the last full adjustment, if there is one."""

    state: State
    last: LiveAdjustment | None


class PointSearch:
    """Worker that searches for picked points in the other photos.

    Parameters
    ----------
    survey
        The project.
    photos
        Grey pixels.
    proposed
        Receiver of the results.
    """

    def __init__(self, survey: LiveSurvey, photos: GreyPhotos, proposed: ProposalTable) -> None:
        self._survey, self._photos, self.proposed = survey, photos, proposed
        self._targets = PickedTargets(survey, photos)
        self._newest: LatestTask[SearchInput] = LatestTask({"seeker": self._work})
        self._known: frozenset[tuple[str, str, float, float]] = frozenset()

    def start(self) -> None:
        """Start the worker."""
        self._newest.start()

    def submit(self, wanted: SearchInput) -> None:
        """Search for these picks; the search for older ones is abandoned."""
        self._newest.submit(wanted)

    def stop(self) -> None:
        """End after the current photo."""
        self._newest.stop()

    def _work(self) -> None:
        wanted: SearchInput | None = None
        while (wanted := self._newest.newer(wanted)) is not None:
            try:
                self._seek(wanted)
            except Exception:  # a bug here must not end the worker: picking goes on
                log.exception("the search in other photos failed")

    def _seek(self, wanted: SearchInput) -> None:
        state, last = wanted.state, wanted.last
        self.proposed.let_go(state)
        if last is None:
            return
        picks, _ = make_observations(state)
        own = {(one.label, *source_of(one)) for one in state.picks if one.source != "match"}
        new = {label for label, *_ in own - self._known}
        for labels in [new, None] if new else [None]:
            places = predict_places(self._survey, last, picks, labels)
            if places is None or not self._look(places, wanted, picks):
                return
            self._withdraw(places)
        self._known = frozenset(own)

    def _look(self, places: PredictedPlaces, wanted: SearchInput, picks: Picks) -> bool:
        """Search unknown places; return False if newer work arrived before the end."""
        rows = self._unknown(places, wanted.state)
        left = len(rows)
        for some in self._batches(places, rows):
            if self._newest.is_outdated(wanted):
                return False
            left -= len(some)
            self._take(places, some, picks, self._looked(places, some, picks), left)
        return not self._newest.is_outdated(wanted)

    def _withdraw(self, places: PredictedPlaces) -> None:
        """Withdraw proposals that other matches in the same photo contradict."""
        at = {pair: k for k, pair in enumerate(zip(places.image, places.label, strict=True))}
        by_photo: dict[str, dict[Pair, c.Place]] = {}
        outcomes = self.proposed.outcomes
        for pair, one in outcomes.items():
            if one.found is not None and one.source is not None and pair in at:
                by_photo.setdefault(pair[0], {})[pair] = one.found
        wrong: list[Pair] = []
        for own in by_photo.values():
            pixel = np.array([(one.u_px, one.v_px) for one in own.values()])
            sigma = np.array([one.sigma_px for one in own.values()], dtype=np.float64)
            out = places.mark_contradicted(np.array([at[pair] for pair in own]), pixel, sigma)
            wrong += [pair for pair, is_out in zip(own, out, strict=True) if is_out]
        self.proposed.put(
            {pair: replace(outcomes[pair], found=None, why=CONTRADICTED) for pair in wrong}
        )

    def _unknown(self, places: PredictedPlaces, state: State) -> Ints:
        """Return the rows (n,) of places to search, the best predicted first."""
        picked = {pick.key for pick in state.picks}
        outcomes, rows = self.proposed.outcomes, []
        for row, pair in enumerate(zip(places.image, places.label, strict=True)):
            if pair not in picked and _is_open(outcomes.get(pair), places, row):
                rows.append(row)
        order = np.argsort(places.radius_px[rows], kind="stable")
        return np.array(rows, dtype=np.int64)[order]

    def _batches(self, places: PredictedPlaces, rows: Ints) -> Iterator[Ints]:
        """Yield the places in decoded photos; then the others, photo by photo."""
        ready = np.array([self._photos.photos.has(places.image[row]) for row in rows], np.bool_)
        for first in range(0, int(ready.sum()), AT_ONCE):
            yield rows[ready][first : first + AT_ONCE]
        later: dict[str, list[int]] = {}
        for row in rows[~ready].tolist():
            later.setdefault(places.image[row], []).append(row)
        for own in later.values():
            yield np.array(own, dtype=np.int64)

    def _looked(self, places: PredictedPlaces, rows: Ints, picks: Picks) -> Matches | str:
        """Return the matches at some places, or the reason if a photo cannot be read."""
        source = [picks.image[i] for i in places.pick[rows]]
        target = [places.image[row] for row in rows]
        work = group_by_photos(source, target, places.sought(picks, rows))
        try:
            return search_places(self._photos.photos, work, len(rows))
        except InputError as why:
            log.warning("not sought: %s", why)
            return f"the photo cannot be read: {why}"

    def _take(
        self, places: PredictedPlaces, rows: Ints, picks: Picks, found: Matches | str, left: int
    ) -> None:
        """Store and report the results at some places (n,).

        Parameters
        ----------
        places, rows
            Searched places.
        picks
            Picks that were searched for.
        found
            Matches there, or the reason why none could be searched.
        left
            Number of places still to be searched.
        """
        new, stated = {}, _stated(found, places.is_raised[rows])
        for k, row in enumerate(rows.tolist()):
            i, image, label = int(places.pick[row]), places.image[row], places.label[row]
            (u, v), at = picks.pixel_px[i].tolist(), picks.image[i]
            outcome = Outcome(source=(at, u, v), radius_px=float(places.radius_px[row]))
            if isinstance(found, str):
                new[image, label] = replace(outcome, why=found)
            elif found.refused[k]:
                why, asked = (
                    describe_miss(int(found.refused[k])),
                    found.refused[k] != RefusalReason.OUTSIDE,
                )
                new[image, label] = replace(outcome, why=why, is_asked=bool(asked))
            else:
                place = c.Place(
                    image=image,
                    label=label,
                    u_px=round(float(found.pixel_px[k, 0]), 3),
                    v_px=round(float(found.pixel_px[k, 1]), 3),
                    sigma_px=round(float(stated[k]), 4),
                    source="match",
                    score=round(float(found.score[k]), 4),
                    from_image=at,
                    from_u_px=u,
                    from_v_px=v,
                )
                turn = places.affine[row]
                alike = self._likeness(place, turn) >= ALIKE
                own = self._targets.target_at(place, turn)
                new[image, label] = replace(outcome, found=own, is_alike=alike)
        self.proposed.put(new, left, always=True)

    def _likeness(self, place: c.Place, affine: Floats) -> float:
        """Return the worst correlation of the surroundings of a match and its pick, -1 to 1."""
        source, target = map(self._photos.photos.get, (place.from_image, place.image))
        at = np.array([place.from_u_px, place.from_v_px], dtype=np.float64)
        return compute_worst_quarter_correlation(
            source, target, at, np.array([place.u_px, place.v_px]), affine
        )


def _stated(found: Matches | str, is_raised: Bools) -> Floats:
    """Return the sigmas (n,) that picks at the matches would have; NaN without matches."""
    if isinstance(found, str):
        return np.full(len(is_raised), np.nan)
    return pick_sigmas(found.covariance_px2, is_raised)


def _is_open(outcome: Outcome | None, places: PredictedPlaces, row: int) -> bool:
    """Return whether to search a place: for the first time, or since it is far better predicted."""
    if outcome is None:
        return True
    if outcome.is_over or (outcome.source is None and outcome.found is not None):
        return False
    if outcome.found is not None:
        return not places.holds(row, (outcome.found.u_px, outcome.found.v_px))
    return bool(places.radius_px[row] < NARROWED_SHARE * outcome.radius_px)
