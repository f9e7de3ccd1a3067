"""Cache of decoded photos, each reduced to the resolution of a top view."""

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

MAX_FAST_REDUCTION = 8
"""Strongest reduction of the decoder: a JPEG at 1/2, 1/4 or 1/8 of its size decodes faster."""


class Photo(NamedTuple):
    """Decoded photo in the orientation of the stored pixels.

    Attributes
    ----------
    rgba
        (H + 2, W + 2, 4), opaque; its outermost pixels are repeated, so that sampling within half a
        pixel of the border finds neighbours.
    scale
        Original pixels per pixel along u and v. With (0, 0) the centre of the top-left pixel in
        both: original = (reduced + 0.5) * scale - 0.5.
    """

    rgba: Pixels
    scale: tuple[float, float]

    def sample(self, u_px: Map, v_px: Map) -> Pixels:
        """Sample (h, w, 4) bilinearly at original pixels (h, w), up to half a pixel outside."""
        across, down = np.float32(1.0 / self.scale[0]), np.float32(1.0 / self.scale[1])
        margin, half = np.float32(MARGIN_PX), np.float32(0.5)
        # (u + half) / scale - half + margin
        u = u_px * across + (half * across - half + margin)
        v = v_px * down + (half * down - half + margin)
        # a constant border is OpenCV's fastest mode; the border is never reached
        return np.asarray(cv2.remap(self.rgba, u, v, cv2.INTER_LINEAR), np.uint8)


PhotoCache = LruCache[int, Photo]
"""Photos by index, decoded once while they are kept; for several threads."""


def create_photo_cache(
    paths: Sequence[str],
    reductions: Sequence[int],
    most_bytes: int = CACHE_BYTES,
    gains: Sequence[float] | None = None,
) -> PhotoCache:
    """Create a cache of photos that are decoded on request.

    Parameters
    ----------
    paths
        (N,) of the photos.
    reductions
        (N,) powers of two: this many original pixels become one.
    most_bytes
        Memory limit of the kept photos; at least one is kept.
    gains
        (N,) factors of their brightness; by default they stay unchanged.
    """

    def read(k: int) -> Photo:
        photo = read_photo(paths[k], reductions[k])
        return photo if gains is None else photo._replace(rgba=apply_gain(photo.rgba, gains[k]))

    return LruCache(read, lambda photo: photo.rgba.nbytes, most_bytes)


def apply_gain(rgba: Pixels, gain: float) -> Pixels:
    """Multiply red, green and blue of (H, W, 4) by a gain.

    Parameters
    ----------
    rgba
        RGB and opacity.
    gain
        Factor of the colours.
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
        The file cannot be read, or is not a photo.
    """
    pixels, quick = read_reduced(path, lambda _: min(reduction, MAX_FAST_REDUCTION))
    height, width = pixels.shape[:2]
    # libjpeg's last column may cover a partial block: its pixels have the full width all the same
    scale = float(quick), float(quick)
    if reduction > quick:
        shape = -(-width * quick // reduction), -(-height * quick // reduction)
        scale = width * quick / shape[0], height * quick / shape[1]
        pixels = np.asarray(cv2.resize(pixels, shape, interpolation=cv2.INTER_AREA), np.uint8)
    return Photo(_with_margin(pixels), scale)


def _with_margin(bgr: Pixels) -> Pixels:
    """Convert to RGB and opacity (H + 2, W + 2, 4), with the outermost pixels repeated."""
    height, width = bgr.shape[:2]
    out = np.empty((height + 2 * MARGIN_PX, width + 2 * MARGIN_PX, 4), np.uint8)
    cv2.cvtColor(bgr, cv2.COLOR_BGR2RGBA, dst=out[1:-1, 1:-1])
    out[0, 1:-1], out[-1, 1:-1] = out[1, 1:-1], out[-2, 1:-1]
    out[:, 0], out[:, -1] = out[:, 1], out[:, -2]
    return out
