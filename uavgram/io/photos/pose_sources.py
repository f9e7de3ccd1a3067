"""Poses of the photos from the sources that a project names in `poses`.

Of several sources, each quantity is taken from the most accurate one.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from uavgram.errors import InputError, suggest_spelling
from uavgram.io.photos.metadata import read_first_site
from uavgram.io.photos.pose_tables import read_geo_txt, read_mrk, read_pose_csv
from uavgram.io.photos.pose_tags import read_photo_tags, read_stated_tags
from uavgram.model.arrays import Floats, Ints
from uavgram.model.flight_log import HeightDatum
from uavgram.model.frames import PhotoPoses, Photos
from uavgram.model.message import Message

FROM_PHOTOS = "exif"


def read_photo_poses(
    source: str, photos: Photos, heights: HeightDatum
) -> tuple[PhotoPoses, tuple[Message, ...]]:
    """Read the photos' poses.

    Parameters
    ----------
    source
        ``exif``: the tags of the photos; else a file: .mrk (DJI), .csv, or a geo.txt of any name.
    photos
        The project's photos.
    heights
        Datum of heights in files that state none.

    Returns
    -------
    poses
        Poses of the photos that have one, in the order of `photos`.
    messages
        Oddities and assumptions.

    Raises
    ------
    InputError
        The source is malformed, or has a pose for none of the photos.
    """
    if source == FROM_PHOTOS:
        poses, messages = read_photo_tags(photos)
    else:
        poses, messages = _read_source(source, photos, heights)
    messages = (*messages, *create_datum_message(poses))
    chosen, more = _select_photos(source, poses, photos)
    return chosen, (*messages, *more)


def read_stated_poses(
    source: str, photos: Photos, heights: HeightDatum
) -> tuple[PhotoPoses | None, tuple[Message, ...]]:
    """Read the photos' poses from one source among several, which may lack places.

    Parameters
    ----------
    source, photos, heights
        As for `read_photo_poses`.

    Returns
    -------
    poses
        Places may be NaN; None where the photos' tags have neither a place nor an attitude.
    messages
        Oddities and assumptions.
    """
    if source == FROM_PHOTOS:
        return read_stated_tags(photos)
    poses, messages = _read_source(source, photos, heights, may_lack_places=True)
    chosen, more = _select_photos(source, poses, photos)
    return chosen, (*messages, *more)


def create_datum_message(poses: PhotoPoses) -> tuple[Message, ...]:
    """Create a message where the datum of the heights was assumed."""
    if not poses.datum_guess:
        return ()
    text = (
        f"Heights of {poses.source} were taken as "
        f"{'above sea level' if poses.datum == 'msl' else 'ellipsoidal'}: {poses.datum_guess}."
    )
    return (Message("info", "height-datum-assumed", text),)


def _read_source(
    source: str, photos: Photos, heights: HeightDatum, *, may_lack_places: bool = False
) -> tuple[PhotoPoses, tuple[Message, ...]]:
    if source.lower().endswith(".mrk"):
        return read_mrk(source, photos)
    site = read_first_site(photos.path)
    if source.lower().endswith(".csv"):
        return read_pose_csv(source, heights, site, may_lack_places=may_lack_places), ()
    return read_geo_txt(source, heights, site)


def _select_photos(
    source: str, poses: PhotoPoses, photos: Photos
) -> tuple[PhotoPoses, tuple[Message, ...]]:
    """Select the rows of the project's photos, in their order; report rows without a photo."""
    row = {name: k for k, name in enumerate(poses.frame_id)}
    index = [row[name] for name in photos.frame_id if name in row]
    if not index:
        name = poses.frame_id[0]
        hint = suggest_spelling(name, photos.frame_id)
        raise InputError(
            source,
            f"names none of the project's {len(photos.frame_id)} photos; its first is {name!r}"
            + (f": {hint}" if hint else ""),
        )
    extra = [name for name in poses.frame_id if name not in set(photos.frame_id)]
    messages: tuple[Message, ...] = ()
    if extra:
        text = (
            f"{Path(source).name} has {len(extra)} photos that are not among `images` (the first "
            f"is {extra[0]}): they were not used."
        )
        messages = (Message("info", "pose-without-photo", text),)
    return poses.rows(np.array(index)), messages


