"""The true flight: where the vehicle is, how it leans, where its gimbal looks, its exposures."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import numpy as np
from scipy.linalg import solve_banded
from scipy.ndimage import gaussian_filter1d

from uavgram.model.arrays import Floats, FrozenArrays
from uavgram.model.scenario.flight import FlightPlan
from uavgram.model.scenario.scenario import Site
from uavgram.stages.simulate.route import ON_GROUND_S, Route, exposures, route

STEP_S = 0.01
GRAVITY_M_S2 = 9.80665
CORNER_SIGMA_S = 0.8  # how softly the vehicle turns, brakes and speeds up
WOBBLE_TAU_S = 1.5
DRAG_PER_S = 0.25  # a multicopter leans about 6 degrees into 4.5 m/s


@dataclass(frozen=True, kw_only=True, eq=False)
class Motion(FrozenArrays):
    """N instants of the true flight, `STEP_S` apart.

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


def gauss_markov(
    rng: np.random.Generator, count: int, step_s: float, tau_s: float, sigma: Floats
) -> Floats:
    """Draw (count, K) stationary first-order Gauss-Markov noise with sigmas (K,).

    x[i+1] = a x[i] + w, a = exp(-step / tau), var w = sigma^2 (1 - a^2) (Gelb 1974, section 3.8).

    Parameters
    ----------
    rng
        Draws the errors.
    count
        Number of instants.
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
    # A recursion is nothing for numpy, and scipy.signal takes long to load: x solves a band matrix.
    band = np.array([np.ones(count), np.full(count, -decay)])
    return np.asarray(solve_banded((1, 0), band, white)) * sigma


def fly(plan: FlightPlan, site: Site, rng: np.random.Generator) -> Motion:
    """Fly the plan: up from home, from leg to leg, home, down.

    Parameters
    ----------
    plan, site
        Of the scenario.
    rng
        Draws trigger places and wobble.
    """
    flown = route(plan, site)
    knots = flown.start_s
    time = np.arange(0.0, knots[-1] + ON_GROUND_S, STEP_S)
    path = np.stack([np.interp(time, knots, column) for column in flown.waypoint_world_m.T], axis=1)
    path = gaussian_filter1d(path, CORNER_SIGMA_S / STEP_S, axis=0, mode="nearest")
    # On the ground nothing wobbles.
    aloft = np.clip(path[:, 2:] / plan.height_m, 0.0, 1.0)
    path = path + aloft * _wobble(rng, len(time), np.full(3, plan.wobble_m))
    velocity = np.gradient(path, STEP_S, axis=0)
    yaw = _turning(flown.yaw_rad, flown, time)
    body = _lean(velocity, yaw)
    tilt_sigma = np.deg2rad([plan.tilt_wobble_deg, plan.tilt_wobble_deg, plan.tilt_wobble_deg / 2])
    body = body + aloft * _wobble(rng, len(time), tilt_sigma)
    gimbal = _wobble(rng, len(time), np.full(3, np.deg2rad(plan.gimbal_wobble_deg)))
    gimbal[:, 1] += _turning(flown.pitch_rad, flown, time)
    return Motion(
        time_s=time,
        position_world_m=path,
        velocity_world_m_s=velocity,
        body_rpy_rad=body,
        gimbal_rpy_rad=gimbal,
        exposure_time_s=exposures(plan, flown, rng),
    )


def at(motion: Motion, column: Floats, instants_s: Floats) -> Floats:
    """Interpolate an (N, 3) column of the motion at (E,) instants, linearly: (E, 3).

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


def _turning(angle: Floats, flown: Route, time: Floats) -> Floats:
    """One angle (N,) of the flight: that of each leg, turned about half-way between two legs."""
    if np.ptp(angle) == 0:
        return np.full(len(time), angle[0])
    now = angle[np.searchsorted(flown.turn_s, time, side="right")]
    return gaussian_filter1d(now, CORNER_SIGMA_S / STEP_S, mode="nearest")


def _lean(velocity: Floats, yaw: Floats) -> Floats:
    """Roll, pitch, yaw (N, 3) of a multicopter: its thrust balances gravity, drag, acceleration."""
    force = np.gradient(velocity, STEP_S, axis=0) + DRAG_PER_S * velocity
    force = gaussian_filter1d(force, 0.3 / STEP_S, axis=0, mode="nearest")
    east, north, up = force.T
    ahead = np.sin(yaw) * east + np.cos(yaw) * north
    right = np.cos(yaw) * east - np.sin(yaw) * north
    up = up + GRAVITY_M_S2
    return np.stack([np.arctan2(right, np.hypot(ahead, up)), -np.arctan2(ahead, up), yaw], axis=1)


def _wobble(rng: np.random.Generator, count: int, sigma: Floats) -> Floats:
    """Smooth random motion (count, K) of about the given sigmas."""
    rough = gauss_markov(rng, count, STEP_S, WOBBLE_TAU_S, sigma)
    return gaussian_filter1d(rough, 0.25 / STEP_S, axis=0, mode="nearest")
