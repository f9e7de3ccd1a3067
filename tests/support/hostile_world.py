"""The true ground, flight and camera of a made-up survey, by formulas of their own.

World: east, north, up [m] about the take-off; projections are OpenCV's.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from hostile_conditions import Condition
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation

from uavgram.model.arrays import Floats, Ints
from uavgram.model.options import GroundOptions

HEIGHT_M = 36.0
CAMERA_FROM_GIMBAL = np.array([[0.0, 1, 0], [0, 0, 1], [1, 0, 0]])  # gimbal: x looks, -z is up
ENU_FROM_NED = np.array([[0.0, 1, 0], [1, 0, 0], [0, 0, -1]])
GRAVITY_M_S2 = 9.81
MOST_LEAN_RAD = 0.25
BEYOND = 2  # places flown to before the first photo, and after the last


@dataclass(frozen=True, kw_only=True, eq=False)
class StatedCamera:
    """A camera as calibrated: (9,) parameters in OpenCV's order, fx fy cx cy k1 k2 p1 p2 k3."""

    width_px: int
    height_px: int
    lens: Floats
    sigma: Floats

    @property
    def covariance(self) -> Floats:
        """(9, 9): both focal lengths go together."""
        covariance = np.diag(self.sigma**2)
        covariance[0, 1] = covariance[1, 0] = FOCAL_CORRELATION * self.sigma[0] * self.sigma[1]
        return covariance


FOCAL_CORRELATION = 0.95
ORDINARY = StatedCamera(
    width_px=2400,
    height_px=1800,
    lens=np.array([1900.0, 1902.0, 1204.0, 893.0, -0.06, 0.02, 3e-4, -2e-4, 0.0]),
    sigma=np.array([3.0, 3.0, 2.0, 2.0, 1e-3, 2e-3, 1e-4, 1e-4, 1e-3]),
)
SHARP = StatedCamera(
    width_px=4000,
    height_px=3000,
    lens=np.array([3170.0, 3172.0, 2004.0, 1493.0, -0.06, 0.02, 3e-4, -2e-4, 0.0]),
    sigma=np.array([4.0, 4.0, 3.0, 3.0, 1e-3, 2e-3, 1e-4, 1e-4, 1e-3]),
)


def draw_lenses(
    condition: Condition, camera: StatedCamera, count: int, rng: np.random.Generator
) -> Floats:
    """(f, 9) true lenses: an error of the stated size, and what the condition does beyond it."""
    lens = np.tile(rng.multivariate_normal(camera.lens, camera.covariance), (count, 1))
    other = rng.permutation(count)[: condition.other_camera_photos]
    lens[other] = camera.lens * [1.01, 1.01, 1.01, 0.99, 1.2, 1.5, 1.0, 1.0, 1.0]
    lens[:, :2] *= condition.zoom * (1 + condition.focal_error)
    lens[:, 2] += condition.principal_error_px
    return lens


class Smooth:
    """A smooth Gaussian process in time, of some independent components.

    Parameters
    ----------
    rng
        Draws it.
    sigma
        (d,) of each component.
    tau
        Correlation length (its covariance is a Gaussian of that width).
    """

    def __init__(self, rng: np.random.Generator, sigma: Floats, tau: float) -> None:
        waves = 24
        self._rate = rng.standard_normal(waves) / tau
        self._size = rng.standard_normal((2, waves, len(sigma))) * sigma / np.sqrt(waves)

    def __call__(self, time: Floats) -> Floats:
        """(n, d) at times (n,)."""
        angle = time[:, None] * self._rate
        return np.asarray(np.cos(angle) @ self._size[0] + np.sin(angle) @ self._size[1])


@dataclass(frozen=True, kw_only=True, eq=False)
class TrueGround:
    """Heights of the ground: a plane, shapes along a line, relief.

    `along` is the unit vector across the line through `middle` (2,), `waves` (w, 2), `cosine` and
    `sine` (w,) those of the relief.
    """

    condition: Condition
    middle: Floats
    along: Floats
    height_m: float
    slope: Floats
    waves: Floats
    cosine: Floats
    sine: Floats

    def up(self, place: Floats) -> Floats:
        """(n,) heights at (n, 2) east and north; without relief that has no length."""
        c = self.condition
        local = place - self.middle
        across = local @ self.along
        angle = local @ self.waves.T
        relief = np.cos(angle) @ self.cosine + np.sin(angle) @ self.sine
        shape = (
            c.kerb_m * (across > 0)
            + c.bank_m * np.clip((across - 5.0) / 3.0, 0.0, 1.0)
            - c.crown_percent / 100 * np.abs(across)
            + c.slope_break_percent / 100 * np.maximum(across, 0.0)
        )
        return np.asarray(self.height_m + local @ self.slope + shape + relief)


