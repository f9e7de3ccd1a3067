"""Photos evened out in brightness: one gain for each, from what they show of the same ground."""

from __future__ import annotations

from itertools import combinations

import numpy as np

from uavgram.geometry.ground.top_view import View
from uavgram.imaging.top_view.photo_cache import PhotoCache
from uavgram.model.arrays import Floats
from uavgram.model.maps.raster import GroundRaster

NODES = 96
"""Along the longer side of the ground where photos are compared."""

LEAST_GREY, MOST_GREY = 8.0, 247.0
"""What is darker or brighter says nothing of the light: it may be cut off."""

LEAST_NODES = 12
"""Two photos are compared where they show so many nodes together."""

MOST_GAIN = 2.5


def exposure_gains(view: View, raster: GroundRaster, photos: PhotoCache) -> Floats:
    """(N,) factors of the photos' brightness that make them alike where they show the same.

    Least squares on logarithms: the difference of the gains of two photos is the median ratio of
    what they show of the same ground, weighted by how much that is. Their mean stays as it is: a
    weak observation of each gain as one.

    Parameters
    ----------
    view
        The photos.
    raster
        The ground to be shown.
    photos
        By index of the view; small ones are enough.
    """
    coarse = raster.coarser(max(max(raster.width, raster.height) // NODES, 1))
    world = view.ground(coarse, np.arange(float(coarse.width)), np.arange(float(coarse.height)))
    seen = {k: light for k in range(len(view.rows)) if (light := _light(view, k, world, photos))}
    normal, right = np.eye(len(view.rows)), np.zeros(len(view.rows))
    for a, b in combinations(seen, 2):
        (at_a, log_a), (at_b, log_b) = seen[a], seen[b]
        both, in_a, in_b = np.intersect1d(at_a, at_b, assume_unique=True, return_indices=True)
        if len(both) < LEAST_NODES:
            continue
        difference, weight = float(np.median(log_b[in_b] - log_a[in_a])), float(len(both))
        normal[[a, b], [a, b]] += weight
        normal[[a, b], [b, a]] -= weight
        right[a] += weight * difference
        right[b] -= weight * difference
    gains = np.exp(np.linalg.solve(normal, right))
    return np.asarray(np.clip(gains, 1.0 / MOST_GAIN, MOST_GAIN))


def _light(
    view: View, index: int, world: Floats, photos: PhotoCache
) -> tuple[np.ndarray[tuple[int], np.dtype[np.intp]], Floats] | None:
    """Nodes that a photo shows, and the logarithm of its grey value there; None where none."""
    pixel, off_nadir = view.look(index, world)
    shown = view.shows(pixel[..., 0], pixel[..., 1], off_nadir)
    if not shown.any():
        return None
    at = np.flatnonzero(shown)
    u, v = (pixel[..., k].reshape(-1)[at].astype(np.float32)[:, None] for k in range(2))
    grey = photos.get(index).sample(u, v)[:, 0, :3].mean(axis=1)
    good = (grey > LEAST_GREY) & (grey < MOST_GREY)
    return at[good], np.log(grey[good])
