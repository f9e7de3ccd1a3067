"""Autopilot log of a synthetic flight."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from uavgram.model.arrays import Floats, FrozenArrays


@dataclass(frozen=True, kw_only=True, eq=False)
class SimulatedLog(FrozenArrays):
    """Recording of the autopilot, with its errors.

    Attributes
    ----------
    boot_utc_s
        UTC of boot, seconds since the Unix epoch; all times below are seconds since boot.
    home_geodetic
        (3,) latitude, longitude [deg], height above mean sea level [m].
    undulation_m
        Geoid above ellipsoid.
    position_time_s, position_geodetic, velocity_ned_m_s
        (N,), (N, 3) as home, (N, 3).
    attitude_time_s, attitude_rpy_rad
        (M,), (M, 3) roll, pitch, yaw, body FRD to NED.
    gimbal_time_s, gimbal_rpy_rad
        (L,), (L, 3) roll and pitch from the earth, yaw from the vehicle's heading.
    gps_time_s, gps_geodetic, gps_accuracy_m
        (G,), (G, 3), (G, 2) horizontal and vertical, as stated by the receiver.
    event_time_s, event_geodetic, event_rpy_rad
        (E,), (E, 3), (E, 3) exposures; attitude of the vehicle.
    """

    boot_utc_s: float
    home_geodetic: Annotated[Floats, 3]
    undulation_m: float
    position_time_s: Annotated[Floats, "n"]
    position_geodetic: Annotated[Floats, "n", 3]
    velocity_ned_m_s: Annotated[Floats, "n", 3]
    attitude_time_s: Annotated[Floats, "m"]
    attitude_rpy_rad: Annotated[Floats, "m", 3]
    gimbal_time_s: Annotated[Floats, "k"]
    gimbal_rpy_rad: Annotated[Floats, "k", 3]
    gps_time_s: Annotated[Floats, "g"]
    gps_geodetic: Annotated[Floats, "g", 3]
    gps_accuracy_m: Annotated[Floats, "g", 2]
    event_time_s: Annotated[Floats, "e"]
    event_geodetic: Annotated[Floats, "e", 3]
    event_rpy_rad: Annotated[Floats, "e", 3]
