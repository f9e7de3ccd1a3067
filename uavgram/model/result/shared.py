"""The unknowns that all frames share, as a run reports them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Annotated

import numpy as np

from uavgram.model.arrays import Floats, FrozenArrays
from uavgram.model.columns import Column


@dataclass(frozen=True, kw_only=True, eq=False)
class Estimate(FrozenArrays):
    """A shared unknown: value and standard deviation, both (n,)."""

    value: Annotated[Floats, "n"]
    sigma: Annotated[Floats, "n"]


@dataclass(frozen=True, kw_only=True, eq=False)
class SharedResult:
    """The unknowns that all frames share, after the adjustment.

    Attributes
    ----------
    boresight_deg, lever_arm_m, position_bias_m, heading_bias_deg, clock_offset_s
        Of the telemetry; None without a log. Biases are log minus truth; the position bias is
        (east, north, up); the boresight a rotation vector in the camera frame.
    clock_drift_ppm
        Of the camera's clock against the flight's, about the middle of the exposures; None
        without a log.
    readout_s
        Time in which a photo is read from its first row to the last; None where it is no unknown.
    tape_scale
        By the name of each tape that was used, which may be empty: +0.01 where it is 1 % too long,
        and so reads short. Nothing where tapes are taken as exact, or none was used.
    intrinsics
        In the order of the lens model's parameters.
    """

    boresight_deg: Estimate | None
    lever_arm_m: Estimate | None
    position_bias_m: Estimate | None
    heading_bias_deg: Estimate | None
    clock_offset_s: Estimate | None
    clock_drift_ppm: Estimate | None = None
    readout_s: Estimate | None = None
    intrinsics: Estimate
    tape_scale: Mapping[str, Estimate] = field(default_factory=dict)


@dataclass(frozen=True, kw_only=True, eq=False)
class AreaPlane(FrozenArrays):
    """The plane of one area of the ground, after the adjustment.

    Attributes
    ----------
    name
        Of the area.
    height_m, slope_deg
        At the pivot; [d up / d east, d up / d north] as angles.
    pivot_m
        (2,) east and north of the point about which the slopes turn.
    """

    name: str
    height_m: Estimate
    slope_deg: Annotated[Estimate, Column(axes=("east", "north"))]
    pivot_m: Annotated[Floats, 2]

    @property
    def surface(self) -> Floats:
        """(3,) height at the pivot [m] and slopes to the east and to the north [m/m]."""
        return np.concatenate([self.height_m.value, np.tan(np.deg2rad(self.slope_deg.value))])

    def height_at(self, east_north_m: Floats) -> Floats:
        """(...) heights [m] of the plane under (..., 2) world positions [m]."""
        surface = self.surface
        return np.asarray(surface[0] + (east_north_m - self.pivot_m) @ surface[1:])
