"""Photos as tiles: decoded once, never turned, reduced by exact halves, cut when asked for.

Level 0 is the photo; a pixel of level k is the mean of 2^k x 2^k pixels of the photo. Odd edges
are repeated, so that pixel (i, j) of every level covers the same part of the photo everywhere:
resizing to half of an odd width would stretch the picture by a pixel along its width.
"""

from __future__ import annotations

import os
import threading
import time
from collections import OrderedDict
from collections.abc import Callable, Hashable
from concurrent.futures import Future
from dataclasses import dataclass
from pathlib import Path
from typing import Generic, TypeVar

import cv2
import numpy as np
from numpy.typing import NDArray

from uavgram.errors import InputError

Pixels = NDArray[np.uint8]

TILE_PX = 512
TILE_QUALITY = 95
SMALLEST_LEVEL_PX = 256
"""A level whose longer side is at most this needs no further reduction."""

FIRST_COARSE = 3
"""The first level that is kept; finer ones are made of the photo when they are asked for."""

IN_USE_S = 10.0
"""A value that was asked for so short a time ago may be asked for again at once."""

_STRIP_PX = 512  # a multiple of 2**FIRST_COARSE

Key = TypeVar("Key", bound=Hashable)
Value = TypeVar("Value")

_AS_STORED = cv2.IMREAD_COLOR | cv2.IMREAD_IGNORE_ORIENTATION
# 4:4:4: colour at full resolution, or thin coloured marks smear over their neighbours.
_TILE_CODING = [
    cv2.IMWRITE_JPEG_QUALITY,
    TILE_QUALITY,
    cv2.IMWRITE_JPEG_SAMPLING_FACTOR,
    cv2.IMWRITE_JPEG_SAMPLING_FACTOR_444,
]


@dataclass(frozen=True, eq=False)
class Pyramid:
    """A photo and its reductions.

    Attributes
    ----------
    photo
        (height, width, 3) BGR: level 0.
    coarse
        Levels `FIRST_COARSE` and up. Those between are made of the photo a tile at a time: kept,
        they would take a third as much memory as the photo again.
    """

    photo: Pixels
    coarse: tuple[Pixels, ...]

    @property
    def size_bytes(self) -> int:
        """Memory it takes."""
        return self.photo.nbytes + sum(level.nbytes for level in self.coarse)

    def tile(self, level: int, column: int, row: int) -> bytes | None:
        """JPEG of one tile; None where the pyramid has none. Edge tiles are smaller."""
        height, width = self.photo.shape[:2]
        if not 0 <= level < level_count(width, height):
            return None
        left, top = column * TILE_PX, row * TILE_PX
        if not (0 <= left << level < width and 0 <= top << level < height):
            return None
        if level >= FIRST_COARSE:
            part = self.coarse[level - FIRST_COARSE][top : top + TILE_PX, left : left + TILE_PX]
        else:
            left, top, side = left << level, top << level, TILE_PX << level
            part = reduced(self.photo[top : top + side, left : left + side], level)
        return cv2.imencode(".jpg", part, _TILE_CODING)[1].tobytes()


def level_count(width_px: int, height_px: int) -> int:
    """How many levels a photo of that size has."""
    count, longer = 1, max(width_px, height_px)
    while longer > SMALLEST_LEVEL_PX:
        count, longer = count + 1, (longer + 1) // 2
    return count


def read_pyramid(path: str | os.PathLike[str], size_px: tuple[int, int] | None = None) -> Pyramid:
    """Decode a photo as it is stored, whatever its EXIF orientation says, and reduce it.

    Parameters
    ----------
    path
        The file.
    size_px
        Its width and height as stored, where they are known: decoding takes half the memory then.

    Raises
    ------
    InputError
        The file cannot be read, or is no photo.
    """
    decoded = None
    if size_px is not None and os.access(path, os.R_OK):
        decoded = _decoded_into(path, *size_px)
    if decoded is None:
        decoded = _decoded(path)
    return pyramid_of(decoded)


def _decoded(path: str | os.PathLike[str]) -> Pixels:
    try:
        encoded = np.fromfile(Path(path), np.uint8)
    except OSError as fault:
        raise InputError(path, f"cannot be read: {fault.strerror}") from fault
    try:
        pixels = cv2.imdecode(encoded, _AS_STORED)
    except cv2.error:  # an empty file, or a header with absurd sizes
        pixels = None
    if pixels is None:
        raise InputError(path, "is no photo that can be decoded; replace it or leave it out")
    return np.asarray(pixels, dtype=np.uint8)


