"""How well tie points are seen, learnt from how well the matches of each pair fit together."""

from __future__ import annotations

import numpy as np

from uavgram.model.arrays import Bools, Floats, Ints
from uavgram.stages.tie.tracks import Matches

LARGE = 4.0
"""Size of a feature, in pixels of the reduced photo, from which it is seen less well: on rendered
streets the error is the same below, and grows with the size above."""

TOO_LARGE = 10.0
"""Size from which it is no point."""

MOST = 4.0
"""Robust sigmas of its pair at which a match stands out."""

LEAST_PX = 0.03
"""Sigma that no feature is better than, in pixels of the reduced photo."""


def relative_noise(size_px: Floats, scale: float) -> Floats:
    """(F,) error of features as multiples of that of small ones.

    Parameters
    ----------
    size_px
        (F,) of the features, in pixels of the photo.
    scale
        Pixels of the photo per pixel of the reduced one.
    """
    return np.maximum(1.0, size_px / (LARGE * scale))


def fitting(matches: Matches, relative: Floats, pairs: int) -> Bools:
    """(M,) matches of small features that do not stand out of their pair.

    Parameters
    ----------
    matches
        Of all pairs.
    relative
        (F,) `relative_noise` of the features.
    pairs
        Number of pairs.
    """
    off = np.abs(_normalised(matches, relative))
    median = np.full(pairs, np.inf)
    order = np.lexsort((off, matches.pair))
    start = np.searchsorted(matches.pair[order], np.arange(pairs + 1))
    has = np.diff(start) > 0
    median[has] = off[order[(start[:-1] + start[1:])[has] // 2]]
    small = relative[matches.feature].max(axis=1) < TOO_LARGE / LARGE
    return np.asarray((off < MOST * 1.4826 * median[matches.pair]) & small)


def sigmas(matches: Matches, relative: Floats, pairs: int, scale: float) -> Floats:
    """(F,) standard deviation of each coordinate of the matched features [px]; NaN of others.

    Parameters
    ----------
    matches
        Those that fit.
    relative
        (F,) `relative_noise` of the features.
    pairs
        Number of pairs.
    scale
        Pixels of the photo per pixel of the reduced one.
    """
    square = np.bincount(matches.pair, _normalised(matches, relative) ** 2, minlength=pairs)
    of_pair = square / np.maximum(np.bincount(matches.pair, minlength=pairs), 1)
    feature = matches.feature.ravel()
    count = np.bincount(feature, minlength=len(relative))
    total = np.bincount(feature, np.repeat(of_pair[matches.pair], 2), minlength=len(relative))
    with np.errstate(invalid="ignore", divide="ignore"):
        sigma = relative * np.sqrt(total / count)
    return np.asarray(np.maximum(sigma, LEAST_PX * scale))


def _normalised(matches: Matches, relative: Floats) -> Floats:
    """(M,) distances across, each over what two features of such size would have at sigma 1."""
    of_two: Ints = matches.feature
    return np.asarray(matches.across_px / np.sqrt((relative[of_two] ** 2).sum(axis=1)))
