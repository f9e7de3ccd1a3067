"""Poses of the photos from whatever a project names in `poses`."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from uavgram.errors import InputError, near_miss
from uavgram.io.geo_txt import read_geo_txt
from uavgram.io.mrk import read_mrk
from uavgram.io.photo_tags import read_photo_tags
from uavgram.io.pose_csv import read_pose_csv
from uavgram.model.frames import Photos
from uavgram.model.message import Message
from uavgram.model.photo_poses import PhotoPoses
from uavgram.model.telemetry import HeightDatum

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
        Datum of heights in files that name none.

    Returns
    -------
    poses
        Of those photos that have one, in the order of `photos`.
    messages
        What was odd, or assumed.

    Raises
    ------
    InputError
        The source is malformed, or has a pose for none of the photos.
    """
    messages: tuple[Message, ...] = ()
    if source == FROM_PHOTOS:
        poses, messages = read_photo_tags(photos)
    elif source.lower().endswith(".mrk"):
        poses, messages = read_mrk(source, photos)
    elif source.lower().endswith(".csv"):
        poses = read_pose_csv(source, heights)
    else:
        poses, messages = read_geo_txt(source, heights)
    if poses.datum_guess:
        text = (
            f"Heights of {poses.source} were taken as "
            f"{'above sea level' if poses.datum == 'msl' else 'ellipsoidal'}: {poses.datum_guess}."
        )
        messages = (*messages, Message("info", "height-datum-assumed", text))
    chosen, more = _of_photos(source, poses, photos)
    return chosen, (*messages, *more)


def _of_photos(
    source: str, poses: PhotoPoses, photos: Photos
) -> tuple[PhotoPoses, tuple[Message, ...]]:
    """Rows of the project's photos, in their order; what has no photo is said."""
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
