"""Priors of single unknowns, and the conditions that fix a free gauge."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from uavgram.estimation.solver.normal_equations import Block
from uavgram.estimation.survey.observations.observation import (
    ErrorSource,
    Kind,
    Member,
    Observation,
    get_unit,
)
from uavgram.estimation.survey.unknowns import State
from uavgram.model.arrays import Floats, Ints

AXES = ErrorSource(
    "choice of axes",
    "where the origin and north of the survey were put",
    "A flight log or control points would fix them.",
)


class Prior(Observation):
    """Prior of some shared unknowns: each is a row of one number."""

    def axis(self, member: Member) -> str:
        """Return the name of the unknown."""
        return self.kind.axes[member.row]

    def unit(self, member: Member) -> tuple[str, float]:
        """Return the unit of the unknown."""
        return get_unit(self.kind.units[member.row])


def make_independent_prior(off: Floats, sigma: Floats, first: int) -> Block:
    """Compute a row for each of n unknowns.

    Parameters
    ----------
    off
        (..., n) differences of the unknowns from their known values.
    sigma
        (n,) standard deviations of the known values, in the same units.
    first
        Column of the first unknown.
    """
    columns = _neighbours(first, off.shape[-1])
    return Block((off / sigma)[..., None], columns, (1.0 / sigma)[:, None, None])


@lru_cache(maxsize=256)
def _neighbours(first: int, count: int) -> Ints:
    """Return (count, 1) columns; cached, as each iteration asks for them again."""
    columns = (first + np.arange(count))[:, None]
    columns.flags.writeable = False
    return columns


GAUGE_SIGMA = np.array([1e-4, 1e-4, 1e-6])
"""Sigmas of the three conditions that fix a free gauge [m, m, rad]. The conditions are met exactly
at the minimum, so their sigmas change no estimate; they are small enough to add nothing to a
covariance."""


class Gauge(Observation):
    """Conditions of a free gauge: first frame above x = y = 0, its image up towards north."""

    kind = Kind("gauge", AXES, "choice of axes", role="construction")

    def is_part(self) -> bool:
        """Return whether nothing else fixes position and heading."""
        return self.problem.layout.free_gauge

    def rows(self, state: State) -> Block | None:
        """Compute place and heading of the first frame.

        u = R (0, -1, 0) is image up in the world; u_east = 0. With R exp(δθ): δu = R (δθ x (0, -1,
        0)), its east part row R_east . (δθ_z, 0, -δθ_x).
        """
        east = state.rotation[..., 0, 0, :]
        residual = np.concatenate([state.center[..., 0, :2], -east[..., 1:2]], axis=-1)
        jacobian = np.zeros((*east.shape, 6))
        jacobian[..., 0, 0] = jacobian[..., 1, 1] = 1.0
        jacobian[..., 2, 3], jacobian[..., 2, 5] = -east[..., 2], east[..., 0]
        columns = self.problem.layout.frame_columns(np.zeros(1, dtype=np.int64))
        whitened = (residual / GAUGE_SIGMA)[..., None, :]
        return Block(whitened, columns, (jacobian / GAUGE_SIGMA[:, None])[..., None, :, :])
