"""A picking session: the photos of one project, their picks, and the adjustment.

It does not depend on the web: `web.server` passes checked messages in and takes JSON to send. All
changes of the session run in one thread (the server's loop), so there is no lock.
"""

from __future__ import annotations

import json
import logging
from collections import Counter
from collections.abc import Collection, Sequence
from dataclasses import asdict
from typing import cast

from uavgram.errors import OutputError
from uavgram.imaging.photos.cache import LruCache
from uavgram.imaging.photos.preview import read_preview
from uavgram.imaging.photos.tiles import TILE_PX, PhotoFile, TiledPhotos
from uavgram.io.photos.catalogue import report_unusable_photos
from uavgram.picking.document import commands as c
from uavgram.picking.document.commands import RefusedError
from uavgram.picking.document.history import Session, apply
from uavgram.picking.document.proposals import Outcomes, make_accept_command
from uavgram.picking.document.state import State, make_state
from uavgram.picking.protocol import encode_project
from uavgram.picking.protocol import messages as m
from uavgram.picking.protocol.encode_answers import (
    proposals_json,
    same_ground_json,
    side_json,
    snap_json,
    ties_json,
)
from uavgram.picking.protocol.encode_quantities import places_json
from uavgram.picking.protocol.encode_survey import (
    difference_json,
    messages_json,
    state_json,
)
from uavgram.picking.protocol.messages import Json
from uavgram.picking.protocol.parse import Message, PhotoSize, parse_message
from uavgram.picking.session.point_search import SearchInput
from uavgram.picking.session.searches import Searches
from uavgram.picking.session.workers import AdjustmentWorkers, Task, WatchedWork
from uavgram.picking.storage.tables import Tables
from uavgram.pipeline.pick.live_survey import LiveSurvey
from uavgram.pipeline.pick.places import predict_known_places, predict_place

log = logging.getLogger(__name__)

THUMBNAIL_PX = 256


