"""Pictures of a survey: parts of photos for the report, photos for the recording."""

from __future__ import annotations

from dataclasses import replace
from itertools import groupby
from threading import Lock

from uavgram.imaging.photos.decoding import read_pixels
from uavgram.imaging.photos.preview import Pixels, Preview, cut_parts, make_preview_of_decoded
from uavgram.imaging.top_view.mosaic import GroundTexture, cut_ground
from uavgram.io.files import photo_files
from uavgram.model.message import Message
from uavgram.model.result.result import GroundPicture, Picture, Pictures, Region, Result
from uavgram.stages.products.picture_plan import picture_plan
from uavgram.views.report import ground_extent

MAX_BYTES = 9_000_000
"""Largest size of all pictures together. As text in report.html they are a third larger: it stays
below 15 MB."""

_ORDER = {"overview": 0, "measurement": 1, "point": 2}


class ReportPictures:
    """Parts of photos for a report, cut out while the photos are read for another purpose."""

    def __init__(self, result: Result) -> None:
        """Choose the parts of each photo."""
        self._result, self._plan = result, picture_plan(result)
        files = photo_files(result.frames)
        self._wanted = {
            files[frame]: tuple(regions)
            for frame, regions in groupby(sorted(self._plan.regions, key=_frame), _frame)
        }
        self._made: dict[str, tuple[Picture, ...]] = {}
        self._one = Lock()
        self._room: Pixels | None = None

    def needs_photo(self, path: str) -> bool:
        """Return whether any part of a photo is shown."""
        return path in self._wanted

    def cut_parts(self, path: str) -> tuple[Preview, Pixels]:
        """Cut the parts out of a photo, which is decoded once for all.

        Only one photo that is decoded as a whole is in memory at a time, for any number of threads.

        Returns
        -------
        As `read_preview`.

        Raises
        ------
        InputError
            The file cannot be read, or is no photo.
        """
        with self._one:
            whole = read_pixels(path, room=self._room)
            preview, pixels, halves = make_preview_of_decoded(whole)
            self._made[path] = cut_parts(halves, preview.tone, self._wanted[path])
            self._room = None if pixels is whole else whole
        return preview, pixels

    def pictures(self) -> Pictures:
        """Return all parts, once their photos have been read."""
        self._room = None
        made = [picture for path in self._wanted for picture in self._made[path]]
        made.sort(key=lambda one: (_ORDER[one.region.subject], one.region.row))
        shown: list[Picture] = []
        left_out = list(self._plan.left_out)
        weight = 0
        for picture in made:
            weight += len(picture.jpeg)
            if weight <= MAX_BYTES:
                shown.append(picture)
            else:
                left_out.append(_name(self._result, picture.region))
        return Pictures(shown=tuple(shown), left_out=tuple(left_out))


def cut_out_ground(result: Result, texture: GroundTexture | None) -> GroundPicture | None:
    """Cut out the ground below the report's plans; None where photos show none of it."""
    corners = ground_extent(result)
    return None if texture is None or corners is None else cut_ground(texture, *corners)


def _frame(region: Region) -> int:
    return region.frame


def _name(result: Result, region: Region) -> str:
    rows = result.points.label if region.subject == "point" else result.measurements.name
    return rows[region.row]


MAX_RECORDED = 5_000
"""Largest number of photos in a recording: at some 0.3 MB each the viewer needs gigabytes to open
more."""


def select_recorded(count: int) -> range:
    """Return rows of the photos in a recording of so many: all, or a regular selection."""
    return range(0, count, max(1, -(-count // MAX_RECORDED)))


def note_thinning(result: Result) -> Result:
    """Add a note where the recording has only some of the photos."""
    count = len(result.frames.frame_id)
    rows = select_recorded(count)
    if len(rows) == count:
        return result
    text = (
        f"The recording carries {len(rows)} of the {count} photos, one in {rows.step}: with all of "
        "them it would be too large to open. Nothing else is left out of it."
    )
    return replace(result, messages=(*result.messages, Message("info", "recording-thinned", text)))
