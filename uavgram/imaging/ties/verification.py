"""Verification of the matches of two photos as points of one rigid, static scene.

Two tests. The lines of sight of one point and the base of the two cameras are in one plane: a match
off that plane is wrong, or its object moved across it. Within the plane a wrong match or a moving
object looks like a point of another height: so the shift of a match, after subtraction of the
ground plane's shift, must also be that of its neighbours.
"""

from __future__ import annotations

from typing import NamedTuple, cast

import cv2
import numpy as np
from scipy.spatial import cKDTree

from uavgram.model.arrays import Bools, Floats

MAX_EPIPOLAR_PX = 3.0
"""Largest distance from the epipolar line, in pixels of the reduced photo.

It is generous because a rolling shutter bends the lines.
"""

NEIGHBOURS = 16
"""Number of neighbouring matches that a shift is compared with."""

MAX_SHIFT_DIFFERENCE = 4.0, 4.0
"""Largest difference from their shift: pixels of the reduced photo, and robust sigmas."""

MAX_SHIFT_SIGMA = 15.0
"""Largest robust sigma that relief explains; above it, the matches are random."""

MIN_MATCHES = 12
"""Least number of matches of two photos that are accepted."""

MAX_TANGENT = 1.7
"""Tangent of the largest angle from the optical axis (60 degrees) at which planes are accurate."""


class Verification(NamedTuple):
    """Results of the two tests for M matches.

    Attributes
    ----------
    good
        (M,) whether each passes both.
    across_px
        (M,) signed distance from the epipolar line, less that of its neighbours: the error of the
        two places, without common errors of shutter and lens; NaN where not good.
    """

    good: Bools
    across_px: Floats


def verify_matches(one: Floats, other: Floats, focal_px: float, scale: float) -> Verification:
    """Test the matches of two photos.

    Parameters
    ----------
    one, other
        (M, 3) lines of sight in either camera, z = 1; NaN where there is none.
    focal_px
        Pixels per unit of their x and y.
    scale
        Pixels of the photo per pixel of the reduced one.
    """
    good = _usable(one) & _usable(other)
    across = np.full(len(one), np.nan)
    a, b = one[:, :2], other[:, :2]
    limit = MAX_EPIPOLAR_PX * scale / focal_px
    matrix = _essential(a[good], b[good], limit)
    if matrix is None:
        return Verification(np.zeros(len(one), np.bool_), across)
    off = _off_line(matrix, one, other)
    good &= np.abs(off) < limit
    # twice: the neighbours are better without the matches that the first pass rejects
    for _ in range(2):
        if good.sum() < MIN_MATCHES:
            return Verification(np.zeros(len(one), np.bool_), across)
        rows = np.flatnonzero(good)
        good[rows] = _like_neighbours(a[rows], b[rows], focal_px, scale)
    rows = np.flatnonzero(good)
    if len(rows) < MIN_MATCHES:
        return Verification(np.zeros(len(one), np.bool_), across)
    across[rows] = focal_px * _less_neighbours(a[rows], off[rows, None])[:, 0]
    return Verification(good, across)


def _usable(ray: Floats) -> Bools:
    with np.errstate(invalid="ignore"):
        return np.asarray(np.abs(ray[:, :2]).max(axis=1) < MAX_TANGENT)


def _essential(a: Floats, b: Floats, limit: float) -> Floats | None:
    """Estimate the essential matrix E (3, 3) with b E a = 0 for most; None for too few points."""
    if len(a) < MIN_MATCHES:
        return None
    matrix, _ = cv2.findEssentialMat(
        a, b, np.eye(3), method=cv2.USAC_ACCURATE, prob=0.9999, threshold=limit
    )
    if matrix is None or matrix.shape != (3, 3):
        return None
    return np.asarray(matrix, np.float64)


def _off_line(matrix: Floats, one: Floats, other: Floats) -> Floats:
    """Compute Sampson's signed distance (M,), in units of the plane z = 1.

    Hartley and Zisserman, Multiple View Geometry (2004), equation 11.9.
    """
    there, here = one @ matrix.T, other @ matrix
    product = (other * there).sum(axis=1)
    square = (there[:, :2] ** 2).sum(axis=1) + (here[:, :2] ** 2).sum(axis=1)
    # half the sum of squares: the distance of one place, with the other taken as exact
    return np.asarray(product / np.sqrt(np.maximum(0.5 * square, 1e-30)))


def _like_neighbours(a: Floats, b: Floats, focal_px: float, scale: float) -> Bools:
    """Mark the matches (M,) whose shift, less the plane's, is like that of their neighbours."""
    rest = b - _through_plane(a, b)
    off = focal_px * np.linalg.norm(_less_neighbours(a, rest), axis=1)
    sigma = min(1.4826 * float(np.median(off)), MAX_SHIFT_SIGMA * scale)
    return np.asarray(off < MAX_SHIFT_DIFFERENCE[0] * scale + MAX_SHIFT_DIFFERENCE[1] * sigma)


def _through_plane(a: Floats, b: Floats) -> Floats:
    """Transfer the points by the homography of the plane that most of them are near; (M, 2)."""
    # OpenCV's stubs declare a matrix; it returns None where all points are in line
    matrix = cast("Floats | None", cv2.findHomography(a, b, cv2.LMEDS)[0])
    if matrix is None:
        return np.asarray(a + np.median(b - a, axis=0))
    put = np.column_stack([a, np.ones(len(a))]) @ matrix.T
    return np.asarray(put[:, :2] / put[:, 2:])


def _less_neighbours(place: Floats, value: Floats) -> Floats:
    """Subtract from values (M, D) the median of their nearest neighbours."""
    count = min(NEIGHBOURS, len(place) - 1)
    near = np.asarray(cKDTree(place).query(place, k=count + 1)[1])
    return np.asarray(value - np.median(value[near[:, 1:]], axis=1))
