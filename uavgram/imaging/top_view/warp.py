"""Warping of photos to windows of a top view, each spot from the photo most above it."""

from __future__ import annotations

import numpy as np

from uavgram.geometry.ground.top_view import View
from uavgram.imaging.photos.preview import Pixels
from uavgram.imaging.top_view.photo_cache import Map, PhotoCache
from uavgram.imaging.top_view.warp_maps import (
    EDGE_PX,
    PhotoLattice,
    PixelMaps,
    Window,
    project_window,
)
from uavgram.model.arrays import Ints
from uavgram.model.maps import GroundRaster

FEATHER = 0.01
"""Difference of the tangents of two photos' angles from the vertical over which they are blended.

At 60 m above ground this is about a metre on each side of a seam.
"""

FADED = 0.01
"""Weight relative to the heaviest photo below which a photo does not show."""

REACH = -FEATHER * float(np.log(FADED))
"""Difference of the tangents at which the weight is `FADED`."""

BORDER_SHARE = 0.03
"""Width of the rim, as a share of a photo's shorter side, in which it is faded out.

So no picture ends abruptly where another goes on.
"""

BEHIND = 100.0
"""Tangent that is added where a photo is faded out: more than any that is shown."""


def warp_window(
    view: View, raster: GroundRaster, window: Window, candidates: Ints, photos: PhotoCache
) -> Pixels:
    """Compose a window (height, width, 4) of the top view in RGB and opacity.

    Parameters
    ----------
    view
        Photos and ground.
    raster
        Top view.
    window
        Requested part of it.
    candidates
        Photos of the view that may show it.
    photos
        Photos by index of the view.
    """
    width, height = window[2:]
    sights = _nearest(project_window(view, raster, window, candidates), _rim_px(view))
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


def _nearest(sights: list[PhotoLattice], rim_px: float) -> list[PhotoLattice]:
    """Select the photos that are somewhere nearly as much above the ground as any other."""
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


def _blend(shots: list[PixelMaps], view: View, photos: PhotoCache) -> Pixels:
    """Blend photos: each spot from the photo most above it, with a transition at seams."""
    shape = shots[0].u.shape
    picture = np.zeros((*shape, 4), np.float32)
    for maps, share in zip(shots, _shares(shots, view), strict=True):
        if share.any():
            picture += photos.get(maps.index).sample(maps.u, maps.v) * share[..., None]
    picture += np.float32(0.5)  # round to nearest
    return picture.astype(np.uint8)


def _shares(shots: list[PixelMaps], view: View) -> list[Map]:
    """Compute shares (height, width) of each photo; their sum is one where any photo shows a spot.

    There are two layers. In the upper one, photos are ranked by the angle from the vertical, and
    transparent in their rims; in the lower one, rims rank behind everything else. So a photo fades
    over its whole rim into the one that continues beyond it, at any obliqueness.
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
    """Compute shares from distances (infinite: none): all to the least, and to both near a tie."""
    nearest = np.minimum.reduce(distance)
    nearest[~np.isfinite(nearest)] = 0.0  # avoid inf - inf
    fade, none = np.float32(FADED), np.float32(0.0)
    weight = [
        np.maximum(np.exp((nearest - d) / np.float32(FEATHER)) - fade, none) for d in distance
    ]
    total = np.maximum(np.sum(weight, axis=0), np.float32(1e-6))
    return [each / total for each in weight]


def _opacity(maps: PixelMaps, view: View) -> Map:
    """Compute the opacity (height, width): 1 inside the rim, 0 at the border and where hidden."""
    camera, half = view.result.camera, np.float32(0.5)
    inner = np.minimum(maps.u + half, np.float32(camera.width_px) - half - maps.u)
    inner = np.minimum(inner, maps.v + half)
    inner = np.minimum(inner, np.float32(camera.height_px) - half - maps.v)
    depth = np.clip(inner / np.float32(_rim_px(view)), np.float32(0.0), np.float32(1.0))
    return np.where(maps.shown, depth, np.float32(0.0))  # NaN where the lens model has no pixel