class PickSession:
    """State of a picking session.

    Parameters
    ----------
    survey
        The project.
    saver
        Store of confirmed changes.
    broadcast
        Called from any thread with messages for all pages.

    Attributes
    ----------
    tiled
        Pictures of the photos, in tiles.
    """

    def __init__(self, survey: LiveSurvey, saver: Tables, broadcast: m.Broadcast) -> None:
        self.survey = survey
        self.saver = saver
        self._broadcast = broadcast
        inputs = survey.inputs
        photos = inputs.photos
        self.photos = tuple(
            PhotoSize(name, round(float(width)), round(float(height)))
            for name, width, height in zip(
                photos.frame_id, photos.width_px, photos.height_px, strict=True
            )
        )
        self.index = {photo.name: k for k, photo in enumerate(self.photos)}
        files = make_state(inputs.picks, inputs.lines, inputs.requests)
        self.session = Session(state=files)
        self.is_recovered = saver.recovered is not None and saver.recovered != files
        if saver.recovered is not None and self.is_recovered:
            self.session = Session(state=saver.recovered, past=(files,))
        self.version = 0
        self.fault = ""
        self._last_message: m.FullLive | None = None
        self.tiled = TiledPhotos(
            [
                PhotoFile(path, photo.width_px, photo.height_px)
                for path, photo in zip(photos.path, self.photos, strict=True)
            ]
        )
        self._thumbnails: LruCache[int, bytes] = LruCache(
            lambda k: read_preview(photos.path[k], THUMBNAIL_PX)[0].jpeg, len, 64_000_000
        )
        self._live = AdjustmentWorkers(survey, self.index, self._publish_adjustment, broadcast)
        self._search = Searches(survey, self._sought, broadcast)
        self._is_resting = True  # no step is unfinished
        self._state_version = 0  # of `session`, which lags behind `version` during a change
        self._adjusted_version = -1  # of the state that was adjusted last, or could not be

    def resume(self, before: Session) -> None:
        """Continue the history of an earlier session that ended with the present state.

        States with photos that the project no longer has cannot be returned to.
        """
        states = (*before.past, *before.future)
        images = {pick.image for state in states for pick in state.picks}
        if before.state == self.state and images <= self.index.keys():
            self.session = before

    @property
    def output(self) -> str:
        """Folder of the project's outputs."""
        return self.survey.inputs.project.output

    @property
    def state(self) -> State:
        """Present picked state."""
        return self.session.state

    def open(self) -> None:
        """Start: save what was recovered, adjust, and decode the photo that a page shows first."""
        self.save()
        self.tiled.read_ahead(self._find_most_picked_photo())
        self._live.start()
        self._search.start()
        self._search.submit(self._search_input())
        self._live.submit(Task(self.version, self.state, final=True))

    def _find_most_picked_photo(self) -> int:
        counts = Counter(pick.image for pick in self.state.picks)
        return max(range(len(self.photos)), key=lambda k: counts[self.photos[k].name])

    @property
    def works(self) -> dict[c.Work, WatchedWork]:
        """Work on the newest state that pages show and can stop."""
        return {"adjustment": self._live.work, "search": self._search.work}

    def stop(self) -> None:
        """Stop adjusting and searching."""
        self._live.stop()
        self._search.stop()

    def close(self) -> None:
        """Save everything and release the project."""
        self.save()
        self.saver.close()

    def initial_state(self) -> m.PickingState:
        """Return everything that a page needs at its start."""
        inputs, posed, damage = self.survey.inputs, self.survey.posed, self.survey.damage
        damaged = report_unusable_photos(damage.photos) if damage else ()
        return {
            "t": "initial-state",
            "units": asdict(inputs.project.units),
            "project": inputs.project.name,
            "tile_px": TILE_PX,
            "pick_sigma_px": inputs.project.picks_sigma_px,
            "reading_sigma_m": inputs.project.tape.reading_sigma_m,
            "photos": encode_project.photos_json(self.survey, self.photos),
            "damaged": [one.frames[0] for one in damaged],
            "left_out": sorted(inputs.project.leave_out),
            "camera": encode_project.camera_json(self.survey),
            "clock": encode_project.clock_json(self.survey),
            "flight": encode_project.flight_json(self.survey),
            "control": list(inputs.control.label),
            "check": list(inputs.check.label),
            "named": encode_project.list_hidden_labels(inputs),
            "sample": encode_project.sample_json(inputs),
            "planned": encode_project.planned_json(
                inputs.planned, inputs.project.units, sought=inputs.project.targets is not None
            ),
            "control_lines": encode_project.control_lines_json(inputs),
            "expected": self._predict_places(),
            "recovered": self.is_recovered,
            "messages": messages_json(
                (
                    *damaged,
                    *self.saver.messages,
                    *inputs.messages,
                    *(posed.messages if posed else ()),
                )
            ),
            "state": state_json(self.state, self.index),
            **self._standing(),
            "live": self._last_message,
            "proposals": self._proposals(),
        }

    def answer(self, message: Message) -> m.Answer:
        """Answer a question; allowed from any thread, as nothing changes.

        Raises
        ------
        UavgramError
            The photo cannot be read.
        """
        found: m.Answer
        match message.body:
            case c.Snap():
                found = self._snap(message.body)
            case c.SameGround():
                found = same_ground_json(self.survey, self._live.last, message.body, self.index)
            case c.SideView():
                found = side_json(self._live.last, message.body)
            case c.Ties():
                found = ties_json(self.survey.inputs.ties, message.body)
            case _:
                raise TypeError(f"{type(message.body).__name__} is no question")
        found["seq"] = message.seq
        return found

    def _snap(self, asked: c.Snap) -> m.Snapped | m.NotSnapped:
        photo = self.tiled.pixels(self.index[asked.image])
        label, expected, match = asked.expected, None, None
        if label and self.state.pick(asked.image, label) is None:
            match = self._search.outcomes.get((asked.image, label))
            expected = predict_place(self.survey, self._live.last, asked.image, label)
        return snap_json(photo, asked, expected, None if match is None else match.found)

    def change(self, message: Message) -> m.Changed:
        """Apply a command and store it; the answer is for all pages.

        Raises
        ------
        RefusedError
            The command does not fit the state; the message gives the reason.
        OutputError
            The command cannot be stored, so it counts as not done.
        """
        if isinstance(message.body, c.Question | c.ProjectAction):
            raise TypeError(f"{type(message.body).__name__} is no command")
        before, do = self.session, message.body
        if isinstance(do, c.Accept):
            do = make_accept_command(self._search.outcomes, self.state, do.pairs)
        after = apply(before, do, message.step)
        if after is not before:
            self._try(after.state, final=message.final)  # adjust while the disk is busy
            try:
                self.saver.record(do, message.step)
            except OutputError:
                self._try(before.state, final=True)
                self._state_version = self.version
                raise
            self.session, self._state_version = after, self.version
        self._is_resting = message.final
        if message.final:
            self._search.submit(self._search_input())
        return {
            "t": "changed",
            "seq": message.seq,
            "diff": difference_json(before.state, after.state, self.index),
            **self._standing(),
        }

    def refuse(self, action: c.Refuse) -> None:
        """Refuse some proposals, or search for refused ones again."""
        if action.is_taken_back:
            self._search.reopen(action.pairs, self._search_input())
        else:
            self._search.refuse(action.pairs)

    def take(self, changes: Sequence[Json], step: int) -> int:
        """Apply changes in one step, as if a page had sent them; return how many do not fit.

        Raises
        ------
        OutputError
            The changes cannot be stored.
        """
        refused = 0
        for fields in changes:
            text = json.dumps({"seq": 0, "step": step, **fields})
            try:
                self.change(parse_message(text, self.photos))
            except RefusedError as why:
                log.info("does not fit any more: %s", why)
                refused += 1
        return refused

    def inputs_now(self) -> frozenset[str] | None:
        """Return the present digests of the project's files; None while changes are unsaved."""
        return self.saver.inputs_now(digest.sha256 for digest in self.survey.inputs.digests)

    def _try(self, state: State, *, final: bool) -> None:
        """Adjust a state under a new version number."""
        self.version += 1
        self._live.submit(Task(self.version, state, final))

    def save(self) -> None:
        """Write the tables, and broadcast the reason if that failed."""
        fault = self.saver.save(self.state)
        if fault:
            log.warning("not saved: %s", fault)
        self.fault = fault
        self._broadcast({"t": "saved", "version": self.version, "fault": fault})

    def show(self, page: str, photos: tuple[int, ...]) -> None:
        """Note which photos a page shows side by side."""
        self.tiled.show(page, photos)
        if photos:  # neighbours in the list were mostly taken nearby
            near = sorted(range(len(self.photos)), key=lambda k: min(abs(k - p) for p in photos))
            self._search.read_ahead([self.photos[k].name for k in near])

    def thumbnail(self, photo: int) -> bytes | None:
        """Return the JPEG of a small picture of a photo; None if there is none."""
        return self._thumbnails.get(photo) if 0 <= photo < len(self.photos) else None

    def _standing(self) -> m.Standing:
        return {
            "version": self.version,
            "undo": len(self.session.past),
            "redo": len(self.session.future),
        }

    def _predict_places(self) -> list[m.Predicted]:
        return places_json(predict_known_places(self.survey, self._live.last), self.index)

    def _sought(self, outcomes: Outcomes, labels: Collection[str], searched: int) -> None:
        fields = proposals_json(outcomes, self.index, labels, searched)
        self._broadcast({"t": "proposals", **fields})

    def _proposals(self) -> m.Proposals:
        outcomes = self._search.outcomes
        labels = {label for _, label in outcomes}
        return proposals_json(outcomes, self.index, labels, self._search.searched)

    def _publish_adjustment(self, version: int, found: m.Adjustment) -> None:
        answer = cast("m.Live", {"t": "live", "for": version, **found})
        if answer["mode"] != "linearised":
            answer["expected"] = self._predict_places()
            self._last_message = answer
            self._adjusted_version = version
        self._broadcast(answer)
        if answer["mode"] != "linearised" and self._is_resting:  # a drag has the cores for itself
            self._search.submit(self._search_input())

    def _search_input(self) -> SearchInput:
        """Return the present picks, the last adjustment, and whether it is theirs."""
        version = self._state_version
        return SearchInput(self.state, self._live.last, self._adjusted_version == version, version)
