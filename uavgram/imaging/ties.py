"""Features of photos, their matches in pairs of photos, and verification as one rigid scene.

The features are OpenCV's SIFT at a reduced size. Measured on rendered streets with true poses, 2400
x 1800 px, half size: epipolar distances of matches have a median of 0.08 px looking down and 0.16
px at 45 degrees in 0.4 s a photo; pycolmap 4.2's SIFT (VLFeat) on the same reduced photos 0.13 and
0.28 px in 5.6 s.

Matches are verified by two tests. The lines of sight of one point and the base of the two cameras
are in one plane: a match off that plane is wrong, or its object moved across it. Within the plane a
wrong match or a moving object looks like a point of another height: so the shift of a match, after
subtraction of the ground plane's shift, must also be that of its neighbours.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple, cast

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from uavgram.errors import InputError
from uavgram.imaging.photos.decoding import decode_photo, find_jpeg_frame
from uavgram.imaging.raster import Image
from uavgram.model.arrays import Bools, Floats, Ints

WORKING_PX = 1600
"""Longer side of the pictures in which features are detected."""

MAX_FEATURES = 2500
"""Number of features kept in a photo, spread over it."""

CELL_PX = 80
"""Edge of the cells of the working picture over which they are spread."""

CONTRAST = 0.02
"""SIFT's contrast threshold, half the usual one.

Dark photos and asphalt have features that are weak but good.
"""

_GREY = {
    1: cv2.IMREAD_GRAYSCALE,
    2: cv2.IMREAD_REDUCED_GRAYSCALE_2,
    4: cv2.IMREAD_REDUCED_GRAYSCALE_4,
    8: cv2.IMREAD_REDUCED_GRAYSCALE_8,
}


class Features(NamedTuple):
    """N features of a photo.

    Attributes
    ----------
    pixel_px
        (N, 2) in the original photo, (0, 0) = centre of the top-left pixel.
    size_px
        (N,) diameter of each feature, in original pixels.
    descriptor
        (N, 128) SIFT descriptors.
    """

    pixel_px: Floats
    size_px: Floats
    descriptor: NDArray[np.uint8]

    def take(self, rows: Ints) -> Features:
        """Select rows."""
        return Features(self.pixel_px[rows], self.size_px[rows], self.descriptor[rows])


def read_features(path: str | os.PathLike[str]) -> Features:
    """Detect features of a photo file; EXIF rotation is not applied.

    Raises
    ------
    InputError
        The file cannot be read, or is not a photo.
    """
    try:
        encoded = Path(path).read_bytes()
    except OSError as error:
        raise InputError(path, f"cannot be read: {error.strerror}") from error
    frame = find_jpeg_frame(encoded)
    longer = 0 if frame is None else max(frame.size_px)
    reduction = max((r for r in _GREY if longer >= r * WORKING_PX), default=1)
    grey = decode_photo(path, encoded, _GREY[reduction])
    return find_features(grey, reduction)


def find_features(grey: Image, original_px: float = 1.0) -> Features:
    """Detect features of a decoded photo, spread over it.

    Parameters
    ----------
    grey
        (height, width).
    original_px
        Pixels of the original photo per pixel.
    """
    height, width = grey.shape
    shrink = min(1.0, WORKING_PX / max(height, width))
    small = max(1, round(width * shrink)), max(1, round(height * shrink))
    if shrink < 1.0:
        grey = np.asarray(cv2.resize(grey, small, interpolation=cv2.INTER_AREA), np.uint8)
    scale = np.array([width / small[0], height / small[1]]) * original_px
    sift = cv2.SIFT.create(
        contrastThreshold=CONTRAST,
        # otherwise all places are off by a quarter of a pixel, as two photos of opposite heading
        # show
        enable_precise_upscale=True,
    )
    points = sift.detect(grey)
    if not points:
        return Features(np.empty((0, 2)), np.empty(0), np.empty((0, 128), np.uint8))
    place = np.asarray(cv2.KeyPoint.convert(points), np.float64)
    rows = _spread(place, np.array([point.response for point in points], np.float64))
    # describe only the kept ones: this costs more than building the pyramid a second time
    points, described = sift.compute(grey, [points[k] for k in rows])
    # OpenCV's pixels also count from the centre of the top-left one
    place = np.array([point.pt for point in points], np.float64)
    size = np.array([point.size for point in points], np.float64)
    return Features((place + 0.5) * scale - 0.5, size * scale.mean(), described.astype(np.uint8))


def _spread(place: Floats, response: Floats) -> Ints:
    """Choose the rows of the strongest features of each cell, at most `MAX_FEATURES` in all."""
    cell = np.floor(place / CELL_PX).astype(np.int64)
    key = cell[:, 0] * 100_000 + cell[:, 1]
    order = np.lexsort((-response, key))
    starts = np.flatnonzero(np.diff(key[order], prepend=-1))
    rank = np.arange(len(order)) - np.repeat(starts, np.diff(np.append(starts, len(order))))
    # rank by rank: the strongest of every cell, then the second of every cell
    taken = order[np.lexsort((-response[order], rank))[:MAX_FEATURES]]
    return np.sort(taken)


MAX_RATIO = 0.8
"""Largest ratio of distances of best and second best match (Lowe, IJCV 60 (2004), section 7.1)."""

MAX_DISTANCE = 0.4
"""Largest squared distance of the descriptors (unit vectors) of a match.

