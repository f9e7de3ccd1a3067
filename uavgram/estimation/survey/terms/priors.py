"""Priors of neighbouring unknowns that know nothing of each other, as rows of the likelihood."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from uavgram.estimation.solver.normal_equations import Block
from uavgram.model.arrays import Floats, Ints


def independent_prior(off: Floats, sigma: Floats, first: int) -> Block:
    """A row for each of n unknowns.

    Parameters
    ----------
    off
        (..., n) how far each is from what is known of it.
    sigma
        (n,) standard deviations of that, in the same units.
    first
        Column of the first unknown.
    """
    columns = _neighbours(first, off.shape[-1])
    return Block((off / sigma)[..., None], columns, (1.0 / sigma)[:, None, None])


@lru_cache(maxsize=256)
def _neighbours(first: int, count: int) -> Ints:
    """(count, 1) columns; each iteration asks for them again."""
    columns = (first + np.arange(count))[:, None]
    columns.flags.writeable = False
    return columns
