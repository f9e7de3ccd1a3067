"""Search for places in the photos, on all cores."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from uavgram.imaging.matching.least_squares import (
    REASON_TEXTS,
    Matches,
    RefusalReason,
    SoughtPoints,
)
from uavgram.imaging.matching.match import match_points
from uavgram.imaging.photos.cache import LruCache
from uavgram.imaging.raster import Image
from uavgram.io.photos.catalogue import read_grey
from uavgram.model.arrays import Floats, Ints, rows_of
from uavgram.pipeline.parallel import Progress, prefetch, silent

MAX_BYTES = 1_000_000_000
"""Memory for decoded photos [bytes]: fifty of 20 megapixels."""

Photos = LruCache[str, Image]
"""Grey photos by name, decoded once while they are kept."""


class Task(NamedTuple):
    """Places of one photo that are sought in another; `rows` are their numbers."""

    source: str
    target: str
    rows: Ints
    sought: SoughtPoints


def load_grey_photos(paths: Mapping[str, str]) -> Photos:
    """Return photos by name that are decoded on demand, in the stored orientation."""
    return LruCache(lambda name: read_grey(paths[name]), lambda photo: photo.nbytes, MAX_BYTES)


def group_by_photos(
    source: Sequence[str], target: Sequence[str], sought: SoughtPoints
) -> list[Task]:
    """Group places (n,) by photos, so that neighbours in the list share a photo.

    Parameters
    ----------
    source, target
        (n,) photo of the pick, and photo to search.
    sought
        The places.
    """
    groups: dict[tuple[str, str], list[int]] = {}
    for row, pair in enumerate(zip(target, source, strict=True)):
        groups.setdefault(pair, []).append(row)
    return [
        Task(here, there, np.array(rows), replace(sought, **rows_of(sought, np.array(rows))))
        for (there, here), rows in sorted(groups.items())
    ]


def search_places(
    photos: Photos, work: Sequence[Task], count: int, progress: Progress = silent
) -> Matches:
    """Search for places, and return the finds in their order.

    Parameters
    ----------
    photos
        Grey, by name.
    work
        The places.
    count
        Number of all of them.
    progress
        Shows long loops.

    Raises
    ------
    InputError
        A photo cannot be read.
    """
    found: dict[str, Floats | Ints] = {
        "pixel_px": np.full((count, 2), np.nan),
        "covariance_px2": np.full((count, 2, 2), np.nan),
        "sigma_px": np.full(count, np.nan),
        "score": np.zeros(count),
        "refused": np.full(count, int(RefusalReason.OUTSIDE)),
    }
    done = prefetch(lambda task: _run_task(photos, task), work)
    for task, one in progress(done, "looking in the photos", len(work)):
        for name, values in found.items():
            values[task.rows] = getattr(one, name)
    return Matches(**found)  # type: ignore[arg-type]


def describe_miss(refused: int) -> str:
    """Describe why a place was not found."""
    return REASON_TEXTS[RefusalReason(refused)]


def _run_task(photos: Photos, task: Task) -> Matches:
    return match_points(photos.get(task.source), photos.get(task.target), task.sought)
