"""Matches of pairs of photos put together: what all photos show of one point."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.sparse import coo_array

from uavgram.model.arrays import Floats, Ints

LEAST_SUPPORT = 0.5
"""Share of the other sightings of a point that each must be matched with directly: what drifts from
photo to photo, or is seen beside the point in one, is not."""


class Matches(NamedTuple):
    """M matches, each of two features.

    Attributes
    ----------
    feature
        (M, 2) rows among the features of all photos.
    pair
        (M,) which pair of photos it is of.
    across_px
        (M,) how far off the line that the other place prescribes, less what all have in common.
    """

    feature: Ints
    pair: Ints
    across_px: Floats

    def take(self, rows: Ints) -> Matches:
        """Some of them."""
        return Matches(self.feature[rows], self.pair[rows], self.across_px[rows])


class Tracks(NamedTuple):
    """S sightings of points, those of one point one after the other.

    Attributes
    ----------
    point
        (S,) counts from 0.
    feature
        (S,) rows among the features of all photos.
    """

    point: Ints
    feature: Ints


def tracks_of(matches: Matches, photo: Ints) -> Tracks:
    """Features that are matched with each other, directly or through others, are one point.

    Parameters
    ----------
    matches
        Those that were verified.
    photo
        (F,) of each feature, which photo it is of.

    Returns
    -------
    Tracks
        Without points that a photo would show twice (a match in them is wrong), and without
        sightings that hang by a thread.
    """
    if not len(matches.feature):
        return Tracks(np.empty(0, np.int64), np.empty(0, np.int64))
    from scipy.sparse.csgraph import connected_components  # noqa: PLC0415 - slow to load

    one, other = matches.feature.T
    graph = coo_array((np.ones(len(one), np.int8), (one, other)), shape=(len(photo),) * 2)
    _, component = connected_components(graph, directed=False)
    feature = np.unique(matches.feature)
    label = component[feature]
    order = np.lexsort((photo[feature], label))
    feature, label = feature[order], label[order]
    twice = (label[1:] == label[:-1]) & (photo[feature[1:]] == photo[feature[:-1]])
    kept = ~np.isin(label, label[1:][twice])
    degree = np.bincount(matches.feature.ravel(), minlength=len(photo))[feature]
    kept &= degree >= LEAST_SUPPORT * (np.bincount(label)[label] - 1)
    kept &= np.bincount(label, kept)[label] > 1
    _, point = np.unique(label[kept], return_inverse=True)
    return Tracks(point.astype(np.int64), feature[kept])
