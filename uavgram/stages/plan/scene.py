"""What a plan is made for, in the world's axes: the ground, what is wanted, what errs how much."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Annotated

import numpy as np

from uavgram.geometry.ground.polygons import long_axis
from uavgram.geometry.ground.squares import squares_on_plane
from uavgram.model.arrays import Floats, FrozenArrays
from uavgram.model.camera.calibration import Calibration
from uavgram.model.options import GroundOptions, MountOptions, TapeOptions, TelemetryOptions
from uavgram.model.scenario.plates import PlateSpec
from uavgram.model.survey.observations import MeasurementRequest


@dataclass(frozen=True, kw_only=True)
class Logged:
    """How well a log says where each photo was taken, beside what the flight has in common.

    `position_sigma_m` is horizontal and vertical, `attitude_sigma_deg` of roll and pitch, and yaw.
    """

    position_sigma_m: tuple[float, float] = (0.5, 0.8)
    attitude_sigma_deg: tuple[float, float] = (1.0, 2.0)
    mount: MountOptions = field(default_factory=MountOptions)
    telemetry: TelemetryOptions = field(default_factory=TelemetryOptions)


@dataclass(frozen=True, kw_only=True)
class Deviation:
    """How the drone departs from the plan: standard deviations of each axis."""

    position_m: float = 2.0
    attitude_deg: float = 1.8


@dataclass(frozen=True, kw_only=True, eq=False)
class PlanScene(FrozenArrays):
    """A scene to be measured.

    Attributes
    ----------
    calibration
        Of the camera.
    height_m, slope, pivot_m
        The ground: height at the pivot (2,), d up / d east and d up / d north (2,).
    area_m
        (V, 2) corners, counterclockwise.
    no_go_m
        Polygons (v, 2).
    label, point_m
        (K,), (K, 2) of what is measured.
    requests
        What is measured.
    ground, tape
        What is known of ground and tape beforehand; the ground's height is `height_m` there too.
    plates
        How large the plates are that could be laid, and how well they are known and found.
    logged
        The log; None: there is none.
    picks_sigma_px, tape_sigma_m
        Of picks and readings.
    deviation
        Of the flight from the plan.
    """

    calibration: Calibration
    height_m: float = 0.0
    slope: Annotated[Floats, 2] = field(default_factory=lambda: np.zeros(2))
    pivot_m: Annotated[Floats, 2] = field(default_factory=lambda: np.zeros(2))
    area_m: Annotated[Floats, "v", 2]
    no_go_m: tuple[Floats, ...] = ()
    label: Annotated[tuple[str, ...], "k"] = ()
    point_m: Annotated[Floats, "k", 2] = field(default_factory=lambda: np.zeros((0, 2)))
    requests: tuple[MeasurementRequest, ...] = ()
    ground: GroundOptions = field(default_factory=GroundOptions)
    tape: TapeOptions = field(default_factory=TapeOptions)
    plates: PlateSpec = field(default_factory=PlateSpec)
    logged: Logged | None = field(default_factory=Logged)
    picks_sigma_px: float = 0.7
    tape_sigma_m: float = 0.01
    deviation: Deviation = field(default_factory=Deviation)

    def on_ground(self, east_north_m: Floats) -> Floats:
        """(..., 3) places on the ground at (..., 2)."""
        up = self.height_m + (east_north_m - self.pivot_m) @ self.slope
        return np.concatenate([east_north_m, up[..., None]], axis=-1)

    def plates_at(self, east_north_m: Floats) -> Floats:
        """(N, 4, 3) corners of plates on the ground about (N, 2), along the area's longer side."""
        _, axis, _ = long_axis(self.area_m)
        turn = np.full(len(east_north_m), np.arctan2(axis[1], axis[0]))
        middle = self.on_ground(east_north_m)
        return squares_on_plane(middle, self.slope, turn, self.plates.side_m)
