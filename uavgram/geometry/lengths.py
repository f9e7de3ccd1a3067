"""Lengths of vectors."""

from __future__ import annotations

import numpy as np

from uavgram.model.arrays import Floats


def lengths_of(vectors: Floats) -> Floats:
    """Compute the lengths (...) of vectors (..., n).

    For a few vectors numpy's `norm` takes three times as long.
    """
    return np.asarray(np.sqrt(np.add.reduce(vectors * vectors, axis=-1)))
