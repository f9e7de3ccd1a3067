"""What the autopilot of a made-up survey writes down: smooth errors of the size that is stated."""

from __future__ import annotations

import numpy as np
from hostile_conditions import Condition
from hostile_world import Smooth, TrueFlight
from pyproj import Transformer
from scipy.spatial.transform import Rotation

from uavgram.model.arrays import Floats
from uavgram.model.flight_log import SimulatedLog

START_UTC_S = 1_767_607_200.0
BOOT_S = 120.0  # since boot, when the flight's recording starts
HOME = (48.1372, 11.5755, 470.0)  # degrees, metres above mean sea level
UNDULATION_M = 46.0
POSITION_SIGMA_M = 0.5  # the floors that the program takes for a log that states none
TILT_SIGMA_DEG, YAW_SIGMA_DEG = 1.0, 2.0
WANDER_S = 10.0  # between the 5 and 60 s that `telemetry.correlation_s` takes for granted
BIAS_M = (2.0, 2.0, 3.0)
HEADING_DEG = 2.0
TO_WORLD = Transformer.from_pipeline(
    "+proj=pipeline +step +proj=cart +ellps=WGS84 +step +proj=topocentric +ellps=WGS84 "
    f"+lat_0={HOME[0]} +lon_0={HOME[1]} +h_0={HOME[2] + UNDULATION_M}"
)


def record(condition: Condition, flight: TrueFlight, rng: np.random.Generator) -> SimulatedLog:
    """The log of a flight; all its errors are log minus truth."""
    start, end = flight.span_s
    rates = np.array([10.0, rng.uniform(10.0, 25.0)])
    if condition.log_hz is not None:
        rates[:] = condition.log_hz
    position_s, attitude_s = (np.arange(start, end, 1 / rate) for rate in rates)
    gps_s = np.arange(start, end, 0.2)
    bias = rng.standard_normal(3) * BIAS_M + [0.0, 0.0, condition.datum_m]
    wander = Smooth(rng, np.full(3, POSITION_SIGMA_M), WANDER_S)
    half = len(flight.exposure_s) // 2
    middle = float(flight.exposure_s[half : half + 2].mean())
    azimuth = rng.uniform(0, 2 * np.pi)
    jump = condition.gps_jump_m * np.array([np.sin(azimuth), np.cos(azimuth), 0.0])

    def estimated(time: Floats) -> Floats:
        stepped = np.outer(time > middle, jump)
        return flight.position(time) + bias + wander(time) + stepped

    slow = Smooth(rng, np.full(3, 0.1), WANDER_S)
    east, north, up = (flight.velocity(position_s) + slow(position_s)).T
    body, gimbal = _angles(condition, flight, attitude_s, rng)
    fixes = estimated(gps_s) + rng.normal(0, 0.25, (len(gps_s), 3))
    none = np.zeros((0, 3))
    return SimulatedLog(
        boot_utc_s=START_UTC_S - BOOT_S,
        home_geodetic=np.array(HOME),
        undulation_m=UNDULATION_M,
        position_time_s=BOOT_S + position_s,
        position_geodetic=_geodetic(estimated(position_s)),
        velocity_ned_m_s=np.column_stack([north, east, -up]),
        attitude_time_s=BOOT_S + attitude_s,
        attitude_rpy_rad=body,
        gimbal_time_s=BOOT_S + attitude_s,
        gimbal_rpy_rad=gimbal,
        gps_time_s=BOOT_S + gps_s,
        gps_geodetic=_geodetic(fixes),
        gps_accuracy_m=np.full((len(gps_s), 2), POSITION_SIGMA_M),
        event_time_s=np.zeros(0),
        event_geodetic=none,
        event_rpy_rad=none,
    )


def _angles(
    condition: Condition, flight: TrueFlight, time: Floats, rng: np.random.Generator
) -> tuple[Floats, Floats]:
    """Roll, pitch, yaw (n, 3) of body and gimbal, turned by one error of the estimator.

    The gimbal's yaw is from the vehicle's heading, as gimbals report it.
    """
    sigma = np.deg2rad([TILT_SIGMA_DEG, TILT_SIGMA_DEG, YAW_SIGMA_DEG])
    error = Smooth(rng, sigma, WANDER_S)(time)
    error[:, 2] += np.deg2rad(HEADING_DEG * rng.standard_normal() + condition.yaw_deg)
    # Log minus truth: about the axes north, east, down the log is turned by this.
    turned = Rotation.from_rotvec(error)
    body = (turned * flight.ned_from_body(time)).as_euler("ZYX")
    level = Rotation.from_euler("Z", -body[:, :1])
    gimbal = (level * turned * flight.ned_from_mount(time)).as_euler("ZYX")
    return body[:, ::-1], gimbal[:, ::-1]


def _geodetic(world_m: Floats) -> Floats:
    """Latitude, longitude [deg], height above mean sea level [m]."""
    longitude, latitude, height = TO_WORLD.transform(
        world_m[:, 0], world_m[:, 1], world_m[:, 2], direction="INVERSE"
    )
    return np.column_stack([latitude, longitude, np.asarray(height) - UNDULATION_M])
