"""One project on the desk: its photos, its session, its adjustment, and how they hang together.

No web here: `server` hands in checked messages and takes JSON to send. All that changes the
session runs in one thread (the server's loop), so there is no lock.
"""

from __future__ import annotations

import logging
from collections.abc import Callable
from pathlib import Path

from uavgram.imaging.preview import read_preview
from uavgram.imaging.tiles import TILE_PX, Kept, Pyramid, level_count, read_pyramid
from uavgram.picking import commands as c
from uavgram.picking.answers import Json, difference_json, messages_json, state_json
from uavgram.picking.autosave import Saver
from uavgram.picking.ground import same_ground_json
from uavgram.picking.live import Live, Task
from uavgram.picking.messages import Message, PhotoSize
from uavgram.picking.session import Session, apply
from uavgram.picking.snapping import snap_json
from uavgram.picking.state import State, state_of
from uavgram.pipeline.live import LiveSurvey

log = logging.getLogger(__name__)

PHOTOS_BYTES = 350_000_000
"""Decoded photos that are kept: two of 48 megapixels with their reductions take 384 MB."""

THUMBNAIL_PX = 256


class Desk:
    """The state of a picking session.

    Parameters
    ----------
    survey
        The project.
    saver
        Keeps what is confirmed.
    tell
        Called with what every page should know, from any thread.
    """

    def __init__(self, survey: LiveSurvey, saver: Saver, tell: Callable[[Json], None]) -> None:
        self.survey = survey
        self._saver = saver
        self._tell = tell
        inputs = survey.inputs
        photos = inputs.photos
        self.photos = tuple(
            PhotoSize(name, round(float(width)), round(float(height)))
            for name, width, height in zip(
                photos.frame_id, photos.width_px, photos.height_px, strict=True
            )
        )
        self.index = {photo.name: k for k, photo in enumerate(self.photos)}
        files = state_of(inputs.picks, inputs.lines, inputs.requests)
        self.recovered = saver.recovered()
        self.session = Session(state=files)
        if self.recovered is not None and self.recovered != files:
            self.session = Session(state=self.recovered, past=(files,))
        self.version = 0
        self.fault = ""
        self._said: Json = {}
        self._pyramids: Kept[int, Pyramid] = Kept(
            lambda k: read_pyramid(photos.path[k]), lambda p: p.size_bytes, PHOTOS_BYTES
        )
        self._thumbnails: Kept[int, bytes] = Kept(
            lambda k: read_preview(photos.path[k], THUMBNAIL_PX)[0].jpeg, len, 64_000_000
        )
        self._live = Live(survey, self.index, self._adjusted)

    @property
    def output(self) -> str:
        """The folder of the project's outputs."""
        return self.survey.inputs.project.output

    @property
    def state(self) -> State:
        """What is picked now."""
        return self.session.state

    def open(self) -> None:
        """Begin: adjust what is there."""
        self._live.start()
        self._live.submit(Task(self.version, self.state, final=True))

    def stop(self) -> None:
        """Adjust no more; waits for an adjustment under way."""
        self._live.stop()

    def close(self) -> None:
        """End: save everything, let go of the project."""
        self.save()
        self._saver.close()

    def hello(self) -> Json:
        """Everything a page needs to begin."""
        inputs, posed = self.survey.inputs, self.survey.posed
        frames = None if posed is None else posed.frames
        return {
            "t": "hello",
            "project": inputs.project.name,
            "tile": TILE_PX,
            "sigma": inputs.project.picks_sigma_px,
            "significance": inputs.project.solve.significance,
            "photos": [
                {
                    "name": photo.name,
                    "width": photo.width_px,
                    "height": photo.height_px,
                    "levels": level_count(photo.width_px, photo.height_px),
                    "matched": bool(frames is not None and frames.matched[k]),
                    "reason": "" if frames is None else frames.reason[k],
                    "time": None if frames is None else _time(frames.time_utc_s[k]),
                }
                for k, photo in enumerate(self.photos)
            ],
            "camera": _camera_json(self.survey),
            "control": list(inputs.control.label),
            "check": list(inputs.check.label),
            "recovered": self.recovered is not None,
            "messages": messages_json(
                (*self._saver.messages, *inputs.messages, *(posed.messages if posed else ()))
            ),
            "state": state_json(self.state, self.index),
            **self._standing(),
            "live": self._said or None,
        }

    def answer(self, message: Message) -> Json:
        """Answer a question; from any thread, as nothing changes.

        Raises
        ------
        UavgramError
            The photo cannot be read.
        """
        if isinstance(message.body, c.Snap):
            photo = self._pyramids.get(self.index[message.body.image])
            return {"t": "snapped", "seq": message.seq, **snap_json(photo, message.body)}
        if isinstance(message.body, c.SameGround):
            found = same_ground_json(self.survey, self._live.last, message.body, self.index)
            return {"t": "ground", "seq": message.seq, **found}
        raise TypeError(f"{type(message.body).__name__} is no question")

    def change(self, message: Message) -> Json:
        """Do what a command says, and keep it; the answer is for all pages.

        Raises
        ------
        RefusedError
            It does not fit the state; says why.
        """
        if isinstance(message.body, c.Question):
            raise TypeError(f"{type(message.body).__name__} is no command")
        before = self.session
        after = apply(before, message.body, message.step)
        if after is before:
            return {"t": "changed", "seq": message.seq, "diff": {}, **self._standing()}
        self._saver.record(message.body, message.step)
        self.session = after
        self.version += 1
        self._live.submit(Task(self.version, after.state, message.final))
        return {
            "t": "changed",
            "seq": message.seq,
            "diff": difference_json(before.state, after.state, self.index),
            **self._standing(),
        }

    def save(self) -> None:
        """Write the tables, and tell where that was not possible."""
        fault = self._saver.save(self.state)
        if fault:
            log.warning("not saved: %s", fault)
        self.fault = fault
        self._tell({"t": "saved", "version": self.version, "fault": fault})

    def tile(self, photo: int, level: int, column: int, row: int) -> bytes | None:
        """JPEG of a tile; None where there is none."""
        if not 0 <= photo < len(self.photos):
            return None
        return self._pyramids.get(photo).tile(level, column, row)

    def thumbnail(self, photo: int) -> bytes | None:
        """JPEG of a small picture of a photo; None where there is none."""
        return self._thumbnails.get(photo) if 0 <= photo < len(self.photos) else None

    def _standing(self) -> Json:
        return {
            "version": self.version,
            "undo": len(self.session.past),
            "redo": len(self.session.future),
        }

    def _adjusted(self, version: int, said: Json) -> None:
        answer = {"t": "live", "for": version, **said}
        if said["mode"] != "linearised":
            self._said = answer
        self._tell(answer)


def _time(value: float) -> float | None:
    return float(value) if value == value else None  # noqa: PLR0124  (NaN is not itself)


def _camera_json(survey: LiveSurvey) -> Json:
    calibration = survey.inputs.calibration
    return {
        "name": calibration.name,
        "model": calibration.model,
        "width": calibration.width_px,
        "height": calibration.height_px,
        "names": list(calibration.parameter_names),
        "parameters": calibration.parameters.tolist(),
        "sigma": (calibration.covariance.diagonal() ** 0.5).tolist(),
        "file": Path(survey.inputs.project.camera).name,
    }
