"""Lengths of vectors."""

from __future__ import annotations

import numpy as np

from uavgram.model.arrays import Floats


def lengths_of(vectors: Floats) -> Floats:
    """(...) lengths of vectors (..., n): numpy's `norm` takes three times as long for a few."""
    return np.asarray(np.sqrt(np.add.reduce(vectors * vectors, axis=-1)))