_ASSUMED = 1e9
"""Rank of values without a standard deviation: after all that have one."""

_PLACE = ("latitude_deg", "longitude_deg", "height_m", "sigma_horizontal_m", "sigma_vertical_m")
_ATTITUDE = ("ypr_rad", "vehicle_ypr_rad", "sigma_attitude_rad")


class _Reading(NamedTuple):
    """Poses of one source; `row` (N,) of each photo in its poses, -1 where it has none."""

    name: str
    poses: PhotoPoses
    row: Ints

    def column(self, name: str) -> Floats:
        """Return one quantity of all N photos; NaN where this source does not have the photo."""
        value = np.asarray(getattr(self.poses, name), dtype=np.float64)[self.row]
        value[self.row < 0] = np.nan
        return value


def read_pose_sources(
    sources: Sequence[str], photos: Photos, heights: HeightDatum
) -> tuple[PhotoPoses, tuple[Message, ...]]:
    """Read the photos' poses from one source or several.

    With several, place and attitude of each photo come from the source with the smallest standard
    deviation; a source with a standard deviation has priority over one without, and among equal
    ones the first named.

    Parameters
    ----------
    sources
        As for `read_photo_poses`.
    photos
        The project's photos.
    heights
        Datum of heights in files that state none.

    Returns
    -------
    poses
        Poses of the photos that have a place, in the order of `photos`.
    messages
        Oddities and assumptions, and with several sources their contributions.

    Raises
    ------
    InputError
        A source is malformed, or none has the place of a photo.
    """
    if len(sources) == 1:
        return read_photo_poses(sources[0], photos, heights)
    readings: list[_Reading] = []
    messages: list[Message] = []
    for source in sources:
        poses, more = read_stated_poses(source, photos, heights)
        messages += more
        if poses is None:
            continue
        at = {name: k for k, name in enumerate(poses.frame_id)}
        row = np.array([at.get(name, -1) for name in photos.frame_id], dtype=np.int64)
        readings.append(_Reading(_name(source, poses), poses, row))
    merged, summary = _merge_sources(sources, photos, readings)
    return merged, (*messages, *summary)


def _name(source: str, poses: PhotoPoses) -> str:
    return f"the photos' tags ({poses.source})" if source == FROM_PHOTOS else Path(source).name


def _merge_sources(
    sources: Sequence[str], photos: Photos, readings: list[_Reading]
) -> tuple[PhotoPoses, list[Message]]:
    place = _best([_place_rank(each) for each in readings], len(photos.frame_id))
    if (place < 0).all():
        names = ", ".join(Path(source).name for source in sources)
        raise InputError(
            sources[0], f"none of the sources in `poses` ({names}) has a photo's place"
        )
    most = int(np.bincount(place[place >= 0]).argmax())
    datum = readings[most].poses.datum
    # Heights above different datums differ by tens of metres: use the most frequent datum only.
    usable = [
        _place_rank(each) if each.poses.datum == datum else np.full(len(place), np.inf)
        for each in readings
    ]
    before, place = place, _best(usable, len(place))
    attitude = _best([_attitude_rank(each) for each in readings], len(place))
    rows = np.flatnonzero(place >= 0)
    attitude[place < 0] = -1
    used = [readings[k] for k in np.unique(place[rows])]
    kept = [readings[k] for k in np.unique(np.concatenate([place[rows], attitude[rows]])) if k >= 0]
    columns = {name: _collect_quantity(readings, place, name)[rows] for name in _PLACE}
    columns |= {name: _collect_quantity(readings, attitude, name)[rows] for name in _ATTITUDE}
    columns |= {name: _first(readings, name)[rows] for name in ("height_home_m", "time_utc_s")}
    guesses = dict.fromkeys(r.poses.datum_guess for r in used if r.poses.datum_guess)
    poses = replace(
        readings[most].poses,
        frame_id=tuple(photos.frame_id[k] for k in rows),
        datum_guess="; ".join(guesses),
        source=", ".join(dict.fromkeys(each.poses.source for each in kept)),
        **columns,  # type: ignore[arg-type]  # columns of numbers, by their names
    )
    messages = [message for each in used for message in create_datum_message(each.poses)]
    messages += _another_datum(photos, readings, np.where(place < 0, before, -1), datum)
    return poses, [*messages, _summary(readings, place, attitude)]


