"""Small surveys with known truth, made without any code that the estimator uses for observing."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from uavgram.estimation.survey_state import State
from uavgram.model.camera import Calibration
from uavgram.model.pose import Poses, TelemetryPrior
from uavgram.model.survey import Ground, Survey
from uavgram.model.telemetry import Track

INTRINSICS = np.array([1500.0, 1505.0, 1010.0, 740.0, -0.08, 0.03, 3e-4, -2e-4, 0.005])
INTRINSIC_SIGMA = np.array([3.0, 3.0, 2.0, 2.0, 2e-3, 3e-3, 1e-4, 1e-4, 1e-3])
GIMBAL_FROM_CAMERA = np.array([[0.0, 0, 1], [1, 0, 0], [0, 1, 0]])


@dataclass(frozen=True)
class Scene:
    """A survey and the truth behind it."""

    survey: Survey
    truth: State
    pivot: np.ndarray


def look_down(yaw: float, tilt: float) -> np.ndarray:
    """World from camera: straight down with image up = yaw from north, then tilted upwards."""
    nadir = np.array([[1.0, 0, 0], [0, -1, 0], [0, 0, -1]])
    turn = Rotation.from_euler("z", -yaw).as_matrix()
    return turn @ nadir @ Rotation.from_euler("x", tilt).as_matrix()


def cv_pixels(intrinsics, center, rotation, world):
    """Pixels by OpenCV."""
    camera = (world - center) @ rotation
    matrix = np.array([[intrinsics[0], 0, intrinsics[2]], [0, intrinsics[1], intrinsics[3]], [0, 0, 1]])
    pixel, _ = cv2.projectPoints(camera, np.zeros(3), np.zeros(3), matrix, intrinsics[4:])
    return pixel[:, 0], camera[:, 2]


def make_scene(
    seed: int = 0,
    *,
    frames: int = 4,
    labels: int = 12,
    lines: int = 6,
    control: int = 0,
    telemetry: bool = True,
    roughness: float = 0.0,
    noise: float = 1.0,
    gauge: str = "world",
    tilt: float = 0.3,
    tape_sigma: float = 0.01,
) -> Scene:
    """A random scene; `noise` scales every error source (0: exact data)."""
    rng = np.random.default_rng(seed)
    plane = np.zeros(3) if gauge == "plane" else np.array([0.2, 0.004, -0.003]) * noise
    point = rng.uniform(-9, 9, (labels, 2))
    pivot = point.mean(axis=0)
    departure = rng.normal(0, roughness, labels) * noise if roughness else np.zeros(labels)
    up = plane[0] + (point - pivot) @ plane[1:] + departure
    world = np.column_stack([point, up])
    intrinsics = INTRINSICS + noise * rng.normal(0, INTRINSIC_SIGMA)
    time = 1000.0 + 2.0 * np.arange(frames)
    center = np.column_stack(
        [rng.uniform(-4, 4, frames), rng.uniform(-10, -4, frames), rng.uniform(24, 30, frames)]
    )
    rotation = np.stack([look_down(rng.normal(0, 0.2), tilt + rng.normal(0, 0.05)) for _ in time])
    if gauge == "plane":
        center[0, :2], rotation[0] = 0.0, look_down(0.0, tilt)
        world[:, 1] += 30 * np.tan(tilt)
        point = world[:, :2]
        pivot = point.mean(axis=0)
    picks = []
    for f in range(frames):
        pixel, depth = cv_pixels(intrinsics, center[f], rotation[f], world)
        inside = (depth > 0) & (pixel > 20).all(1) & (pixel < [1980, 1480]).all(1)
        for k in np.flatnonzero(inside):
            picks.append((f, k, *(pixel[k] + 0.7 * noise * rng.normal(size=2))))
    picks = np.array(picks)
    start, end = rng.permuted(np.tile(np.arange(labels), (lines, 1)), axis=1)[:, :2].T
    length = np.linalg.norm(world[start] - world[end], axis=1)
    length = length + tape_sigma * noise * rng.normal(size=lines)
    shared, prior, track, seeds = np.zeros(0), None, None, None
    if telemetry:
        shared, prior, track, seeds = _telemetry(rng, time, center, rotation, noise)
    known = np.arange(control)
    survey = Survey(
        frame_id=tuple(f"f{f}" for f in range(frames)),
        seeds=seeds,
        telemetry=prior,
        track=track,
        calibration=Calibration(
            name="test", model="brown", width_px=2000, height_px=1500, parameters=INTRINSICS,
            covariance=np.diag(INTRINSIC_SIGMA**2),
        ),
        label=tuple(f"P{k}" for k in range(labels)),
        height_above_m=np.zeros(labels),
        pick_frame=picks[:, 0].astype(int),
        pick_label=picks[:, 1].astype(int),
        pixel_px=picks[:, 2:],
        pick_sigma_px=np.full(len(picks), 0.7),
        line_start=start,
        line_end=end,
        length_m=length,
        length_sigma_m=np.full(lines, tape_sigma),
        control_label=known,
        control_world_m=world[known] + 0.02 * noise * rng.normal(size=(control, 3)),
        control_sigma_m=np.full((control, 3), 0.02),
        ground=Ground(height_m=0.0, height_sigma_m=0.3, slope_sigma_rad=0.01,
                      roughness_sigma_m=roughness),
        gauge=gauge,
    )
    values = np.column_stack([point, departure]) if roughness else point
    basis = INTRINSIC_SIGMA
    truth = State(
        point=values, center=center, rotation=rotation,
        intrinsic=np.sort((intrinsics - INTRINSICS) / basis), plane=plane, telemetry=shared,
    )
    return Scene(survey, truth, pivot)


def _telemetry(rng, time, center, rotation, noise):
    """A flight whose log is wrong by boresight, lever arm, biases and clock, as stated."""
    arm = np.array([0.12, -0.05, 0.08])
    sigma = np.array([*[0.02] * 3, *[0.05] * 3, 1.0, 1.0, 1.5, 0.02, 0.05])
    shared = noise * rng.normal(0, sigma)
    own = np.diag(np.array([0.4, 0.5, 0.6, 0.012, 0.015, 0.02]) ** 2)
    shared[3:6] += arm
    heading = Rotation.from_rotvec([0, 0, shared[9]]).as_matrix()
    boresight = Rotation.from_rotvec(shared[:3]).as_matrix()
    errors = noise * rng.multivariate_normal(np.zeros(6), own, len(time))
    logged_rotation, logged_position = [], []
    for c, r, e in zip(center, rotation, errors, strict=True):
        predicted = r @ Rotation.from_rotvec(e[3:]).as_matrix()
        body = heading.T @ predicted @ boresight.T @ GIMBAL_FROM_CAMERA.T
        logged_rotation.append(body)
        logged_position.append(c - e[:3] + shared[6:9] - heading @ body @ shared[3:6])
    # Logged before and after each true instant, on a straight and steady way through it; the
    # stated instants are late by the clock correction.
    sampled = (time[:, None] + np.array([-0.5, 0.5])).ravel()
    velocity, rate = rng.normal(0, 3, (len(time), 3)), rng.normal(0, 0.05, (len(time), 3))
    ends = [Rotation.from_rotvec(0.5 * sign * rate) for sign in (-1, 1)]
    middle = Rotation.from_matrix(np.array(logged_rotation))
    attitude = np.stack([(middle * end).as_quat() for end in ends], axis=1).reshape(-1, 4)
    position = np.array(logged_position)[:, None] + np.array([-0.5, 0.5])[:, None] * velocity[:, None]
    track = Track(
        position_time_s=sampled, position_world_m=position.reshape(-1, 3), attitude_time_s=sampled,
        world_from_body_xyzw=attitude,
        gimbal_time_s=np.zeros(0), world_from_gimbal_xyzw=np.zeros((0, 4)),
        sigma_time_s=time[:1], sigma_position_m=np.array([[0.5, 0.6]]),
        sigma_attitude_rad=np.array([[0.015, 0.02]]), source="test",
    )
    stated = time + shared[10]
    prior = TelemetryPrior(
        frame_index=np.arange(len(time)), time_s=stated, gimbal_from_camera=GIMBAL_FROM_CAMERA,
        covariance=np.tile(own, (len(time), 1, 1)), clock_sigma_s=0.05, boresight_sigma_rad=0.02,
        heading_bias_sigma_rad=0.02, lever_arm_m=arm, lever_arm_sigma_m=0.05,
        position_bias_sigma_m=np.array([1.0, 1.0, 1.5]),
    )
    seeds = Poses(
        frame_id=tuple(f"f{f}" for f in range(len(time))), center_world_m=center + 0.5 * noise,
        world_from_camera=rotation @ Rotation.from_rotvec([0.02 * noise] * 3).as_matrix(),
        covariance=np.tile(np.eye(6), (len(time), 1, 1)),
    )
    return shared, prior, track, seeds


@pytest.fixture
def scene_factory():
    return make_scene
