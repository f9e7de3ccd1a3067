"""Photos warped onto the ground: windows of a top view, each spot from the photo most above it."""

from __future__ import annotations

import cv2
import numpy as np

from uavgram.geometry.top_view import View
from uavgram.imaging.photo_cache import Photo, PhotoCache
from uavgram.imaging.preview import Pixels
from uavgram.imaging.warp_maps import EDGE_PX, Map, Maps, Sight, Window, look_from
from uavgram.model.arrays import Ints
from uavgram.model.ground_raster import GroundRaster

FEATHER = 0.01
"""Photos fade into each other where the tangents of their angles from the vertical differ by about
this: at 60 m above ground, over a metre or so on each side of a seam."""

FADED = 0.01
"""A photo of less weight than this beside the heaviest one does not show."""

REACH = -FEATHER * float(np.log(FADED))
"""The difference of the tangents at which that is so."""

BORDER_SHARE = 0.03
"""Of a photo's shorter side is the rim in which it gives way to other photos, so that no picture
ends in a step where another goes on; elsewhere the photo most above a place wins."""

RELUCTANCE = 0.3
"""Tangent that is added half-way into that rim; it grows without end towards the border."""


def warp_window(
    view: View, raster: GroundRaster, window: Window, candidates: Ints, photos: PhotoCache
) -> Pixels:
    """(height, width, 4) RGB and opacity of a window of the top view.

    Parameters
    ----------
    view
        The photos and the ground.
    raster
        The top view.
    window
        The part of it that is asked for.
    candidates
        Photos of the view that may show it.
    photos
        By index of the view.
    """
    width, height = window[2:]
    sights = _nearest(look_from(view, raster, window, candidates), _rim_px(view))
    if len(sights) == 1 and sights[0].within(EDGE_PX):
        return _sample(photos(sights[0].index), *sights[0].pixel_maps())
    shots = [maps for maps in (sight.maps() for sight in sights) if maps.shown.any()]
    if not shots:
        return np.zeros((height, width, 4), np.uint8)
    if len(shots) > 1:
        return _blend(shots, view, photos)
    out = _sample(photos(shots[0].index), shots[0].u, shots[0].v)
    out[~shots[0].shown] = 0
    return out


def _rim_px(view: View) -> float:
    camera = view.result.camera
    return BORDER_SHARE * min(camera.width_px, camera.height_px)


def _nearest(sights: list[Sight], rim_px: float) -> list[Sight]:
    """Those that are not much less above the window than others that show all of it."""
    whole = [sight for sight in sights if sight.within(rim_px)]
    if not whole:
        return sights
    least = np.min([sight.off_nadir for sight in whole], axis=0)
    with np.errstate(invalid="ignore"):
        return [sight for sight in sights if not (sight.off_nadir > least + REACH).all()]


def _sample(photo: Photo, u_px: Map, v_px: Map) -> Pixels:
    """(height, width, 4) of the photo, bilinear; its border pixels reach on beyond it."""
    if photo.scale != (1.0, 1.0):
        half = np.float32(0.5)
        u_px = (u_px + half) / np.float32(photo.scale[0]) - half
        v_px = (v_px + half) / np.float32(photo.scale[1]) - half
    warped = cv2.remap(photo.rgba, u_px, v_px, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    return np.asarray(warped, np.uint8)


def _blend(shots: list[Maps], view: View, photos: PhotoCache) -> Pixels:
    """Each spot from the photo most above it, neighbours faded into each other."""
    distance = [_distance(maps, view) for maps in shots]
    nearest = np.minimum.reduce(distance)
    shown = np.isfinite(nearest)
    nearest[~shown] = 0.0  # no infinite minus infinite
    total = np.zeros(nearest.shape, np.float32)
    picture = np.zeros((*nearest.shape, 4), np.float32)
    for maps, far in zip(shots, distance, strict=True):
        weight = np.exp((nearest - far) / np.float32(FEATHER))
        weight = np.maximum(weight - np.float32(FADED), np.float32(0.0))
        if weight.any():
            total += weight
            picture += _sample(photos(maps.index), maps.u, maps.v) * weight[..., None]
    picture /= np.maximum(total, np.float32(1e-6))[..., None]
    picture += np.float32(0.5)  # to round, not to cut
    picture[~shown] = 0.0
    return picture.astype(np.uint8)


def _distance(maps: Maps, view: View) -> Map:
    """(height, width) by which photos are ranked: the tangent from the vertical, more in the rim.

    Infinite where the photo does not show the place.
    """
    camera = view.result.camera
    half = np.float32(0.5)
    inner = np.minimum(maps.u + half, np.float32(camera.width_px) - half - maps.u)
    inner = np.minimum(inner, maps.v + half)
    inner = np.minimum(inner, np.float32(camera.height_px) - half - maps.v)
    depth = np.clip(inner / np.float32(_rim_px(view)), np.float32(1e-3), np.float32(1.0))
    far = maps.off_nadir + np.float32(RELUCTANCE) * (np.float32(1.0) / depth - np.float32(1.0))
    return np.where(maps.shown, far, np.float32(np.inf))