def _place_rank(reading: _Reading) -> Floats:
    sigma, other = reading.column("sigma_horizontal_m"), reading.column("sigma_vertical_m")
    sigma = np.where(np.isfinite(sigma), sigma, other)
    rank = np.where(np.isfinite(sigma), sigma, _ASSUMED)
    return np.where(np.isfinite(reading.column("height_m")), rank, np.inf)


def _attitude_rank(reading: _Reading) -> Floats:
    sigma = reading.column("sigma_attitude_rad")
    rank = np.where(np.isfinite(sigma), sigma, _ASSUMED)
    return np.where(np.isfinite(reading.column("ypr_rad")).all(axis=1), rank, np.inf)


def _best(ranks: list[Floats], count: int) -> Ints:
    """Find the source (N,) with the smallest rank; -1 where none has a finite one."""
    if not ranks:
        return np.full(count, -1)
    table = np.stack(ranks)
    best = table.argmin(axis=0)
    return np.where(np.isfinite(table.min(axis=0)), best, -1)


def _collect_quantity(readings: list[_Reading], chosen: Ints, name: str) -> Floats:
    """Collect a quantity (N, ...), for each photo from the chosen source; NaN where none is."""
    value = np.full_like(readings[0].column(name), np.nan)
    for k, reading in enumerate(readings):
        value[chosen == k] = reading.column(name)[chosen == k]
    return value


def _first(readings: list[_Reading], name: str) -> Floats:
    """Collect a quantity (N,) from the first source that has it."""
    value = readings[0].column(name)
    for reading in readings[1:]:
        value = np.where(np.isfinite(value), value, reading.column(name))
    return value


def _another_datum(
    photos: Photos, readings: list[_Reading], lost: Ints, datum: HeightDatum
) -> list[Message]:
    """Warn of photos whose only height is above another datum.

    `lost` (N,) is their source, or -1.
    """
    names = [photos.frame_id[k] for k in np.flatnonzero(lost >= 0)]
    if not names:
        return []
    other = readings[int(lost.max())]
    text = (
        f"{len(names)} photos ({', '.join(names)}) were left out: only {other.name} has their "
        f"place, with heights that are {other.poses.datum}, while those of the other photos are "
        f"{datum}. Give their places with such heights in a CSV file, and add it to `poses`."
    )
    return [Message("warning", "pose-datum-differs", text)]


def _summary(readings: list[_Reading], place: Ints, attitude: Ints) -> Message:
    """Report the contributions of the sources."""
    of_place, of_attitude = _shares(readings, place), _shares(readings, attitude)
    there = place >= 0
    without = int((there & (attitude < 0)).sum())
    text = f"Positions of the photos come from {of_place}"
    text += f"; attitudes from {of_attitude}" if of_attitude else ""
    text += f"; {without} of {int(there.sum())} photos have no stated attitude" if without else ""
    idle = [r.name for k, r in enumerate(readings) if not ((place == k) | (attitude == k)).any()]
    text += f"; nothing was taken from {', '.join(idle)}" if idle else ""
    return Message("info", "pose-sources", text + ".")


def _shares(readings: list[_Reading], chosen: Ints) -> str:
    counts = [(int((chosen == k).sum()), r.name) for k, r in enumerate(readings)]
    return " and ".join(f"{name} ({count} photos)" for count, name in counts if count)
