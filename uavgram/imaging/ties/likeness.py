"""Similarity of photos without known positions."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from uavgram.imaging.ties.features import Features
from uavgram.imaging.ties.matching import match_features
from uavgram.model.arrays import Floats

COMPARED = 400
"""Number of features compared in each photo: the largest, which are visible from afar as well."""


def likeness(features: Sequence[Features], rows: Sequence[int]) -> Floats:
    """Count matches (N, N) among the largest features of two photos; symmetric.

    Parameters
    ----------
    features
        Features of N photos.
    rows
        Photos that are compared with all others; the rest stays 0.
    """
    few = [one.take(np.argsort(-one.size_px, kind="stable")[:COMPARED]) for one in features]
    count = np.zeros((len(few), len(few)))
    for i in sorted(rows):
        for j in range(len(few)):
            if j != i and not count[i, j]:
                count[i, j] = count[j, i] = len(match_features(few[i], few[j]))
    return count
