"""Resampling of small parts of photos, and their slopes.

Parts of two photos that are compared pixel by pixel are resampled to one geometry. Its axes are
those in which one photo is a stretched picture of the other (the singular vectors of the affine
map), and along each axis the steps are the pixels of the coarser photo. So nothing is interpolated
between coarse pixels, and the finer photo is smoothed before pixels are left out.
"""

from __future__ import annotations

from typing import NamedTuple, TypeVar

import cv2
import numpy as np
from numpy.typing import NDArray

from uavgram.imaging.raster import Image
from uavgram.model.arrays import Bools, Floats

Grey = NDArray[np.float32]
Real = TypeVar("Real", np.float32, np.float64)

_BLUR_PX = 0.7  # blur of a photo: lens, pixel and demosaicing together
_FINE_ENOUGH = 1.15  # steps up to this are sampled without smoothing
_MOST_ROWS = 30000  # of a map for OpenCV's resampling


def make_grid(reach: int) -> Floats:
    """Return the ((2 reach + 1)^2, 2) steps about a pixel."""
    side = np.arange(-reach, reach + 1.0)
    return np.asarray(np.stack(np.meshgrid(side, side), axis=-1).reshape(-1, 2))


def sample_grey(
    photo: Image | Grey, u_px: Floats | Grey, v_px: Floats | Grey, kernel: int = cv2.INTER_CUBIC
) -> Grey:
    """Resample grey values (n, k) at places, to 1/32 px; edge values continue outside the photo.

    Parameters
    ----------
    photo
        (height, width).
    u_px, v_px
        (n, k).
    kernel
        OpenCV's interpolation.
    """
    u, v = (np.ascontiguousarray(one, np.float32) for one in (u_px, v_px))
    out = np.empty(u.shape, photo.dtype)
    for first in range(0, len(u), _MOST_ROWS):
        some = slice(first, first + _MOST_ROWS)
        cv2.remap(photo, u[some], v[some], kernel, out[some], cv2.BORDER_REPLICATE)
    return out.astype(np.float32, copy=False)


def compute_slopes(grey: NDArray[Real]) -> tuple[NDArray[Real], NDArray[Real]]:
    """Compute central differences (n, h - 2, w - 2) of grey values (n, h, w) along u and v."""
    across = 0.5 * (grey[:, 1:-1, 2:] - grey[:, 1:-1, :-2])
    down = 0.5 * (grey[:, 2:, 1:-1] - grey[:, :-2, 1:-1])
    return across, down


class Frames(NamedTuple):
    """Derivatives (n, 2, 2) of both photos' pixels by steps of the common window."""

    source: Floats
    target: Floats


def compute_common_frames(affine: Floats) -> Frames:
    """Compute the windows' axes for maps (n, 2, 2), d target pixel / d source pixel."""
    u, stretch, vt = np.linalg.svd(affine)
    source = np.swapaxes(vt, 1, 2) * np.maximum(1.0, 1.0 / stretch)[:, None]
    target = u * np.maximum(1.0, stretch)[:, None]
    # Turn the axes so that the source stays upright: then squares of all pairs cover the same
    # surroundings.
    turn = _nearest_turn(vt)
    return Frames(source @ turn, target @ turn)


def _nearest_turn(vt: Floats) -> Floats:
    """Find the quarter turns and flips that bring axes (n, 2, 2) nearest to upright."""
    swap = np.abs(vt[:, 0, 0]) < np.abs(vt[:, 0, 1])
    turn = np.where(swap[:, None, None], np.array([[0.0, 1.0], [1.0, 0.0]]), np.eye(2))
    upright = np.swapaxes(vt, 1, 2) @ turn
    sign = np.sign(np.diagonal(upright, axis1=1, axis2=2))
    return np.asarray(turn * np.where(sign == 0, 1.0, sign)[:, None])


def is_within_photo(photo: Image, center_px: Floats, frame: Floats, half: int) -> Bools:
    """Mark the windows (n,) that are completely within a photo.

    Parameters
    ----------
    photo
        (height, width).
    center_px
        (n, 2) centres of the windows.
    frame
        (n, 2, 2) pixels by steps.
    half
        Half a window's side, in steps.
    """
    far = np.abs(frame).sum(axis=2) * half + 1.0
    edge = np.array(photo.shape[1::-1]) - 1.0
    return np.asarray(((center_px - far >= 0) & (center_px + far <= edge)).all(axis=1))


def sample_window(
    photo: Image, center_px: Floats, frame: Floats, half: int, *, exact: bool = True
) -> Grey:
    """Resample grey values (2 half + 1, 2 half + 1) about a place; edge values continue outside.

    Parameters
    ----------
    photo
        (height, width).
    center_px
        (2,) centre of the window.
    frame
        (2, 2) pixels by steps; its columns are perpendicular.
    half
        Half the window's side, in steps.
    exact
        Whether to use Lanczos' kernel, instead of bilinear interpolation for a search.
    """
    length = np.hypot(frame[0], frame[1])
    # Coarse steps: sample at a fraction of a step, smooth by a Gaussian, then take every p-th
    # value.
    parts = np.maximum(np.ceil(length - _FINE_ENOUGH + 1.0), 1.0).astype(int)
    spread = _BLUR_PX * np.sqrt(np.maximum(length**2 - 1.0, 0.0)) * parts / length
    wide = np.where(parts > 1, np.ceil(3.0 * spread), 0.0).astype(int)
    x, y = (
        (np.arange(2 * (half * p + w) + 1) - float(half * p + w)).astype(np.float32) / np.float32(p)
        for p, w in zip(parts, wide, strict=True)
    )
    corner = np.floor(center_px - np.abs(frame) @ [x[-1], y[-1]]).astype(int) - 5
    beyond = np.ceil(center_px + np.abs(frame) @ [x[-1], y[-1]]).astype(int) + 6
    corner, beyond = np.maximum(corner, 0), np.minimum(beyond, photo.shape[1::-1])
    if (beyond <= corner).any():
        return np.zeros((2 * half + 1, 2 * half + 1), np.float32)
    part = photo[corner[1] : beyond[1], corner[0] : beyond[0]].astype(np.float32)
    f, at = frame.astype(np.float32), (center_px - corner).astype(np.float32)
    u = (at[0] + f[0, 0] * x) + f[0, 1] * y[:, None]
    v = (at[1] + f[1, 0] * x) + f[1, 1] * y[:, None]
    kernel = cv2.INTER_LANCZOS4 if exact else cv2.INTER_LINEAR
    dense = sample_grey(part, u, v, kernel)
    if (parts > 1).any():
        bells = [_bell(s, int(w)) for s, w in zip(spread, wide, strict=True)]
        dense = np.asarray(cv2.sepFilter2D(dense, -1, bells[0], bells[1]), np.float32)
        dense = dense[wide[1] : dense.shape[0] - wide[1], wide[0] : dense.shape[1] - wide[0]]
    return np.ascontiguousarray(dense[:: parts[1], :: parts[0]], np.float32)


def _bell(sigma: float, wide: int) -> Grey:
    if not wide:
        return np.ones(1, np.float32)
    bell = np.exp(-0.5 * (np.arange(-wide, wide + 1) / sigma) ** 2)
    return np.asarray(bell / bell.sum(), np.float32)