def _decoded_into(path: str | os.PathLike[str], width: int, height: int) -> Pixels | None:
    """Decode into an array that is there already; None where that does not work.

    `imdecode` and `imread` alone fill an array of their own and copy it. A file that cannot be
    read leaves the array as it was, without a word: so its last row says whether it was filled.
    """
    pixels = np.empty((height, width, 3), np.uint8)
    pixels[-1] = untouched = np.random.default_rng(0).integers(0, 256, (width, 3), np.uint8)
    try:
        found = cv2.imread(os.fspath(path), pixels, _AS_STORED)
    except cv2.error:
        return None
    if found is None or found.shape != pixels.shape or np.array_equal(found[-1], untouched):
        return None
    return np.asarray(found, dtype=np.uint8)


def pyramid_of(pixels: Pixels) -> Pyramid:
    """Reduce a decoded photo (height, width, 3) by halves."""
    height, width = pixels.shape[:2]
    count = level_count(width, height)
    if count <= FIRST_COARSE:
        return Pyramid(pixels, ())
    # In strips, which need no room for the levels between.
    strips = [
        reduced(pixels[top : top + _STRIP_PX], FIRST_COARSE) for top in range(0, height, _STRIP_PX)
    ]
    coarse = [np.vstack(strips)]
    for _ in range(FIRST_COARSE + 1, count):
        coarse.append(half(coarse[-1]))
    return Pyramid(pixels, tuple(coarse))


def reduced(pixels: Pixels, level: int) -> Pixels:
    """Halve as often as `level` says.

    A part of a photo that begins at a multiple of ``2**level`` gives the same pixels as the whole.
    """
    for _ in range(level):
        pixels = half(pixels)
    return pixels


def half(pixels: Pixels) -> Pixels:
    """Means of 2 x 2 pixels, odd edges repeated."""
    height, width = pixels.shape[:2]
    even = pixels
    if height % 2 or width % 2:
        even = np.asarray(
            cv2.copyMakeBorder(pixels, 0, height % 2, 0, width % 2, cv2.BORDER_REPLICATE),
            dtype=np.uint8,
        )
    size = ((width + 1) // 2, (height + 1) // 2)
    # INTER_AREA at exactly one half is the mean of 2 x 2 pixels, rounded.
    return np.asarray(cv2.resize(even, size, interpolation=cv2.INTER_AREA), dtype=np.uint8)


class Kept(Generic[Key, Value]):
    """Values kept as long as they fit: made once each, the longest unused go first.

    Threads that ask for the same value at the same time share the making of it. What is asked for
    is kept even where it is larger than the bound by itself.

    Parameters
    ----------
    make
        Makes a value.
    size_bytes
        Of a value.
    most_bytes
        That all kept values may take together.
    in_use
        So many values that were asked for within `IN_USE_S` are kept whatever they take: photos
        that are looked at side by side would else be decoded in turn, again and again.
    """

    def __init__(
        self,
        make: Callable[[Key], Value],
        size_bytes: Callable[[Value], int],
        most_bytes: int,
        in_use: int = 1,
    ) -> None:
        self._make = make
        self._size_bytes = size_bytes
        self._most_bytes = most_bytes
        self._in_use = in_use
        self._lock = threading.Lock()
        self._kept: OrderedDict[Key, Future[Value]] = OrderedDict()
        self._asked_s: dict[Key, float] = {}

    def get(self, key: Key) -> Value:
        """The value of a key, made now if it must be; errors of its making are raised anew."""
        with self._lock:
            future = self._kept.get(key)
            mine = future is None
            if future is None:
                future = self._kept[key] = Future()
            self._kept.move_to_end(key)
            self._asked_s[key] = time.monotonic()
        if not mine:
            return future.result()
        try:
            future.set_result(self._make(key))
        except BaseException as fault:
            with self._lock:
                self._kept.pop(key, None)
                self._asked_s.pop(key, None)
            future.set_exception(fault)
            raise
        self._trim()
        return future.result()

    def _trim(self) -> None:
        with self._lock:
            done = [(k, f.result()) for k, f in self._kept.items() if f.done()]
            total = sum(self._size_bytes(value) for _, value in done)
            since = time.monotonic() - IN_USE_S
            for left, (key, value) in zip(range(len(done), 0, -1), done[:-1], strict=False):
                used = left <= self._in_use and self._asked_s[key] >= since
                if total <= self._most_bytes or used:
                    return
                total -= self._size_bytes(value)
                del self._kept[key], self._asked_s[key]
