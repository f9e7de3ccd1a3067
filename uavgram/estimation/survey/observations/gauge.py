"""The conditions that fix a free gauge."""

from __future__ import annotations

import numpy as np

from uavgram.estimation.solver.normal_equations import Block
from uavgram.estimation.survey.observations.observation import Kind, Observation
from uavgram.estimation.survey.unknowns import State

GAUGE_SIGMA = np.array([1e-4, 1e-4, 1e-6])
"""Of the three conditions that fix a free gauge [m, m, rad]: they are met exactly at the minimum,
so their size moves no estimate; small enough to add nothing to a covariance."""


class Gauge(Observation):
    """First frame above x = y = 0, its image up towards north."""

    kind = Kind("gauge", "choice of axes", "choice of axes", role="construction")

    def is_part(self) -> bool:
        """Whether nothing else fixes position and heading."""
        return self.problem.layout.free_gauge

    def rows(self, state: State) -> Block | None:
        """Compute place and heading of the first frame.

        u = R (0, -1, 0) is image up in the world; u_east = 0. With R exp(δθ):
        δu = R (δθ x (0, -1, 0)), its east part row R_east . (δθ_z, 0, -δθ_x).
        """
        east = state.rotation[..., 0, 0, :]
        residual = np.concatenate([state.center[..., 0, :2], -east[..., 1:2]], axis=-1)
        jacobian = np.zeros((*east.shape, 6))
        jacobian[..., 0, 0] = jacobian[..., 1, 1] = 1.0
        jacobian[..., 2, 3], jacobian[..., 2, 5] = -east[..., 2], east[..., 0]
        columns = self.problem.layout.frame_columns(np.zeros(1, dtype=np.int64))
        whitened = (residual / GAUGE_SIGMA)[..., None, :]
        return Block(whitened, columns, (jacobian / GAUGE_SIGMA[:, None])[..., None, :, :])
