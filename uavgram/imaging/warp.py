"""Photos warped onto the ground: windows of a top view, each spot from the photo most above it."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from threading import Lock

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from uavgram.errors import InputError
from uavgram.geometry.top_view import View
from uavgram.imaging.preview import Pixels
from uavgram.model.arrays import Floats, Ints
from uavgram.model.ground_raster import GroundRaster

NODE_STEP_PX = 16
"""Between the pixels of the top view whose place in the photos is computed; a cubic spline between
them is good to a thousandth of a pixel, for a lens and a perspective are smooth."""

FEATHER = 0.01
"""Photos fade into each other where the tangents of their angles from the vertical differ by about
this: at 60 m above ground, over a metre or so on each side of a seam."""

FADED = 0.01
"""A photo of less weight than this does not show."""

BORDER_PX = 16.0
"""Over which a photo fades out towards its own border."""

CACHE_BYTES = 1_000_000_000

Weights = NDArray[np.float32]

Window = tuple[int, int, int, int]
"""First column, first row, width, height."""


class PhotoCache:
    """Decoded photos (RGB, unrotated), the latest used ones, up to `CACHE_BYTES`.

    Parameters
    ----------
    paths
        Of the photos, by the index under which they are asked for.
    """

    def __init__(self, paths: Sequence[str]) -> None:
        self._paths = paths
        self._photos: OrderedDict[int, Pixels] = OrderedDict()
        self._lock = Lock()

    def __call__(self, index: int) -> Pixels:
        """(H, W, 3) the photo; decoded once while it stays."""
        with self._lock:
            if index in self._photos:
                self._photos.move_to_end(index)
                return self._photos[index]
            photo = read_photo(self._paths[index])
            self._photos[index] = photo
            while sum(p.nbytes for p in self._photos.values()) > CACHE_BYTES:
                if len(self._photos) == 1:
                    break
                self._photos.popitem(last=False)
            return photo


def read_photo(path: str) -> Pixels:
    """(H, W, 3) RGB in the orientation of the stored pixels.

    Raises
    ------
    InputError
        The file cannot be read, or is no photo.
    """
    try:
        encoded = np.frombuffer(Path(path).read_bytes(), np.uint8)
    except OSError as fault:
        raise InputError(path, f"cannot be read: {fault.strerror}") from fault
    flags = cv2.IMREAD_COLOR_RGB | cv2.IMREAD_IGNORE_ORIENTATION
    photo = cv2.imdecode(encoded, flags) if encoded.size else None
    if photo is None:
        raise InputError(path, "is no photo that can be decoded; replace it or leave it out")
    return np.asarray(photo, dtype=np.uint8)


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
    _, _, width, height = window
    shots = _shots(view, raster, window, candidates)
    out = np.zeros((height, width, 4), np.uint8)
    if not shots:
        return out
    nearest = np.min([shot.off_nadir for shot in shots], axis=0)
    total = np.zeros((height, width), np.float32)
    layers: list[tuple[Pixels, Weights]] = []
    for shot in shots:
        photo = photos(shot.index)
        weight = _weight(shot, nearest, photo.shape)
        if weight.any():
            warped = cv2.remap(
                photo, shot.u, shot.v, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE
            )
            layers.append((np.asarray(warped, np.uint8), weight))
            total += weight
    shown = total > 0
    if len(layers) == 1:
        out[..., :3] = layers[0][0]
    elif layers:
        share = np.float32(1.0) / np.maximum(total, np.float32(1e-6))
        blended = np.full((height, width, 3), 0.5, np.float32)  # to round, not to cut
        for warped, weight in layers:
            blended += warped * (weight * share)[..., None]
        out[..., :3] = blended
    out[~shown] = 0
    out[..., 3] = np.where(shown, 255, 0)
    return out


@dataclass(frozen=True, eq=False)
class _Shot:
    """Where every pixel of a window lies in one photo, and how far from its nadir."""

    index: int
    u: Weights
    v: Weights
    off_nadir: Weights  # infinite where the photo does not show the place


def _shots(view: View, raster: GroundRaster, window: Window, candidates: Ints) -> list[_Shot]:
    """Photos that show some of the window from nearly the least angle."""
    column, row, width, height = window
    world = view.ground(raster, column + _nodes(width), row + _nodes(height))
    looks = {int(k): view.look(int(k), world) for k in candidates}
    seen = {k: view.shows(pixel[..., 0], pixel[..., 1], off) for k, (pixel, off) in looks.items()}
    if any(shown.all() for shown in seen.values()):
        angle = {k: np.where(seen[k], off_nadir, np.inf) for k, (_, off_nadir) in looks.items()}
        reach = np.min(list(angle.values()), axis=0) - FEATHER * np.log(FADED)
        looks = {k: look for k, look in looks.items() if (angle[k] <= reach).any()}
    across, down = _spline(width), _spline(height)
    shots, exact = [], None
    for k, (pixel, off_nadir) in looks.items():
        fields = [pixel[..., 0], pixel[..., 1], off_nadir]
        if np.isfinite(fields).all():
            fields = [down @ field @ across.T for field in fields]
        else:  # the lens model, or the ground below, ends within the window: compute every pixel
            if exact is None:
                columns, rows = np.arange(float(width)), np.arange(float(height))
                exact = view.ground(raster, column + columns, row + rows)
            each_pixel, off = view.look(k, exact)
            fields = [each_pixel[..., 0], each_pixel[..., 1], off]
        off = np.where(view.shows(*fields), fields[2], np.inf)
        u, v, tangent = (np.asarray(field, np.float32) for field in (fields[0], fields[1], off))
        shots.append(_Shot(k, u, v, tangent))
    return shots


def _nodes(size: int) -> Floats:
    """Pixels along one side at which places are computed, the last one on or beyond the end."""
    count = max(4, -(-(size - 1) // NODE_STEP_PX) + 1)  # a cubic needs four
    return np.arange(count, dtype=np.float64) * NODE_STEP_PX


@lru_cache(maxsize=16)
def _spline(size: int) -> Floats:
    """(size, nodes) what each node contributes to each pixel of a side."""
    nodes = _nodes(size)
    return np.asarray(CubicSpline(nodes, np.eye(len(nodes)))(np.arange(size)))


def _weight(shot: _Shot, nearest: Weights, shape: tuple[int, ...]) -> Weights:
    """One where a photo is the most above, falling to nothing behind a seam and at its border."""
    u, v = shot.u, shot.v
    inner = np.minimum(u + 0.5, shape[1] - 0.5 - u)
    inner = np.minimum(inner, np.minimum(v + 0.5, shape[0] - 0.5 - v))
    border = np.clip(inner / np.float32(BORDER_PX), 1e-3, 1.0)
    with np.errstate(invalid="ignore"):  # infinite minus infinite where no photo looks
        nearness = np.exp((nearest - shot.off_nadir) / np.float32(FEATHER))
    return np.asarray(np.where(nearness > FADED, nearness * border, 0.0), np.float32)
