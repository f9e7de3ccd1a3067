"""Priors of neighbouring unknowns that know nothing of each other, as rows of the likelihood."""

from __future__ import annotations

import numpy as np

from uavgram.estimation.solver.normal_equations import Block
from uavgram.model.arrays import Floats


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
    columns = (first + np.arange(off.shape[-1]))[:, None]
    return Block((off / sigma)[..., None], columns, (1.0 / sigma)[:, None, None])
