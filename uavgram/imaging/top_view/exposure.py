"""Equalisation of the brightness of a top view's photos, from small copies of them."""

from __future__ import annotations

import numpy as np

from uavgram.geometry.ground.top_view import View
from uavgram.imaging.top_view.gains import Light, gains_between, light_at
from uavgram.imaging.top_view.photo_cache import PhotoCache
from uavgram.model.arrays import Floats
from uavgram.model.maps import GroundRaster

NODES = 96
"""Number of nodes along the longer side of the ground at which photos are compared."""


def exposure_gains(view: View, raster: GroundRaster, photos: PhotoCache) -> Floats:
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
    coarse = raster.coarser(max(max(raster.width, raster.height) // NODES, 1))
    world = view.ground(coarse, np.arange(float(coarse.width)), np.arange(float(coarse.height)))
    seen = {k: light for k in range(len(view.rows)) if (light := _light(view, k, world, photos))}
    return gains_between(seen, len(view.rows))


def _light(view: View, index: int, world: Floats, photos: PhotoCache) -> Light | None:
    """Sample a photo's brightness at the nodes; None where it shows none of them."""
    pixel, off_nadir = view.look(index, world)
    shown = view.shows(pixel[..., 0], pixel[..., 1], off_nadir)
    if not shown.any():
        return None
    at = np.flatnonzero(shown)
    u, v = (pixel[..., k].reshape(-1)[at].astype(np.float32)[:, None] for k in range(2))
    return light_at(at, photos.get(index).sample(u, v)[:, 0, :3])
