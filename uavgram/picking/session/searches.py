"""Background searches in a project's photos during picking: picked points, and coded plates.

The code of a plate identifies the point at each corner, so it needs no pick and no pose.
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Collection, Sequence
from dataclasses import replace

from uavgram.config.board_text import parse_board
from uavgram.errors import InputError
from uavgram.imaging.photos.cache import GreyPhotos
from uavgram.imaging.raster import Image
from uavgram.imaging.targets.plates import detect_board_plate, detect_large_plates
from uavgram.io.photos.catalogue import read_grey
from uavgram.model.observations import RejectedPlate, SeenPlate
from uavgram.model.options import TargetOptions
from uavgram.picking.document import commands as c
from uavgram.picking.document.proposals import Outcome, Pair
from uavgram.picking.document.state import State, make_observations
from uavgram.picking.protocol import messages as m
from uavgram.picking.session.point_search import PointSearch, SearchInput
from uavgram.picking.session.proposal_table import ProposalTable, Tell
from uavgram.picking.session.workers import HIDDEN_S, LatestTask, WatchedWork
from uavgram.pipeline.measure.inputs import Inputs
from uavgram.pipeline.pick.live_survey import LiveSurvey
from uavgram.pipeline.targets import list_named_points
from uavgram.stages.plates import TargetRow, list_requested_centers, rows_of

log = logging.getLogger(__name__)

MAX_PX = 13_000_000
"""Largest photo searched at full resolution [px].

A larger one is searched reduced, which saves time and memory of the page; the plates found are
measured in the full photo.
"""

ReadReduced = Callable[[str, int], Image]
"""Decoder of a photo by name, reduced by an integer factor each way: 1, 2, 4 or 8."""


class Searches:
    """Search for picks in the other photos and for coded plates in all, on the same grey pixels.

    Parameters
    ----------
    survey
        The project.
    tell
        Called after each change, from any thread.
    broadcast
        Called from any thread with messages for all pages.
    """

    def __init__(self, survey: LiveSurvey, tell: Tell, broadcast: m.Broadcast) -> None:
        photos = survey.inputs.photos
        paths = dict(zip(photos.frame_id, photos.path, strict=True))
        sizes = zip(photos.width_px.tolist(), photos.height_px.tolist(), strict=True)
        pixels = [round(width) * round(height) for width, height in sizes]
        self._grey = GreyPhotos(
            dict(zip(photos.frame_id, pixels, strict=True)), lambda name: read_grey(paths[name])
        )
        self._proposed = ProposalTable(tell)
        self.work = WatchedWork("search", broadcast, HIDDEN_S)
        self._seeker = PointSearch(survey, self._grey, self._proposed, self.work)
        self._plates = PlateSearch(
            survey.inputs,
            self._grey,
            lambda name, factor: read_grey(paths[name], factor),
            self._proposed,
        )

    @property
    def outcomes(self) -> dict[Pair, Outcome]:
        """Copy of the present outcomes."""
        return self._proposed.outcomes

    @property
    def searched(self) -> int:
        """Number of the last state for which all picks were searched; -1: none."""
        return self._proposed.searched

    def start(self) -> None:
        """Start the searches."""
        self._seeker.start()
        self._plates.start()

    def submit(self, wanted: SearchInput) -> None:
        """Search and propose for these picks."""
        self._seeker.submit(wanted)
        self._plates.submit(wanted.state)

    def refuse(self, pairs: Collection[Pair]) -> None:
        """Stop proposing, or asking for, some labels."""
        self._proposed.refuse(pairs)

    def reopen(self, pairs: Collection[Pair], wanted: SearchInput) -> None:
        """Search for refused labels again."""
        self._proposed.reopen(pairs)
        self.submit(wanted)

    def read_ahead(self, names: Sequence[str]) -> None:
        """Decode photos in this order, as many as memory allows."""
        self._grey.read_ahead(names)

    def stop(self) -> None:
        """End after the current photos."""
        self._seeker.stop()
        self._plates.stop()
        self._grey.stop()


class PlateSearch(LatestTask[State]):
    """Worker that searches for a project's plates.

    Parameters
    ----------
    inputs
        The project; without `targets` the search is off.
    photos
        Grey pixels.
    read
        Decoder of reduced photos.
    proposed
        Receiver of the results.
    """

    def __init__(
        self, inputs: Inputs, photos: GreyPhotos, read: ReadReduced, proposed: ProposalTable
    ) -> None:
        super().__init__({"plates": self._work})
        self._inputs, self._photos, self._read = inputs, photos, read
        self._proposed = proposed
        self._seen: dict[str, tuple[SeenPlate, ...]] = {}

    def start(self) -> None:
        """Start the worker if the project describes targets."""
        if self._inputs.project.targets is not None:
            super().start()

    def _work(self) -> None:
        state: State | None = None
        while (state := self.newer(state)) is not None:
            try:
                self._seek(state)
            except Exception:  # a bug here must not end the worker: picking goes on
                log.exception("the search for plates failed")

    def _seek(self, state: State) -> None:
        targets = self._inputs.project.targets
        self._propose(state)
        for name in self._inputs.photos.frame_id:
            if targets is None or self.is_outdated(state):
                return
            if name not in self._seen:
                self._seen[name] = self._detect_plates(name, targets)
                self._propose(state)

    def _detect_plates(self, name: str, targets: TargetOptions) -> tuple[SeenPlate, ...]:
        """Return the plates in a photo; none if it cannot be read, which other searches report."""
        try:
            if targets.is_board:
                return detect_board_plate(
                    self._photos.photos.get(name), parse_board(targets.family)
                )
            factor = self._reduction(name)
            small = self._photos.photos.get(name) if factor == 1 else self._read(name, factor)
            return detect_large_plates(
                small, factor, lambda: self._photos.photos.get(name), targets.family
            )
        except InputError as why:
            log.warning("no plates were sought: %s", why)
            return ()

    def _reduction(self, name: str) -> int:
        photos = self._inputs.photos
        k = photos.frame_id.index(name)
        size = float(photos.width_px[k]) * float(photos.height_px[k])
        return next((one for one in (1, 2, 4) if size <= MAX_PX * one**2), 8)

    def _propose(self, state: State) -> None:
        """Propose the corners, and the centres that lengths and measurements name now."""
        picks, lines = make_observations(state)
        now = replace(self._inputs, picks=picks, lines=lines, requests=state.requests)
        plates = {
            p.plate for some in self._seen.values() for p in some if p.left_out is RejectedPlate.NO
        }
        named, known = list_named_points(now)
        rows = rows_of(self._seen, list_requested_centers(plates, named, known, picks))
        new = {(row.image, row.label): _outcome(row) for row in rows}
        self._proposed.put(new, gone=self._no_more(new))

    def _no_more(self, new: dict[Pair, Outcome]) -> list[Pair]:
        """Return the proposals from plates that are no longer needed."""
        outcomes = self._proposed.outcomes
        return [pair for pair, one in outcomes.items() if one.source is None and pair not in new]


def _outcome(row: TargetRow) -> Outcome:
    found = c.Place(**vars(row), source="target")
    return Outcome(source=None, radius_px=0.0, found=found)
