"""Matching of the features of two photos, with a test of uniqueness."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from uavgram.imaging.ties.features import Features
from uavgram.model.arrays import Floats, Ints

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
    back = likeness.argmax(axis=0)
    second = _find_second_best(likeness, best, other.pixel_px)
    near = _square(first)
    good = (near < MAX_RATIO**2 * _square(second)) & (near < MAX_DISTANCE) & (back[best] == here)
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
        trial = likeness[left].argmax(axis=1)
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
