"""Mapping from the ground to the drawing: north up, as large as it fits."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from uavgram.model.arrays import Floats

WIDTH = 900.0
LEAST_HEIGHT, MOST_HEIGHT = 420.0, 740.0
"""Limits of the drawing's height, in its own units: a sheet has room for it and for some text."""

MARGIN = 46.0


@dataclass(frozen=True, eq=False)
class Paper:
    """Drawing of a rectangle of ground.

    Attributes
    ----------
    west_m, north_m
        World coordinates of the inner edge of its left and upper margins.
    scale
        Units of the drawing per metre.
    height
        Height of the drawing.
    """

    west_m: float
    north_m: float
    scale: float
    height: float

    @classmethod
    def showing(cls, world_m: Floats) -> Paper:
        """Make the paper on which all (n, 2 or 3) places are seen."""
        low = world_m[:, :2].min(axis=0)
        size = np.maximum(world_m[:, :2].max(axis=0) - low, 1.0)
        scale = float(((np.array([WIDTH, MOST_HEIGHT]) - 2 * MARGIN) / size).min())
        height = max(float(size[1]) * scale + 2 * MARGIN, LEAST_HEIGHT)
        spare = ((np.array([WIDTH, height]) - 2 * MARGIN) / scale - size) / 2
        return cls(
            west_m=float(low[0] - spare[0]),
            north_m=float(low[1] + size[1] + spare[1]),
            scale=scale,
            height=height,
        )

    def __call__(self, world_m: Floats) -> Floats:
        """Map (..., 2 or 3) places to (..., 2) x to the right and y downwards."""
        x = MARGIN + (world_m[..., 0] - self.west_m) * self.scale
        return np.stack([x, MARGIN + (self.north_m - world_m[..., 1]) * self.scale], axis=-1)
