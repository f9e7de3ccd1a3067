"""Photos warped onto the ground: windows of a top view, each spot from the photo most above it."""

from __future__ import annotations

import numpy as np

from uavgram.geometry.ground.top_view import View
from uavgram.imaging.photos.preview import Pixels
from uavgram.imaging.top_view.photo_cache import Map, PhotoCache
from uavgram.imaging.top_view.warp_maps import EDGE_PX, Maps, Sight, Window, look_from
from uavgram.model.arrays import Ints
from uavgram.model.maps import GroundRaster

FEATHER = 0.01
"""Photos fade into each other where the tangents of their angles from the vertical differ by about
this: at 60 m above ground, over a metre or so on each side of a seam."""

FADED = 0.01
"""A photo of less weight than this beside the heaviest one does not show."""

REACH = -FEATHER * float(np.log(FADED))
"""The difference of the tangents at which that is so."""

BORDER_SHARE = 0.03
"""Of a photo's shorter side is the rim in which it fades into what lies below it, so that no
picture ends in a step where another goes on."""

BEHIND = 100.0
"""Tangent that is added where a photo fades out: more than any that is shown."""


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
        return photos.get(sights[0].index).sample(*sights[0].pixel_maps())
    shots = [maps for maps in (sight.maps() for sight in sights) if maps.shown.any()]
    if not shots:
        return np.zeros((height, width, 4), np.uint8)
    if len(shots) > 1:
        return _blend(shots, view, photos)
    out = photos.get(shots[0].index).sample(shots[0].u, shots[0].v)
    out.view(np.uint32)[..., 0] *= shots[0].shown  # four bytes at once
    return out


def _rim_px(view: View) -> float:
    camera = view.result.camera
    return BORDER_SHARE * min(camera.width_px, camera.height_px)


def _nearest(sights: list[Sight], rim_px: float) -> list[Sight]:
    """Those that are, somewhere, not much less above the ground than every other that shows it."""
    if len(sights) < 2:
        return sights
    least = np.full(sights[0].off_nadir.shape, np.inf)
    for sight in sights:
        solid = sight.shown_nodes(rim_px, grown=-1)
        least[solid] = np.minimum(least, sight.off_nadir)[solid]
    with np.errstate(invalid="ignore"):
        return [
            sight
            for sight in sights
            if (sight.shown_nodes(-EDGE_PX, grown=2) & ~(sight.off_nadir > least + REACH)).any()
        ]


def _blend(shots: list[Maps], view: View, photos: PhotoCache) -> Pixels:
    """Each spot from the photo most above it, neighbours faded into each other."""
    shape = shots[0].u.shape
    picture = np.zeros((*shape, 4), np.float32)
    for maps, share in zip(shots, _shares(shots, view), strict=True):
        if share.any():
            picture += photos.get(maps.index).sample(maps.u, maps.v) * share[..., None]
    picture += np.float32(0.5)  # to round, not to cut
    return picture.astype(np.uint8)


def _shares(shots: list[Maps], view: View) -> list[Map]:
    """(height, width) of each photo in each spot; they add up to one where any shows it.

    Two layers: above, photos are ranked by the angle from the vertical, and transparent in their
    rims; below, what is in a rim ranks behind everything else. So a photo fades over its whole rim
    into the one that goes on beyond it, however oblique that is.
    """
    infinite = np.float32(np.inf)
    tangent = [np.where(maps.shown, maps.off_nadir, infinite) for maps in shots]
    opacity = [_opacity(maps, view) for maps in shots]
    above = _ranked(tangent)
    if not any((over < 1).any() for over in opacity):
        return above
    behind = np.float32(BEHIND)
    below = _ranked([t + behind * (over < 1) for t, over in zip(tangent, opacity, strict=True)])
    above = [share * over for share, over in zip(above, opacity, strict=True)]
    left = np.float32(1.0) - np.sum(above, axis=0)
    return [over + left * under for over, under in zip(above, below, strict=True)]


def _ranked(distance: list[Map]) -> list[Map]:
    """Shares by distance (infinite: none): all to the least, and around a tie to both."""
    nearest = np.minimum.reduce(distance)
    nearest[~np.isfinite(nearest)] = 0.0  # no infinite minus infinite
    fade, none = np.float32(FADED), np.float32(0.0)
    weight = [
        np.maximum(np.exp((nearest - d) / np.float32(FEATHER)) - fade, none) for d in distance
    ]
    total = np.maximum(np.sum(weight, axis=0), np.float32(1e-6))
    return [each / total for each in weight]


def _opacity(maps: Maps, view: View) -> Map:
    """(height, width) one inside the rim, nothing at the photo's border and where it shows none."""
    camera, half = view.result.camera, np.float32(0.5)
    inner = np.minimum(maps.u + half, np.float32(camera.width_px) - half - maps.u)
    inner = np.minimum(inner, maps.v + half)
    inner = np.minimum(inner, np.float32(camera.height_px) - half - maps.v)
    depth = np.clip(inner / np.float32(_rim_px(view)), np.float32(0.0), np.float32(1.0))
    return np.where(maps.shown, depth, np.float32(0.0))  # NaN where the lens model has no pixel
