"""Errors of one scene that is observed many times, drawn so that few observations tell much.

Independent draws of d standard normal numbers have the unit matrix as their second moment only on
the average. Here the columns of all draws together are orthogonal and of equal length, in a random
direction, so that it is the unit matrix itself: whatever depends on them linearly then has exactly
its variance (random orthogonal designs: Genz and Monahan 1998, "Stochastic integration rules for
infinite regions", SIAM J. Sci. Comput. 19(2), section 3), and what is left to chance of a mean
square is what the errors of different groups do together, and what is not linear.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Protocol

import numpy as np

from uavgram.model.arrays import Floats


class Normals(Protocol):
    """Where standard normal numbers come from: a ``Generator`` is one."""

    def normal(self, *, size: int | tuple[int, ...]) -> Floats: ...


class OneOfDraws:
    """The errors of one of several observations of a scene, group by group as they are asked for.

    Parameters
    ----------
    seed
        Of all draws of the scene.
    draws
        How many there are: groups of more numbers than that are orthogonal by draw instead, and
        of their second moment something is left to chance.
    number
        Which one this is, from 0.
    """

    def __init__(self, seed: tuple[int, ...], draws: int, number: int) -> None:
        self._seed, self._draws, self._number, self._group = seed, draws, number, 0

    def normal(self, *, size: int | tuple[int, ...]) -> Floats:
        """The next group of numbers."""
        self._group += 1
        drawn = _orthogonal((*self._seed, self._group), self._draws, int(np.prod(size)))
        return np.asarray(drawn[self._number]).reshape(size)


@lru_cache(maxsize=256)
def _orthogonal(seed: tuple[int, ...], draws: int, numbers: int) -> Floats:
    """(draws, numbers) of unit variance, with orthogonal columns, or rows where these are fewer."""
    rng = np.random.default_rng(seed)
    most, least = max(draws, numbers), min(draws, numbers)
    basis = np.linalg.qr(rng.normal(size=(most, least)))[0]
    basis *= np.sqrt(most) * rng.choice([-1.0, 1.0], least)  # the signs are not the algorithm's
    drawn: Floats = basis if draws >= numbers else basis.T
    return drawn
