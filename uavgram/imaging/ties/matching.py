"""Which features of two photos look like each other, and like nothing else."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from uavgram.imaging.ties.features import Features
from uavgram.model.arrays import Floats, Ints

RATIO = 0.8
"""A match must be so much nearer than the second best (Lowe, IJCV 60 (2004), section 7.1)."""

FARTHEST = 0.4
"""Greatest squared distance of descriptors, unit vectors, that look alike: features that have
nothing to do with each other are seldom nearer."""

SAME_PX = 3.0
"""Features this near each other are one place, described twice: no second best."""

_NONE = np.float32(-1.0)


class Guide(NamedTuple):
    """Where the features of one photo should be in another.

    Attributes
    ----------
    pixel_px
        (N, 2) in the other photo; NaN where it should not show them.
    radius_px
        How far off that may be.
    """

    pixel_px: Floats
    radius_px: float


def match_features(one: Features, other: Features, guide: Guide | None = None) -> Ints:
    """Rows (M, 2) of matching features, each the other's best.

    Parameters
    ----------
    one, other
        Features of two photos.
    guide
        Where those of `one` should be in the other; None: anywhere.
    """
    rows = np.arange(len(one.pixel_px))
    if guide is not None:
        rows = np.flatnonzero(np.isfinite(guide.pixel_px).all(axis=1))
    if not len(rows) or len(other.pixel_px) < 2:
        return np.empty((0, 2), np.int64)
    likeness = _unit(one.descriptor[rows]) @ _unit(other.descriptor).T
    nearest = _square(likeness.max(axis=1))
    if guide is not None:
        likeness[_apart(guide.pixel_px[rows], other.pixel_px) > guide.radius_px**2] = _NONE
    here = np.arange(len(rows))
    best = likeness.argmax(axis=1)
    first = likeness[here, best].copy()
    back = likeness.argmax(axis=0)
    second = _second(likeness, best, other.pixel_px)
    near = _square(first)
    good = (near < RATIO**2 * _square(second)) & (near < FARTHEST) & (back[best] == here)
    # where the guide is wrong, the true one stands outside, and is far more like it
    good &= RATIO**2 * near <= nearest
    return np.stack([rows[good], best[good]], axis=1)


def _second(likeness: NDArray[np.float32], best: Ints, place: Floats) -> NDArray[np.float32]:
    """(N,) likeness of the best at another place; `likeness` is used up."""
    second = np.empty(len(best), np.float32)
    left, trial = np.arange(len(best)), best
    for _ in range(4):  # a place has at most a few descriptions
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
    """(N,) squared distances of unit vectors; of equal ones not what rounding makes of 0."""
    return np.asarray(np.maximum(2.0 - 2.0 * likeness, 1e-5), np.float32)


def _unit(descriptor: NDArray[np.uint8]) -> NDArray[np.float32]:
    """RootSIFT (Arandjelovic and Zisserman, CVPR 2012): rows become unit vectors."""
    value = descriptor.astype(np.float32)
    value /= np.maximum(value.sum(axis=1, keepdims=True), 1.0)
    return np.sqrt(value)


def _apart(one: Floats, other: Floats) -> NDArray[np.float32]:
    """(N, M) squared distances."""
    a, b = one.astype(np.float32), other.astype(np.float32)
    u = a[:, :1] - b[:, 0]
    v = a[:, 1:] - b[:, 1]
    u *= u
    v *= v
    u += v
    return u
