"""Brightness factors of photos, one for each, from the ground that several photos show."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from scipy.sparse import coo_array, triu

from uavgram.geometry.ground.top_view import View
from uavgram.imaging.photos.preview import Pixels
from uavgram.imaging.top_view.photo_cache import PhotoCache
from uavgram.model.arrays import Floats, Ints
from uavgram.model.maps import GroundRaster

LEAST_GREY, MOST_GREY = 8.0, 247.0
"""Least and largest usable grey value: darker or brighter ones may be clipped."""

MIN_PLACES = 12
"""Least number of common places for the comparison of two photos."""

MAX_GAIN = 2.5

DENSE_PHOTOS = 500
"""Number of photos up to which their factors are solved for with a full matrix."""


class Light(NamedTuple):
    """Places (n,) that a photo shows, increasing, and the logarithm of its grey value there."""

    place: Ints
    log_grey: Floats


def select_light(place: Ints, colours: Pixels | Floats) -> Light:
    """Select the (n, 3) colours at (n,) places that are not clipped."""
    grey = np.asarray(colours, dtype=np.float64).mean(axis=1)
    good = (grey > LEAST_GREY) & (grey < MOST_GREY)
    return Light(place[good], np.log(grey[good]))


def estimate_gains(seen: Mapping[int, Light], count: int) -> Floats:
    """Compute brightness factors (N,) that make photos agree where they show the same ground.

    Least squares on logarithms: the difference of the gains of two photos is the median ratio of
    their grey values at common places, weighted by their number. The mean gain is fixed by a weak
    observation of each gain as one.

    Parameters
    ----------
    seen
        Light of each photo; photos that show nothing are missing.
    count
        N, the number of all photos.
    """
    photos = list(seen)
    normal: dict[tuple[int, int], float] = {(k, k): 1.0 for k in range(count)}
    right = np.zeros(count)
    for one, other in _overlapping([seen[photo].place for photo in photos]):
        a, b = photos[one], photos[other]
        _, in_a, in_b = np.intersect1d(
            seen[a].place, seen[b].place, assume_unique=True, return_indices=True
        )
        difference = float(np.median(seen[b].log_grey[in_b] - seen[a].log_grey[in_a]))
        weight = float(len(in_a))
        # Normal equations of the observation log gain_a - log gain_b = difference.
        normal[a, a] += weight
        normal[b, b] += weight
        normal[a, b] = normal[b, a] = -weight
        right[a] += weight * difference
        right[b] -= weight * difference
    row, column = np.array(list(normal)).T.reshape(2, -1)
    whole = coo_array((list(normal.values()), (row, column)), shape=(count, count))
    gains = np.exp(_solved(whole, right))
    return np.asarray(np.clip(gains, 1.0 / MAX_GAIN, MAX_GAIN))


def _solved(whole: coo_array, right: Floats) -> Floats:
    """Solve a symmetric system (N,)."""
    if len(right) <= DENSE_PHOTOS:
        return np.asarray(np.linalg.solve(whole.toarray(), right))
    from scipy.sparse.linalg import spsolve  # noqa: PLC0415 - slow to load

    return np.asarray(spsolve(whole.tocsc(), right))


def _overlapping(places: list[Ints]) -> list[tuple[int, int]]:
    """Find the pairs of photos with enough common places: few among thousands of photos."""
    photo = np.repeat(np.arange(len(places)), [len(each) for each in places])
    place = np.concatenate([np.zeros(0, np.int64), *places])
    size = len(places), int(place.max(initial=0)) + 1
    shows = coo_array((np.ones(len(photo)), (photo, place)), shape=size).tocsr()
    # Sparse product: number of common places of each pair.
    common = triu(shows @ shows.T, 1).tocoo()
    is_enough = common.data >= MIN_PLACES
    pairs = np.column_stack([common.row, common.col])[is_enough]
    return [(int(a), int(b)) for a, b in pairs[np.lexsort((pairs[:, 1], pairs[:, 0]))]]


LIGHT_NODES = 96
"""Number of nodes along the longer side of the ground at which photos are compared."""


def estimate_exposure_gains(view: View, raster: GroundRaster, photos: PhotoCache) -> Floats:
    """Compute brightness factors (N,) that make photos agree where they show the same ground.

    Parameters
    ----------
    view
        Photos.
    raster
        Ground to be shown.
    photos
        Photos by index of the view; small ones suffice.
    """
    coarse = raster.coarser(max(max(raster.width, raster.height) // LIGHT_NODES, 1))
    world = view.ground(coarse, np.arange(float(coarse.width)), np.arange(float(coarse.height)))
    seen = {k: light for k in range(len(view.rows)) if (light := _light(view, k, world, photos))}
    return estimate_gains(seen, len(view.rows))


def _light(view: View, index: int, world: Floats, photos: PhotoCache) -> Light | None:
    """Sample a photo's brightness at the nodes; None where it shows none of them."""
    pixel, off_nadir = view.look(index, world)
    shown = view.shows(pixel[..., 0], pixel[..., 1], off_nadir)
    if not shown.any():
        return None
    at = np.flatnonzero(shown)
    u, v = (pixel[..., k].reshape(-1)[at].astype(np.float32)[:, None] for k in range(2))
    return select_light(at, photos.get(index).sample(u, v)[:, 0, :3])