Unrelated features are seldom nearer.
"""

SAME_PX = 3.0
"""Distance within which two features are one place, described twice: no second best."""

_NONE = np.float32(-1.0)


class Guide(NamedTuple):
    """Predicted places of the features of one photo in another.

    Attributes
    ----------
    pixel_px
        (N, 2) in the other photo; NaN where it should not show them.
    radius_px
        Largest error of the prediction.
    """

    pixel_px: Floats
    radius_px: float


def match_features(one: Features, other: Features, guide: Guide | None = None) -> Ints:
    """Match features mutually: rows (M, 2), each the other's best.

    Parameters
    ----------
    one, other
        Features of two photos.
    guide
        Predicted places of the features of `one` in the other; None: anywhere.
    """
    rows = np.arange(len(one.pixel_px))
    if guide is not None:
        rows = np.flatnonzero(np.isfinite(guide.pixel_px).all(axis=1))
    if not len(rows) or len(other.pixel_px) < 2:
        return np.empty((0, 2), np.int64)
    likeness = _normalise(one.descriptor[rows]) @ _normalise(other.descriptor).T
    nearest = _square(likeness.max(axis=1))
    if guide is not None:
        likeness[_compute_distances(guide.pixel_px[rows], other.pixel_px) > guide.radius_px**2] = (
            _NONE
        )
    here = np.arange(len(rows))
    best = likeness.argmax(axis=1)
    first = likeness[here, best].copy()
    # a column's largest value is found along the rows in memory, its row 25 times more slowly
    mutual = first == likeness.max(axis=0)[best]
    second = _find_second_best(likeness, best, other.pixel_px)
    near = _square(first)
    good = (near < MAX_RATIO**2 * _square(second)) & (near < MAX_DISTANCE) & mutual
    # where the prediction is wrong, the true match is outside the radius and much more similar
    good &= MAX_RATIO**2 * near <= nearest
    return np.stack([rows[good], best[good]], axis=1)


def _find_second_best(
    likeness: NDArray[np.float32], best: Ints, place: Floats
) -> NDArray[np.float32]:
    """Find the similarity (N,) of the best feature at another place; overwrites `likeness`."""
    second = np.empty(len(best), np.float32)
    left, trial = np.arange(len(best)), best
    for _ in range(4):  # a place has at most a few descriptors
        likeness[left, trial] = _NONE
        trial = (likeness if len(left) == len(best) else likeness[left]).argmax(axis=1)
        second[left] = likeness[left, trial]
        again = np.abs(place[trial] - place[best[left]]).max(axis=1) < SAME_PX
        again &= second[left] > 0
        left, trial = left[again], trial[again]
        if not len(left):
            break
    return second


def _square(likeness: NDArray[np.float32]) -> NDArray[np.float32]:
    """Compute squared distances (N,) of unit vectors; at least 1e-5, above rounding errors."""
    return np.asarray(np.maximum(2.0 - 2.0 * likeness, 1e-5), np.float32)


def _normalise(descriptor: NDArray[np.uint8]) -> NDArray[np.float32]:
    """Convert descriptors to unit vectors: RootSIFT (Arandjelovic and Zisserman, CVPR 2012)."""
    value = descriptor.astype(np.float32)
    value /= np.maximum(value.sum(axis=1, keepdims=True), 1.0)
    return np.sqrt(value)


def _compute_distances(one: Floats, other: Floats) -> NDArray[np.float32]:
    """Compute squared distances (N, M)."""
    a, b = one.astype(np.float32), other.astype(np.float32)
    u = a[:, :1] - b[:, 0]
    v = a[:, 1:] - b[:, 1]
    u *= u
    v *= v
    u += v
    return u


COMPARED_FEATURES = 400
"""Number of features compared in each photo: the largest, which are visible from afar as well."""


def compute_photo_similarity(features: Sequence[Features], rows: Sequence[int]) -> Floats:
    """Count matches (N, N) among the largest features of two photos; symmetric.

    Parameters
    ----------
    features
        Features of N photos.
    rows
        Photos that are compared with all others; the rest stays 0.
    """
    few = [
        one.take(np.argsort(-one.size_px, kind="stable")[:COMPARED_FEATURES]) for one in features
    ]
    count = np.zeros((len(few), len(few)))
    for i in sorted(rows):
        for j in range(len(few)):
            if j != i and not count[i, j]:
                count[i, j] = count[j, i] = len(match_features(few[i], few[j]))
    return count


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
