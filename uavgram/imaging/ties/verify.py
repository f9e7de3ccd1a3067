"""Which matches of two photos are of one rigid scene that stands still.

Two tests. Lines of sight of one point meet the two cameras' base in one plane: what is off that
plane is wrong, or moved across it. Along it a wrong match or a moving thing looks like a point of
another height: so the shift of a match must also be that of its neighbours, after the ground's
plane was taken off.
"""

from __future__ import annotations

from typing import NamedTuple, cast

import cv2
import numpy as np
from scipy.spatial import cKDTree

from uavgram.model.arrays import Bools, Floats

ACROSS = 3.0
"""Greatest distance from the epipolar line, in pixels of the reduced photo: generous, as a shutter
that reads row after row bends the lines."""

NEIGHBOURS = 16
"""Matches around each that its shift is compared with."""

ALONG = 4.0, 4.0
"""Greatest difference of shift from theirs: pixels of the reduced photo, and robust sigmas."""

WAVIEST = 15.0
"""Greatest robust sigma that relief explains: above it, chance brought matches together."""

FEWEST = 12
"""Matches of two photos that are worth believing."""

WIDEST = 1.7
"""Tangent of the greatest angle from the optical axis (60 degrees) at which planes are good."""


class Verified(NamedTuple):
    """What the two tests say of M matches.

    Attributes
    ----------
    good
        (M,) whether each passes both.
    across_px
        (M,) signed distance from the epipolar line, less that of its neighbours: what the two
        places are uncertain by, whatever shutter and lens do to all; NaN where not good.
    """

    good: Bools
    across_px: Floats


def verify(one: Floats, other: Floats, focal_px: float, scale: float) -> Verified:
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
    limit = ACROSS * scale / focal_px
    matrix = _essential(a[good], b[good], limit)
    if matrix is None:
        return Verified(np.zeros(len(one), np.bool_), across)
    off = _off_line(matrix, one, other)
    good &= np.abs(off) < limit
    # twice: without what the first pass takes out the neighbours are better
    for _ in range(2):
        if good.sum() < FEWEST:
            return Verified(np.zeros(len(one), np.bool_), across)
        rows = np.flatnonzero(good)
        good[rows] = _like_neighbours(a[rows], b[rows], focal_px, scale)
    rows = np.flatnonzero(good)
    if len(rows) < FEWEST:
        return Verified(np.zeros(len(one), np.bool_), across)
    across[rows] = focal_px * _less_neighbours(a[rows], off[rows, None])[:, 0]
    return Verified(good, across)


def _usable(ray: Floats) -> Bools:
    with np.errstate(invalid="ignore"):
        return np.asarray(np.abs(ray[:, :2]).max(axis=1) < WIDEST)


def _essential(a: Floats, b: Floats, limit: float) -> Floats | None:
    """(3, 3) with b E a = 0 for most; None where there are too few."""
    if len(a) < FEWEST:
        return None
    matrix, _ = cv2.findEssentialMat(
        a, b, np.eye(3), method=cv2.USAC_ACCURATE, prob=0.9999, threshold=limit
    )
    if matrix is None or matrix.shape != (3, 3):
        return None
    return np.asarray(matrix, np.float64)


def _off_line(matrix: Floats, one: Floats, other: Floats) -> Floats:
    """(M,) Sampson's signed distance, in units of the plane z = 1.

    Hartley and Zisserman, Multiple View Geometry (2004), equation 11.9.
    """
    there, here = one @ matrix.T, other @ matrix
    product = (other * there).sum(axis=1)
    square = (there[:, :2] ** 2).sum(axis=1) + (here[:, :2] ** 2).sum(axis=1)
    # half the square: the distance of one place, when the other is taken as exact
    return np.asarray(product / np.sqrt(np.maximum(0.5 * square, 1e-30)))


def _like_neighbours(a: Floats, b: Floats, focal_px: float, scale: float) -> Bools:
    """(M,) whether the shift of each match, less the plane's, is like its neighbours'."""
    rest = b - _through_plane(a, b)
    off = focal_px * np.linalg.norm(_less_neighbours(a, rest), axis=1)
    sigma = min(1.4826 * float(np.median(off)), WAVIEST * scale)
    return np.asarray(off < ALONG[0] * scale + ALONG[1] * sigma)


def _through_plane(a: Floats, b: Floats) -> Floats:
    """(M, 2) places where a plane would put the points: the one that most of them are near."""
    # OpenCV's stubs promise a matrix; it returns None where all lies in line
    matrix = cast("Floats | None", cv2.findHomography(a, b, cv2.LMEDS)[0])
    if matrix is None:
        return np.asarray(a + np.median(b - a, axis=0))
    put = np.column_stack([a, np.ones(len(a))]) @ matrix.T
    return np.asarray(put[:, :2] / put[:, 2:])


def _less_neighbours(place: Floats, value: Floats) -> Floats:
    """(M, D) values less the median of their nearest neighbours'."""
    count = min(NEIGHBOURS, len(place) - 1)
    near = np.asarray(cKDTree(place).query(place, k=count + 1)[1])
    return np.asarray(value - np.median(value[near[:, 1:]], axis=1))
