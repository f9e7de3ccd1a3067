"""True flight of a synthetic survey: route, motion, exposures, camera poses; its autopilot log."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, NamedTuple

import numpy as np
from scipy.linalg import solve_banded
from scipy.ndimage import gaussian_filter1d

from uavgram.geometry.geodesy import geodetic_from_enu
from uavgram.geometry.motion.rotation import (
    ENU_FROM_NED,
    GIMBAL_FROM_CAMERA,
    exp_so3,
    matrix_from_ypr,
    xyzw_from_matrix,
)
from uavgram.model import flight_log
from uavgram.model.arrays import Floats, FrozenArrays, Ints
from uavgram.synthetic.errors import ErrorSpec
from uavgram.synthetic.scenario import FlightPlan, Scenario, Site

ON_GROUND_S = 8.0
CLIMB_M_S = 3.0
LEAD_M = 6.0  # straight flight before and after the exposures of a strip
HOVER_S = 5.0  # at a position with one photo: time to settle before and after it


@dataclass(frozen=True, kw_only=True, eq=False)
class Route(FrozenArrays):
    """A flight of W waypoints over L legs on which photos are taken.

    Attributes
    ----------
    waypoint_world_m
        (W, 3) home, above home, start and end of each leg, above home, home.
    start_s
        (W,) time at each waypoint, from the start of the recording.
    yaw_rad, pitch_rad
        (L,) of the vehicle, and of the gimbal's optical axis; yaw without jumps.
    turn_s
        (L - 1,) half-way between two legs.
    """

    waypoint_world_m: Annotated[Floats, "w", 3]
    start_s: Annotated[Floats, "w"]
    yaw_rad: Annotated[Floats, "l"]
    pitch_rad: Annotated[Floats, "l"]
    turn_s: Floats


class _Leg(NamedTuple):
    """Straight leg in scene axes [m]; heading [rad] from its x axis, counterclockwise."""

    start: tuple[float, float, float]
    end: tuple[float, float, float]
    heading: float
    pitch: float


def compute_route(plan: FlightPlan, site: Site) -> Route:
    """Compute the route of a flight plan, leg after leg.

    Parameters
    ----------
    plan, site
        Of the scenario.
    """
    legs = _hovers(plan, site) if plan.is_hovering else _strips(plan, site)
    ends = np.array([end for leg in legs for end in (leg.start, leg.end)])
    plane = site.in_world(ends[:, :2])
    above = [[0.0, 0.0, plan.height_m]]
    flown = np.vstack([above, np.hstack([plane, ends[:, 2:]]), above])
    waypoints = np.vstack([np.zeros(3), flown, np.zeros(3)])
    speed = np.full(len(waypoints) - 1, plan.speed_m_s)
    speed[[0, -1]] = CLIMB_M_S
    leg_s = np.linalg.norm(np.diff(waypoints, axis=0), axis=1) / speed
    if plan.is_hovering:
        leg_s[2:-2:2] = HOVER_S
        leg_s[3:-2:2] = np.maximum(leg_s[3:-2:2], 1.0)  # two photos of one position: turn meanwhile
    start = ON_GROUND_S + np.concatenate([[0.0], np.cumsum(leg_s)])
    yaw = np.deg2rad(site.road_azimuth_deg) - np.array([leg.heading for leg in legs])
    return Route(
        waypoint_world_m=waypoints,
        start_s=start,
        yaw_rad=np.unwrap(yaw) if plan.is_hovering else yaw,
        pitch_rad=np.array([leg.pitch for leg in legs]),
        turn_s=0.5 * (start[3:-3:2] + start[4:-2:2]),
    )


def compute_exposure_times(plan: FlightPlan, flown: Route, rng: np.random.Generator) -> Floats:
    """Return the times (E,) at which the vehicle passes the planned positions.

    Parameters
    ----------
    plan, flown
        The plan and its route.
    rng
        Draws each exposure's position along its strip.
    """
    begin = flown.start_s[2:-2:2]
    if plan.is_hovering:
        return begin + 0.5 * HOVER_S
    count = plan.photos_per_strip
    along = LEAD_M + np.linspace(0.0, 2.0 * plan.strip_half_length_m, count)
    jitter = rng.uniform(-plan.trigger_jitter_m, plan.trigger_jitter_m, (len(begin), count))
    return (begin[:, None] + (along + jitter) / plan.speed_m_s).ravel()


def _compute_aim_distance(plan: FlightPlan, site: Site) -> float:
    """Return the distance from the vehicle to the intersection of optical axis and ground [m]."""
    above = plan.height_m - site.ground_height_m
    return float(above / np.tan(np.deg2rad(-plan.gimbal_pitch_deg)))


def _strips(plan: FlightPlan, site: Site) -> list[_Leg]:
    """Return strips there and back, and for a grid as many across.

    The optical axis meets the ground ahead of the vehicle: the path is shifted so that the
    footprints, not the vehicle, are centred on the scene's middle.
    """
    reach, ahead = plan.strip_half_length_m + LEAD_M, _compute_aim_distance(plan, site)
    count = {"strip": 1, "grid": plan.grid_strips}.get(plan.pattern, 2)
    pitch = float(np.deg2rad(plan.gimbal_pitch_deg))
    legs = []
    for across in (False, True)[: 2 if plan.pattern == "grid" else 1]:
        for i in range(count):
            way = -1.0 if i % 2 else 1.0
            side = (i - (count - 1) / 2) * 2 * plan.strip_offset_m
            ends = [(way * (-reach - ahead), side), (way * (reach - ahead), side)]
            if across:
                ends = [(-y, x) for x, y in ends]
            start, end = ((x, y, plan.height_m) for x, y in ends)
            heading = (np.pi / 2 if across else 0.0) - (np.pi if i % 2 else 0.0)
            legs.append(_Leg(start, end, heading, pitch))
    return legs


def _hovers(plan: FlightPlan, site: Site) -> list[_Leg]:
    """Return the legs of hovering positions."""
    height, pitch = plan.height_m, float(np.deg2rad(plan.gimbal_pitch_deg))
    if plan.pattern == "single":
        place = (-_compute_aim_distance(plan, site), 0.0, height)
        return [_Leg(place, place, 0.0, pitch)]
    if plan.pattern == "orbit":
        legs = []
        # each photo of an orbit looks at the ground in the circle's middle
        down = -float(np.arctan2(height - site.ground_height_m, plan.radius_m))
        for angle in 2.0 * np.pi * np.arange(plan.frames) / plan.frames:
            place = (plan.radius_m * np.cos(angle), plan.radius_m * np.sin(angle), height)
            legs.append(_Leg(place, place, angle + np.pi, down))
        return legs
    return [
        _Leg(
            (one.x_m, one.y_m, one.height_m),
            (one.x_m, one.y_m, one.height_m),
            float(np.deg2rad(one.heading_deg)),
            float(np.deg2rad(one.pitch_deg)),
        )
        for one in plan.poses
    ]


STEP_S = 0.01
GRAVITY_M_S2 = 9.80665
CORNER_SIGMA_S = 0.8  # smoothing of turns, braking and acceleration
WOBBLE_TAU_S = 1.5
DRAG_PER_S = 0.25  # a multicopter leans about 6 degrees into 4.5 m/s


@dataclass(frozen=True, kw_only=True, eq=False)
class Motion(FrozenArrays):
    """True flight at N times, `STEP_S` apart.

    Attributes
    ----------
    time_s
        (N,) from the start of the recording.
    position_world_m, velocity_world_m_s
        (N, 3) of the autopilot.
    body_rpy_rad
        (N, 3) roll, pitch, yaw of the body, FRD to NED; yaw without jumps.
    gimbal_rpy_rad
        (N, 3) roll and pitch from the earth, yaw from the vehicle's heading.
    exposure_time_s
        (E,) increasing.
    """

    time_s: Annotated[Floats, "n"]
    position_world_m: Annotated[Floats, "n", 3]
    velocity_world_m_s: Annotated[Floats, "n", 3]
    body_rpy_rad: Annotated[Floats, "n", 3]
    gimbal_rpy_rad: Annotated[Floats, "n", 3]
    exposure_time_s: Annotated[Floats, "e"]


def draw_gauss_markov(
    rng: np.random.Generator, count: int, step_s: float, tau_s: float, sigma: Floats
) -> Floats:
    """Draw (count, K) stationary first-order Gauss-Markov noise with sigmas (K,).

    x[i+1] = a x[i] + w, a = exp(-step / tau), var w = sigma^2 (1 - a^2) (Gelb 1974, section 3.8).

    Parameters
    ----------
    rng
        Draws the errors.
    count
        Number of samples.
    step_s
        Between two of them [s].
    tau_s
        Correlation time [s].
    sigma
        (K,) standard deviations, in the unit of the noise.
    """
    decay = float(np.exp(-step_s / tau_s))
    white = rng.standard_normal((count, len(sigma)))
    white[1:] *= np.sqrt(1.0 - decay**2)
    # numpy has no recursion, and scipy.signal takes long to load: x solves a band matrix.
    band = np.array([np.ones(count), np.full(count, -decay)])
    return np.asarray(solve_banded((1, 0), band, white)) * sigma


def simulate_motion(plan: FlightPlan, site: Site, rng: np.random.Generator) -> Motion:
    """Simulate the motion of a plan: up from home, from leg to leg, home, down.

    Parameters
    ----------
    plan, site
        Of the scenario.
    rng
        Draws trigger positions and wobble.
    """
    flown = compute_route(plan, site)
    knots = flown.start_s
    time = np.arange(0.0, knots[-1] + ON_GROUND_S, STEP_S)
    path = np.stack([np.interp(time, knots, column) for column in flown.waypoint_world_m.T], axis=1)
    path = gaussian_filter1d(path, CORNER_SIGMA_S / STEP_S, axis=0, mode="nearest")
    # no wobble on the ground
    aloft = np.clip(path[:, 2:] / plan.height_m, 0.0, 1.0)
    path = path + aloft * _draw_wobble(rng, len(time), np.full(3, plan.wobble_m))
    velocity = np.gradient(path, STEP_S, axis=0)
    yaw = _compute_heading(flown.yaw_rad, flown, time)
    body = _compute_attitude(velocity, yaw)
    tilt_sigma = np.deg2rad([plan.tilt_wobble_deg, plan.tilt_wobble_deg, plan.tilt_wobble_deg / 2])
    body = body + aloft * _draw_wobble(rng, len(time), tilt_sigma)
    gimbal = _draw_wobble(rng, len(time), np.full(3, np.deg2rad(plan.gimbal_wobble_deg)))
    gimbal[:, 1] += _compute_heading(flown.pitch_rad, flown, time)
    return Motion(
        time_s=time,
        position_world_m=path,
        velocity_world_m_s=velocity,
        body_rpy_rad=body,
        gimbal_rpy_rad=gimbal,
        exposure_time_s=compute_exposure_times(plan, flown, rng),
    )


def interpolate(motion: Motion, column: Floats, instants_s: Floats) -> Floats:
    """Interpolate an (N, 3) column of the motion at (E,) times, linearly: (E, 3).

    Parameters
    ----------
    motion
        The true flight.
    column
        (N, 3) one of its quantities.
    instants_s
        (E,) from the start of the recording [s].
    """
    return np.stack([np.interp(instants_s, motion.time_s, part) for part in column.T], axis=1)


def _compute_heading(angle: Floats, flown: Route, time: Floats) -> Floats:
    """Return one angle (N,) of the flight: that of each leg, with smooth turns between the legs."""
    if np.ptp(angle) == 0:
        return np.full(len(time), angle[0])
    now = angle[np.searchsorted(flown.turn_s, time, side="right")]
    return gaussian_filter1d(now, CORNER_SIGMA_S / STEP_S, mode="nearest")


def _compute_attitude(velocity: Floats, yaw: Floats) -> Floats:
    """Return roll, pitch, yaw (N, 3) of a multicopter.

    Its thrust balances gravity, drag and acceleration.
    """
    force = np.gradient(velocity, STEP_S, axis=0) + DRAG_PER_S * velocity
    force = gaussian_filter1d(force, 0.3 / STEP_S, axis=0, mode="nearest")
    east, north, up = force.T
    ahead = np.sin(yaw) * east + np.cos(yaw) * north
    right = np.cos(yaw) * east - np.sin(yaw) * north
    up = up + GRAVITY_M_S2
    return np.stack([np.arctan2(right, np.hypot(ahead, up)), -np.arctan2(ahead, up), yaw], axis=1)


def _draw_wobble(rng: np.random.Generator, count: int, sigma: Floats) -> Floats:
    """Draw smooth random motion (count, K) with about the given sigmas."""
    rough = draw_gauss_markov(rng, count, STEP_S, WOBBLE_TAU_S, sigma)
    return gaussian_filter1d(rough, 0.25 / STEP_S, axis=0, mode="nearest")


@dataclass(frozen=True, kw_only=True, eq=False)
class PhotoRows(FrozenArrays):
    """Poses at several times of each photo, close enough for linear interpolation.

    Attributes
    ----------
    share
        (R,) times, evenly spaced: in readout times from the middle row, as in `row_share`
        (geometry/motion/camera_motion.py).
    center_world_m, world_from_camera
        (F, R, 3), (F, R, 3, 3).
    """

    share: Annotated[Floats, "r"]
    center_world_m: Annotated[Floats, "f", "r", 3]
    world_from_camera: Annotated[Floats, "f", "r", 3, 3]

    def at(self, frame: Ints | int, share: Floats) -> tuple[Floats, Floats]:
        """Return centres (..., 3) and rotations (..., 3, 3) at the times of image rows.

        Parameters
        ----------
        frame
            Photo index, one for all rows or (...) one for each.
        share
            (...) of the rows; a little beyond the table's ends the motion is extrapolated.
        """
        step = (self.share[-1] - self.share[0]) / (len(self.share) - 1)
        place = (share - self.share[0]) / step
        before = np.clip(np.floor(place), 0, len(self.share) - 2).astype(np.int64)
        part = (place - before)[..., None]
        center = _between(self.center_world_m, frame, before, part)
        return center, _between(self.world_from_camera, frame, before, part[..., None])


def _between(table: Floats, frame: Ints | int, before: Ints, part: Floats) -> Floats:
    """Interpolate linearly between the rows `before` and the next ones."""
    first = table[frame, before]
    return np.asarray(first + part * (table[frame, before + 1] - first))


READOUT_SHARE = 0.51  # share of the readout, before and after the middle row
INSTANTS_S = 0.002  # between poses; at 2 rad/s, linear interpolation is wrong by 5e-7 rad


@dataclass(frozen=True, kw_only=True, eq=False)
class FlightBiases(FrozenArrays):
    """Errors constant over the flight, log minus truth: (3,) m, rad; and the true mount."""

    position_m: Annotated[Floats, 3]
    heading_rad: float
    boresight_rad: Annotated[Floats, 3]
    lever_arm_m: Annotated[Floats, 3]


def compute_true_poses(
    motion: Motion, biases: FlightBiases, instants_s: Floats
) -> tuple[Floats, Floats]:
    """Return the true projection centres (F, 3) and rotations (F, 3, 3) of the camera.

    Parameters
    ----------
    motion, biases
        The true flight, and the true mount of the camera.
    instants_s
        (F,) from the start of the recording.
    """
    roll, pitch, yaw = interpolate(motion, motion.body_rpy_rad, instants_s).T
    world_from_body = ENU_FROM_NED @ matrix_from_ypr(yaw, pitch, roll)
    gimbal_roll, gimbal_pitch, gimbal_yaw = interpolate(motion, motion.gimbal_rpy_rad, instants_s).T
    world_from_gimbal = ENU_FROM_NED @ matrix_from_ypr(yaw + gimbal_yaw, gimbal_pitch, gimbal_roll)
    position = interpolate(motion, motion.position_world_m, instants_s)
    center = position + world_from_body @ biases.lever_arm_m
    return center, world_from_gimbal @ GIMBAL_FROM_CAMERA @ exp_so3(biases.boresight_rad)


def compute_photo_rows(
    motion: Motion, biases: FlightBiases, exposed_s: Floats, readout_s: float
) -> PhotoRows | None:
    """Compute poses (F, R) during the readout of each photo, a little longer on both sides.

    Parameters
    ----------
    motion, biases
        The true flight, and the true mount of the camera.
    exposed_s
        (F,) of the middle rows, from the start of the recording.
    readout_s
        Time in which a photo is read; 0: all rows at once, None.
    """
    if not readout_s:
        return None
    share = np.linspace(
        -READOUT_SHARE,
        READOUT_SHARE,
        2 * int(np.ceil(READOUT_SHARE * abs(readout_s) / INSTANTS_S)) + 1,
    )
    instants = exposed_s[:, None] + readout_s * share
    center, rotation = compute_true_poses(motion, biases, instants.ravel())
    return PhotoRows(
        share=share,
        center_world_m=center.reshape(*instants.shape, 3),
        world_from_camera=rotation.reshape(*instants.shape, 3, 3),
    )


POSITION_EVERY = 10  # of the motion's steps: 10 Hz
ATTITUDE_EVERY = 5  # 20 Hz
GIMBAL_EVERY = 10
GPS_EVERY = 20  # 5 Hz
GPS_LAG_STEPS = 10  # receivers are late by 0.1 to 0.2 s (ArduPilot PR 8763)


def draw_biases(scenario: Scenario, rng: np.random.Generator) -> FlightBiases:
    """Draw the errors that all frames share, and add the fixed errors of the habits."""
    errors, habits = scenario.errors, scenario.habits
    horizontal, vertical = errors.position_bias_m
    return FlightBiases(
        position_m=rng.standard_normal(3) * [horizontal, horizontal, vertical],
        heading_rad=float(
            np.deg2rad(errors.heading_bias_deg) * rng.standard_normal() + np.deg2rad(habits.yaw_deg)
        ),
        boresight_rad=np.deg2rad(errors.boresight_deg) * rng.standard_normal(3)
        + np.deg2rad([habits.mount_deg, 0.0, 0.0]),
        lever_arm_m=errors.lever_arm_m + errors.lever_arm_sigma_m * rng.standard_normal(3),
    )


def record_flight(
    scenario: Scenario, motion: Motion, biases: FlightBiases, rng: np.random.Generator
) -> flight_log.SimulatedLog:
    """Record a flight as an autopilot does, with the scenario's errors.

    Parameters
    ----------
    scenario
        Its errors and its site.
    motion
        The true flight.
    biases
        Errors that are constant over the flight.
    rng
        Draws the errors.
    """
    errors, site, boot_s = scenario.errors, scenario.site, scenario.flight.boot_s
    position, gps = _draw_positions(scenario, motion, biases, rng)
    body, gimbal = _draw_angles(errors, motion, biases, rng)
    # logged times of exposures: jitter, and a fixed delay
    events = motion.exposure_time_s
    events = events + errors.event_jitter_s * rng.standard_normal(len(events))
    events = events + scenario.habits.lag_s
    # the receiver's rows are late: the position of an earlier time
    gps_rows = slice(GPS_LAG_STEPS, None, GPS_EVERY)
    gps_position = gps[: len(motion.time_s) - GPS_LAG_STEPS : GPS_EVERY]
    every = {
        "position": slice(None, None, POSITION_EVERY),
        "attitude": slice(None, None, ATTITUDE_EVERY),
        "gimbal": slice(None, None, GIMBAL_EVERY),
    }
    # A receiver reports its scatter and drift, not the constant bias.
    accuracy = np.hypot(errors.position_drift_m, errors.gps_noise_m)
    east, north, up = motion.velocity_world_m_s[every["position"]].T
    return flight_log.SimulatedLog(
        boot_utc_s=scenario.flight.start_utc_s - boot_s,
        home_geodetic=np.array([site.latitude_deg, site.longitude_deg, site.height_msl_m]),
        undulation_m=site.undulation_m,
        position_time_s=boot_s + motion.time_s[every["position"]],
        position_geodetic=convert_to_geodetic(position[every["position"]], site),
        velocity_ned_m_s=np.stack([north, east, -up], axis=1),
        attitude_time_s=boot_s + motion.time_s[every["attitude"]],
        attitude_rpy_rad=body[every["attitude"]],
        gimbal_time_s=boot_s + motion.time_s[every["gimbal"]],
        gimbal_rpy_rad=gimbal[every["gimbal"]],
        gps_time_s=boot_s + motion.time_s[gps_rows],
        gps_geodetic=convert_to_geodetic(gps_position, site),
        gps_accuracy_m=np.tile(accuracy, (len(gps_position), 1)),
        event_time_s=boot_s + events,
        event_geodetic=convert_to_geodetic(interpolate(motion, position, events), site),
        event_rpy_rad=interpolate(motion, body, events),
    )


def convert_to_geodetic(position_world_m: Floats, site: Site) -> Floats:
    """Convert world (N, 3) to latitude, longitude [deg], height above sea level [m], (N, 3)."""
    ellipsoid_m = site.height_msl_m + site.undulation_m
    origin = (site.latitude_deg, site.longitude_deg, ellipsoid_m)
    latitude, longitude, height = geodetic_from_enu(position_world_m, origin)
    return np.column_stack([latitude, longitude, height - site.undulation_m])


def _draw_positions(
    scenario: Scenario, motion: Motion, biases: FlightBiases, rng: np.random.Generator
) -> tuple[Floats, Floats]:
    """Draw positions of estimator and receiver (N, 3): a common drift, and scatter of the fixes."""
    errors = scenario.errors
    horizontal, vertical = errors.position_drift_m
    sigma = np.array([horizontal, horizontal, vertical])
    count = len(motion.time_s)
    drift = draw_gauss_markov(rng, count, STEP_S, errors.position_drift_tau_s, sigma)
    estimated = motion.position_world_m + biases.position_m + drift
    if scenario.habits.gps_jump_m:
        amid = motion.time_s > np.median(motion.exposure_time_s)
        estimated[:, 1] += scenario.habits.gps_jump_m * amid
    scatter = np.array([errors.gps_noise_m[0], *errors.gps_noise_m])
    return estimated, estimated + scatter * rng.standard_normal((count, 3))


def _draw_angles(
    errors: ErrorSpec, motion: Motion, biases: FlightBiases, rng: np.random.Generator
) -> tuple[Floats, Floats]:
    """Draw the logged roll, pitch, yaw of body and gimbal, (N, 3) each."""
    count, tau = len(motion.time_s), errors.attitude_tau_s
    body_sigma = np.deg2rad([errors.attitude_deg, errors.attitude_deg, errors.heading_deg])
    body = motion.body_rpy_rad + draw_gauss_markov(rng, count, STEP_S, tau, body_sigma)
    body[:, 2] += biases.heading_rad
    gimbal_sigma = np.full(3, np.deg2rad(errors.gimbal_deg))
    gimbal = motion.gimbal_rpy_rad + draw_gauss_markov(rng, count, STEP_S, tau, gimbal_sigma)
    return body, gimbal


SYSTEM_EVERY_S = 1.0


def make_flight_log(log: flight_log.SimulatedLog) -> flight_log.FlightLog:
    """Return the log in the form of a log reader, but without the integer rounding of MAVLink.

    Parameters
    ----------
    log
        Recording of the autopilot.
    """
    return flight_log.FlightLog(
        path="flight.tlog",
        kind="tlog",
        vehicle="quadrotor",
        firmware="",
        boots=(_convert_to_boot(log),),
        messages=(),
        undulation_m=log.undulation_m,
        notes=(),
    )


def _convert_to_boot(log: flight_log.SimulatedLog) -> flight_log.Boot:
    clock_s = np.arange(log.position_time_s[0], log.position_time_s[-1], SYSTEM_EVERY_S)
    unstated = np.full(len(log.gps_time_s), np.nan)
    return flight_log.Boot(
        positions=_positions(log, "GLOBAL_POSITION_INT"),
        receiver=_positions(log, "GPS_RAW_INT"),
        attitudes=flight_log.AttitudeSamples(
            time_boot_s=log.attitude_time_s,
            ned_from_body_xyzw=xyzw_from_matrix(matrix_from_ypr(*log.attitude_rpy_rad.T[::-1])),
            source="ATTITUDE_QUATERNION",
        ),
        gimbal=flight_log.GimbalSamples(
            time_boot_s=log.gimbal_time_s,
            roll_rad=log.gimbal_rpy_rad[:, 0],
            pitch_rad=log.gimbal_rpy_rad[:, 1],
            yaw_rad=log.gimbal_rpy_rad[:, 2],
            yaw_frame="vehicle",
            source="GIMBAL_DEVICE_ATTITUDE_STATUS",
        ),
        sigmas=flight_log.EstimatorSigmas(
            time_boot_s=log.gps_time_s,
            horizontal_m=log.gps_accuracy_m[:, 0],
            vertical_m=log.gps_accuracy_m[:, 1],
            tilt_rad=unstated,
            yaw_rad=unstated,
            source="GPS_RAW_INT",
        ),
        events=flight_log.CameraEvents(
            time_boot_s=log.event_time_s,
            image_number=np.arange(1, len(log.event_time_s) + 1),
            confirmed=np.ones(len(log.event_time_s)),
            source="CAMERA_FEEDBACK",
        ),
        home=_home(log),
        clocks=(
            flight_log.ClockSamples(
                time_boot_s=clock_s, utc_s=log.boot_utc_s + clock_s, source="system_time"
            ),
        ),
        velocities=flight_log.VelocitySamples(
            time_boot_s=log.position_time_s,
            ned_m_s=log.velocity_ned_m_s,
            source="GLOBAL_POSITION_INT",
        ),
        turn_rates=flight_log.TurnRateSamples(
            time_boot_s=log.attitude_time_s,
            body_rad_s=np.gradient(
                np.unwrap(log.attitude_rpy_rad, axis=0), log.attitude_time_s, axis=0
            ),
            source="ATTITUDE_QUATERNION",
        ),
    )


def _positions(log: flight_log.SimulatedLog, source: str) -> flight_log.PositionSamples:
    raw = source == "GPS_RAW_INT"
    place = log.gps_geodetic if raw else log.position_geodetic
    above_home = np.full(len(place), np.nan) if raw else place[:, 2] - log.home_geodetic[2]
    return flight_log.PositionSamples(
        time_boot_s=log.gps_time_s if raw else log.position_time_s,
        latitude_deg=place[:, 0],
        longitude_deg=place[:, 1],
        height_m=place[:, 2],
        height_home_m=above_home,
        datum="msl",
        source=source,
    )


def _home(log: flight_log.SimulatedLog) -> flight_log.HomeSamples:
    latitude, longitude, height = log.home_geodetic
    return flight_log.HomeSamples(
        time_boot_s=log.position_time_s[:1],
        latitude_deg=np.array([latitude]),
        longitude_deg=np.array([longitude]),
        height_m=np.array([height]),
        datum="msl",
        source="HOME_POSITION",
    )