def draw_ground(condition: Condition, rng: np.random.Generator) -> TrueGround:
    """A ground whose plane is drawn from the program's default priors."""
    options = GroundOptions()
    slope_deg = options.slope_sigma_deg if condition.draws_slope else 0.5
    across, steepest = rng.uniform(0, 2 * np.pi, 2)
    slope = np.tan(np.deg2rad(slope_deg * rng.standard_normal(2)))
    if condition.slope_deg:
        slope = np.tan(np.deg2rad(condition.slope_deg)) * _direction(steepest)
    waves = rng.standard_normal((200, 2)) / (condition.relief_length_m or 1.0)
    size = condition.relief_m / np.sqrt(len(waves)) if condition.relief_length_m else 0.0
    return TrueGround(
        condition=condition,
        middle=rng.uniform(-30, 30, 2),
        along=_direction(across),
        height_m=float(options.height_sigma_m * rng.standard_normal()),
        slope=slope,
        waves=waves,
        cosine=size * rng.standard_normal(len(waves)),
        sine=size * rng.standard_normal(len(waves)),
    )


@dataclass(frozen=True, kw_only=True, eq=False)
class TrueFlight:
    """Where the vehicle was, and how its body and its camera's mount were turned.

    Attributes
    ----------
    exposure_s
        (f,) seconds since the flight's start.
    span_s
        First and last instant of the log.
    lever_arm_m, boresight_rad
        (3,) body axes; (3,) camera axes, true = nominal @ exp(boresight).
    """

    exposure_s: Floats
    span_s: tuple[float, float]
    lever_arm_m: Floats
    boresight_rad: Floats
    path: CubicSpline
    view: CubicSpline
    sway: Smooth
    shake: Smooth

    def position(self, time: Floats) -> Floats:
        """(n, 3) of the vehicle."""
        return np.asarray(self.path(time))

    def velocity(self, time: Floats) -> Floats:
        """(n, 3) of the vehicle."""
        return np.asarray(self.path(time, 1))

    def ned_from_body(self, time: Floats) -> Rotation:
        """The vehicle leans into its acceleration, and sways."""
        yaw = self.view(time)[:, 0]
        east, north, _ = np.asarray(self.path(time, 2)).T
        forward = east * np.sin(yaw) + north * np.cos(yaw)
        right = east * np.cos(yaw) - north * np.sin(yaw)
        sway = self.sway(time)
        pitch = MOST_LEAN_RAD * np.tanh(-forward / GRAVITY_M_S2) + sway[:, 1]
        roll = MOST_LEAN_RAD * np.tanh(right / GRAVITY_M_S2) + sway[:, 0]
        return Rotation.from_euler("ZYX", np.column_stack([yaw + sway[:, 2], pitch, roll]))

    def ned_from_mount(self, time: Floats) -> Rotation:
        """The gimbal holds its direction, up to a little shaking."""
        yaw, tilt = np.asarray(self.view(time)).T
        shake = self.shake(time)
        angles = np.column_stack([yaw, tilt - np.pi / 2, np.zeros(len(yaw))]) + shake
        return Rotation.from_euler("ZYX", angles)

    def camera(self, time: Floats) -> tuple[Floats, Floats]:
        """(n, 3) centres and (n, 3, 3) rotations, camera to world."""
        body = ENU_FROM_NED @ self.ned_from_body(time).as_matrix()
        mount = ENU_FROM_NED @ self.ned_from_mount(time).as_matrix()
        turned = CAMERA_FROM_GIMBAL.T @ cv2.Rodrigues(self.boresight_rad)[0]
        return self.position(time) + body @ self.lever_arm_m, mount @ turned


