"""Decoded photos, the latest used ones, each reduced to what a top view can show of it."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Sequence
from concurrent.futures import Future
from pathlib import Path
from threading import Lock
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from uavgram.errors import InputError
from uavgram.imaging.photos.preview import Pixels, jpeg_size

CACHE_BYTES = 1_000_000_000

MARGIN_PX = 1

Map = NDArray[np.float32]

# Decoding at 1/2, 1/4 or 1/8 of the size costs a fraction of decoding all of a JPEG.
_REDUCED = {
    1: cv2.IMREAD_COLOR_RGB,
    2: cv2.IMREAD_REDUCED_COLOR_2,
    4: cv2.IMREAD_REDUCED_COLOR_4,
    8: cv2.IMREAD_REDUCED_COLOR_8,
}


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


class PhotoCache:
    """Photos by index, decoded once while they stay; for several threads.

    Parameters
    ----------
    paths
        (N,) of the photos.
    reductions
        (N,) powers of two: this many original pixels become one.
    most_bytes
        Of photos kept; one at least stays.
    """

    def __init__(
        self, paths: Sequence[str], reductions: Sequence[int], most_bytes: int = CACHE_BYTES
    ) -> None:
        self._paths, self._reductions, self._most_bytes = paths, reductions, most_bytes
        self._photos: OrderedDict[int, Future[Photo]] = OrderedDict()
        self._lock = Lock()

    def __call__(self, index: int) -> Photo:
        """Return the photo; who asks for one that is being decoded waits for that.

        Raises
        ------
        InputError
            The file cannot be read, or is no photo.
        """
        with self._lock:
            waiting = self._photos.get(index)
            if waiting is None:
                mine = self._photos[index] = Future()
            self._photos.move_to_end(index)
        if waiting is not None:
            return waiting.result()
        try:
            mine.set_result(read_photo(self._paths[index], self._reductions[index]))
        except BaseException as fault:
            mine.set_exception(fault)
            raise
        with self._lock:
            self._forget()
        return mine.result()

    def _forget(self) -> None:
        """Let go of the photos that were not used for longest."""
        there = {k: f.result() for k, f in self._photos.items() if f.done() and not f.exception()}
        size = sum(photo.rgba.nbytes for photo in there.values())
        for index in list(there)[:-1]:
            if size <= self._most_bytes:
                break
            size -= there[index].rgba.nbytes
            del self._photos[index]


def read_photo(path: str, reduction: int = 1) -> Photo:
    """Decode a photo, `reduction` by `reduction` original pixels averaged into one.

    Raises
    ------
    InputError
        The file cannot be read, or is no photo.
    """
    try:
        encoded = Path(path).read_bytes()
    except OSError as fault:
        raise InputError(path, f"cannot be read: {fault.strerror}") from fault
    size = jpeg_size(encoded)
    quick = min(reduction, max(_REDUCED)) if size else 1
    pixels = _decode(encoded, quick)
    if pixels is None:
        raise InputError(path, "is no photo that can be decoded; replace it or leave it out")
    height, width = pixels.shape[:2]
    # libjpeg's last column stands for a partial block: its pixels are as wide all the same
    scale = float(quick), float(quick)
    if reduction > quick:
        shape = -(-width * quick // reduction), -(-height * quick // reduction)
        scale = width * quick / shape[0], height * quick / shape[1]
        pixels = np.asarray(cv2.resize(pixels, shape, interpolation=cv2.INTER_AREA), np.uint8)
    return Photo(_with_margin(pixels), scale)


def _with_margin(rgb: Pixels) -> Pixels:
    """(H + 2, W + 2, 4) opaque, the outermost pixels repeated."""
    height, width = rgb.shape[:2]
    out = np.empty((height + 2 * MARGIN_PX, width + 2 * MARGIN_PX, 4), np.uint8)
    cv2.cvtColor(rgb, cv2.COLOR_RGB2RGBA, dst=out[1:-1, 1:-1])
    out[0, 1:-1], out[-1, 1:-1] = out[1, 1:-1], out[-2, 1:-1]
    out[:, 0], out[:, -1] = out[:, 1], out[:, -2]
    return out


def _decode(encoded: bytes, reduction: int) -> Pixels | None:
    """(H, W, 3) RGB."""
    flags = _REDUCED[reduction] | cv2.IMREAD_IGNORE_ORIENTATION
    try:
        pixels = cv2.imdecode(np.frombuffer(encoded, np.uint8), flags)
    except cv2.error:  # an empty buffer, or a header with absurd sizes
        return None
    if pixels is None:
        return None
    if reduction > 1:  # these flags give BGR
        cv2.cvtColor(pixels, cv2.COLOR_BGR2RGB, dst=pixels)
    return np.asarray(pixels, dtype=np.uint8)
