"""The true ground of a simulated scene: its plane, and what lies on it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import numpy as np

from uavgram.model.arrays import Floats, FrozenArrays
from uavgram.model.scenario.ground import GroundSpec


@dataclass(frozen=True, kw_only=True, eq=False)
class Surface(FrozenArrays):
    """Heights of the ground.

    Attributes
    ----------
    spec
        What it has beyond its plane.
    height_m, slope, middle_m
        z = height + slope . ((e, n) - middle), (2,) and (2,).
    axes
        (2, 2) ``east_north = axes @ scene_xy``.
    wave_per_m, cosine_m, sine_m
        (W, 2), (W,), (W,) of the relief; W = 0 without.
    """

    spec: GroundSpec
    height_m: float
    slope: Annotated[Floats, 2]
    middle_m: Annotated[Floats, 2]
    axes: Annotated[Floats, 2, 2]
    wave_per_m: Annotated[Floats, "w", 2]
    cosine_m: Annotated[Floats, "w"]
    sine_m: Annotated[Floats, "w"]

    def up(self, offset_m: Floats) -> Floats:
        """Heights (N,) at (N, 2) east and north of the scene's middle."""
        plane = self.height_m + offset_m @ self.slope
        if self.spec.is_plane:
            return np.asarray(plane)
        left = (offset_m @ self.axes)[:, 1]
        angle = offset_m @ self.wave_per_m.T
        shape = (
            -self.spec.crown_percent / 100 * np.abs(left)
            + self.spec.slope_break_percent / 100 * np.maximum(left, 0.0)
            + self.spec.kerb_m * (left > self.spec.kerb_y_m)
        )
        return np.asarray(
            plane + shape + np.cos(angle) @ self.cosine_m + np.sin(angle) @ self.sine_m
        )