def draw_flight(condition: Condition, middle: Floats, rng: np.random.Generator) -> TrueFlight:
    """A drone that flies past the scene, always looking at it."""
    count = condition.photos + 2 * BEYOND
    step = np.clip((np.arange(count) - BEYOND) / (condition.photos - 1), 0.0, 1.0)
    tilt = np.deg2rad(condition.tilts_deg[0] + step * np.ptp(condition.tilts_deg))
    tilt = np.abs(tilt + np.deg2rad(1.0) * rng.standard_normal(count))
    turn = rng.choice([-1, 1]) * np.deg2rad(10.0 + 6.0 * rng.standard_normal(count))
    yaw = rng.uniform(0, 2 * np.pi) + np.cumsum(turn)
    back = HEIGHT_M * np.tan(tilt)
    aim = middle + 3.0 * rng.standard_normal((count, 2))
    stride = condition.stride_m * (np.arange(count) - (count - 1) / 2)
    if condition.stride_m:
        aim += stride[:, None] * _direction(rng.uniform(0, 2 * np.pi))
    ground = aim - back[:, None] * np.column_stack([np.sin(yaw), np.cos(yaw)])
    place = np.column_stack([ground, HEIGHT_M + 0.5 * rng.standard_normal(count)])
    far = np.linalg.norm(np.diff(place, axis=0), axis=1)
    speed = rng.uniform(*condition.speeds_m_s) * rng.uniform(0.9, 1.1, count - 1)
    needed = np.maximum(far / speed, 0.4)
    time = np.r_[0.0, np.cumsum(needed)]
    return TrueFlight(
        exposure_s=time[BEYOND : BEYOND + condition.photos],
        span_s=(0.0, float(time[-1])),
        lever_arm_m=0.1 * rng.standard_normal(3) + condition.lever_m * _unit(rng),
        boresight_rad=np.deg2rad(2.0 * rng.standard_normal(3) + condition.mount_deg * _unit(rng)),
        path=CubicSpline(time, place, bc_type="natural"),
        view=CubicSpline(time, np.column_stack([yaw, tilt]), bc_type="natural"),
        sway=Smooth(rng, np.deg2rad([1.5, 1.5, 0.5]), 1.5),
        shake=Smooth(rng, np.full(3, np.deg2rad(0.2)), 1.0),
    )


def photograph(
    flight: TrueFlight,
    lens: Floats,
    frame: Ints,
    world_m: Floats,
    rows: tuple[int, float],
) -> tuple[Floats, Floats]:
    """Pixels (n, 2), each row exposed at its own instant, and depths (n,) of points in frames.

    Parameters
    ----------
    flight
        Moves while the rows are read.
    lens
        (n, 9) parameters in OpenCV's order, fx fy cx cy k1 k2 p1 p2 k3.
    frame
        (n,) which exposure.
    world_m
        (n, 3) points.
    rows
        How many, and in which time [s] they are read.
    """
    height_px, readout_s = rows
    late = np.zeros(len(frame))
    for _ in range(12 if readout_s else 1):
        center, rotation = flight.camera(flight.exposure_s[frame] + late)
        seen = np.einsum("nji,nj->ni", rotation, world_m - center)
        pixel = project(lens, seen)
        row = np.clip(pixel[:, 1], -height_px, 2 * height_px)
        late = readout_s * (row - (height_px - 1) / 2) / height_px
    return pixel, seen[:, 2]


def project(lens: Floats, seen: Floats) -> Floats:
    """(n, 2) pixels of points (n, 3) in camera axes, after OpenCV; the lens (n, 9) may differ."""
    pixel = np.empty((len(seen), 2))
    for own in np.unique(lens, axis=0):
        rows = (lens == own).all(axis=1)
        matrix = np.array([[own[0], 0, own[2]], [0, own[1], own[3]], [0, 0, 1.0]])
        found, _ = cv2.projectPoints(seen[rows], np.zeros(3), np.zeros(3), matrix, own[4:])
        pixel[rows] = found[:, 0]
    return pixel


def _direction(azimuth: float) -> Floats:
    return np.array([np.sin(azimuth), np.cos(azimuth)])


def _unit(rng: np.random.Generator) -> Floats:
    drawn = rng.standard_normal(3)
    return np.asarray(drawn / np.linalg.norm(drawn))
