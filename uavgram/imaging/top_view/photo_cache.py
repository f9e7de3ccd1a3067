"""Decoded photos, the latest used ones, each reduced to what a top view can show of it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from uavgram.imaging.photos.cache import LruCache
from uavgram.imaging.photos.decode import read_reduced
from uavgram.imaging.photos.preview import Pixels

CACHE_BYTES = 1_000_000_000

MARGIN_PX = 1

Map = NDArray[np.float32]

QUICKEST = 8
"""Decoding at 1/2, 1/4 or 1/8 of the size costs a fraction of decoding all of a JPEG."""


class Photo(NamedTuple):
    """A decoded photo in the orientation of the stored pixels.

    Attributes
    ----------
    rgba
        (H + 2, W + 2, 4), opaque; its outermost pixels stand twice, so that who samples within half
        a pixel of the border finds neighbours.
    scale
        Original pixels per pixel along u and v. With (0, 0) the centre of the top-left pixel in
        both: original = (reduced + 0.5) * scale - 0.5.
    """

    rgba: Pixels
    scale: tuple[float, float]

    def sample(self, u_px: Map, v_px: Map) -> Pixels:
        """(h, w, 4) bilinear, at original pixels (h, w) up to half a pixel beyond the outermost."""
        across, down = np.float32(1.0 / self.scale[0]), np.float32(1.0 / self.scale[1])
        margin, half = np.float32(MARGIN_PX), np.float32(0.5)
        # (u + half) / scale - half + margin
        u = u_px * across + (half * across - half + margin)
        v = v_px * down + (half * down - half + margin)
        # a constant beyond the border is OpenCV's quickest way, and is never met
        return np.asarray(cv2.remap(self.rgba, u, v, cv2.INTER_LINEAR), np.uint8)


PhotoCache = LruCache[int, Photo]
"""Photos by index, decoded once while they stay; for several threads."""


def photo_cache(
    paths: Sequence[str],
    reductions: Sequence[int],
    most_bytes: int = CACHE_BYTES,
    gains: Sequence[float] | None = None,
) -> PhotoCache:
    """Photos that are decoded when they are asked for.

    Parameters
    ----------
    paths
        (N,) of the photos.
    reductions
        (N,) powers of two: this many original pixels become one.
    most_bytes
        Of photos kept; one at least stays.
    gains
        (N,) factors of their brightness; by default they stay as they are.
    """

    def read(k: int) -> Photo:
        photo = read_photo(paths[k], reductions[k])
        return photo if gains is None else photo._replace(rgba=lit(photo.rgba, gains[k]))

    return LruCache(read, lambda photo: photo.rgba.nbytes, most_bytes)


def lit(rgba: Pixels, gain: float) -> Pixels:
    """(H, W, 4) with red, green and blue times a gain.

    Parameters
    ----------
    rgba
        RGB and opacity.
    gain
        Of the colours.
    """
    table = np.clip(np.arange(256.0) * gain + 0.5, 0, 255).astype(np.uint8)
    opacity = np.arange(256, dtype=np.uint8)
    tables = np.stack([table, table, table, opacity], axis=-1)[None]
    return np.asarray(cv2.LUT(rgba, tables), np.uint8)


def read_photo(path: str, reduction: int = 1) -> Photo:
    """Decode a photo, `reduction` by `reduction` original pixels averaged into one.

    Raises
    ------
    InputError
        The file cannot be read, or is no photo.
    """
    pixels, quick = read_reduced(path, lambda _: min(reduction, QUICKEST))
    height, width = pixels.shape[:2]
    # libjpeg's last column stands for a partial block: its pixels are as wide all the same
    scale = float(quick), float(quick)
    if reduction > quick:
        shape = -(-width * quick // reduction), -(-height * quick // reduction)
        scale = width * quick / shape[0], height * quick / shape[1]
        pixels = np.asarray(cv2.resize(pixels, shape, interpolation=cv2.INTER_AREA), np.uint8)
    return Photo(_with_margin(pixels), scale)


def _with_margin(bgr: Pixels) -> Pixels:
    """(H + 2, W + 2, 4) RGB and opacity, the outermost pixels repeated."""
    height, width = bgr.shape[:2]
    out = np.empty((height + 2 * MARGIN_PX, width + 2 * MARGIN_PX, 4), np.uint8)
    cv2.cvtColor(bgr, cv2.COLOR_BGR2RGBA, dst=out[1:-1, 1:-1])
    out[0, 1:-1], out[-1, 1:-1] = out[1, 1:-1], out[-2, 1:-1]
    out[:, 0], out[:, -1] = out[:, 1], out[:, -2]
    return out
