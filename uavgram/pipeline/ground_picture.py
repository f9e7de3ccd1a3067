"""Picture of the ground from photos, window by window of a raster."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from uavgram.geometry.ground.top_view import View
from uavgram.imaging.photos.preview import Pixels
from uavgram.imaging.top_view.brightness import PhotoCache, create_photo_cache
from uavgram.imaging.top_view.warp import Window, warp_window
from uavgram.io.exports.geotiff import WINDOW_PX
from uavgram.io.files import photo_files
from uavgram.model.arrays import Floats, Ints
from uavgram.model.maps import GroundRaster
from uavgram.pipeline.parallel import prefetch
from uavgram.stages.products.top_view import boxes, reductions


def select_photos(view: View, raster: GroundRaster, gains: Floats | None = None) -> PhotoCache:
    """Return photos of a view, no finer than a raster can show.

    Parameters
    ----------
    view
        The photos.
    raster
        The top view.
    gains
        (N,) factors of their brightness; by default unchanged.
    """
    files = photo_files(view.result.frames)
    return create_photo_cache(
        [files[i] for i in view.rows],
        reductions(view, raster).tolist(),
        gains=None if gains is None else gains.tolist(),
    )


def warp_windows(
    view: View, raster: GroundRaster, photos: PhotoCache | None = None
) -> Iterator[tuple[Window, Pixels]]:
    """Yield every window of the raster in the order of the file; a few are computed ahead.

    Parameters
    ----------
    view
        The photos and the ground.
    raster
        The top view.
    photos
        By index of the view; by default unchanged.
    """
    reach = boxes(view, raster)
    cache = select_photos(view, raster) if photos is None else photos

    def warp(window: Window) -> Pixels:
        return warp_window(view, raster, window, _select_in_window(reach, window), cache)

    windows = [
        (column, row, min(WINDOW_PX, raster.width - column), min(WINDOW_PX, raster.height - row))
        for row in range(0, raster.height, WINDOW_PX)
        for column in range(0, raster.width, WINDOW_PX)
    ]
    yield from prefetch(warp, windows)


def render_picture(view: View, raster: GroundRaster, photos: PhotoCache) -> Pixels:
    """Return RGB and opacity (H, W, 4) of a raster that fits into memory.

    Parameters
    ----------
    view
        The photos and the ground.
    raster
        The top view.
    photos
        By index of the view.
    """
    out = np.zeros((raster.height, raster.width, 4), np.uint8)
    for (column, row, width, height), pixels in warp_windows(view, raster, photos):
        out[row : row + height, column : column + width] = pixels
    return out


def _select_in_window(reach: Floats, window: Window) -> Ints:
    """Return photos that may show part of a window."""
    column, row, width, height = window
    with np.errstate(invalid="ignore"):
        touches = (
            (reach[:, 0] <= column + width)
            & (reach[:, 2] >= column)
            & (reach[:, 1] <= row + height)
            & (reach[:, 3] >= row)
        )
    return np.flatnonzero(touches)
