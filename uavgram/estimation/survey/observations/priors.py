"""Priors of neighbouring unknowns that are independent of each other."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from uavgram.estimation.solver.normal_equations import Block
from uavgram.estimation.survey.observations.observation import Observation, in_unit
from uavgram.estimation.survey.suspicion import Member
from uavgram.model.arrays import Floats, Ints


class Prior(Observation):
    """What is known beforehand of some shared unknowns: each is a row of one number."""

    def axis(self, member: Member) -> str:
        """Name of the unknown."""
        return self.kind.axes[member.row]

    def unit(self, member: Member) -> tuple[str, float]:
        """Unit of the unknown."""
        return in_unit(self.kind.units[member.row])


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
