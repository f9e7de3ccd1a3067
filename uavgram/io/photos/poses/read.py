"""Poses of the photos from one source that a project names in `poses`."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from uavgram.errors import InputError, near_miss
from uavgram.io.photos.metadata import site_of
from uavgram.io.photos.poses.pose_tables import read_geo_txt, read_mrk, read_pose_csv
from uavgram.io.photos.poses.tags import read_photo_tags, read_stated_tags
from uavgram.model.flight.frames import Photos
from uavgram.model.flight.log import HeightDatum
from uavgram.model.flight.pose import PhotoPoses
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
        poses, messages = _of_file(source, photos, heights)
    messages = (*messages, *height_guess(poses))
    chosen, more = _of_photos(source, poses, photos)
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
    poses, messages = _of_file(source, photos, heights, may_lack_places=True)
    chosen, more = _of_photos(source, poses, photos)
    return chosen, (*messages, *more)


def height_guess(poses: PhotoPoses) -> tuple[Message, ...]:
    """Create a message where the datum of the heights was assumed."""
    if not poses.datum_guess:
        return ()
    text = (
        f"Heights of {poses.source} were taken as "
        f"{'above sea level' if poses.datum == 'msl' else 'ellipsoidal'}: {poses.datum_guess}."
    )
    return (Message("info", "height-datum-assumed", text),)


def _of_file(
    source: str, photos: Photos, heights: HeightDatum, *, may_lack_places: bool = False
) -> tuple[PhotoPoses, tuple[Message, ...]]:
    if source.lower().endswith(".mrk"):
        return read_mrk(source, photos)
    site = site_of(photos.path)
    if source.lower().endswith(".csv"):
        return read_pose_csv(source, heights, site, may_lack_places=may_lack_places), ()
    return read_geo_txt(source, heights, site)


def _of_photos(
    source: str, poses: PhotoPoses, photos: Photos
) -> tuple[PhotoPoses, tuple[Message, ...]]:
    """Select the rows of the project's photos, in their order; report rows without a photo."""
    row = {name: k for k, name in enumerate(poses.frame_id)}
    index = [row[name] for name in photos.frame_id if name in row]
    if not index:
        name = poses.frame_id[0]
        hint = near_miss(name, photos.frame_id)
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
