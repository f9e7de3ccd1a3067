"""A raster on the ground: where its pixels lie."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from uavgram.model.arrays import Floats


@dataclass(frozen=True, kw_only=True)
class GroundRaster:
    """North up, square pixels; row 0 is the northernmost.

    Attributes
    ----------
    west_m, north_m
        Outer corner of pixel [0, 0], in `crs`, or in local metres where that is None.
    pixel_m
        Edge of a pixel.
    width, height
        In pixels.
    crs
        Projected coordinate system; None: local east and north.
    """

    west_m: float
    north_m: float
    pixel_m: float
    width: int
    height: int
    crs: str | None

    def centers(self, columns: Floats, rows: Floats) -> Floats:
        """(len(rows), len(columns), 2) east and north of pixel centres; fractions are allowed."""
        east = self.west_m + (np.asarray(columns, np.float64) + 0.5) * self.pixel_m
        north = self.north_m - (np.asarray(rows, np.float64) + 0.5) * self.pixel_m
        return np.stack(np.meshgrid(east, north), axis=-1)

    def coarser(self, factor: int) -> GroundRaster:
        """The same ground with pixels `factor` times as large, the last ones reaching over."""
        return GroundRaster(
            west_m=self.west_m,
            north_m=self.north_m,
            pixel_m=self.pixel_m * factor,
            width=-(-self.width // factor),
            height=-(-self.height // factor),
            crs=self.crs,
        )
