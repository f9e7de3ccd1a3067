"""Small surveys with known truth, made without any code that the estimator uses for observing."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import cv2
import numpy as np
from scipy.spatial.transform import Rotation

from uavgram.estimation.survey.likelihood import compute_covariance_root
from uavgram.estimation.survey.unknowns import State
from uavgram.model.arrays import Floats
from uavgram.model.camera import Calibration
from uavgram.model.flight_log import Track
from uavgram.model.frames import Frames, Poses, TelemetryPrior
from uavgram.model.survey import Ground, Survey

INTRINSICS = np.array([1500.0, 1505.0, 1010.0, 740.0, -0.08, 0.03, 3e-4, -2e-4, 0.005])
INTRINSIC_SIGMA = np.array([12.0, 15.0, 8.0, 10.0, 6e-3, 6e-3, 4e-4, 6e-4, 2e-3])
FOCAL_CORRELATION = 0.9
GIMBAL_FROM_CAMERA = np.array([[0.0, 0, 1], [1, 0, 0], [0, 1, 0]])

SOURCES: tuple[str, ...] = (
    "pixels",
    "lengths",
    "control",
    "calibration",
    "plane",
    "roughness",
    "telemetry",
    "boresight",
    "lever_arm",
    "position_bias",
    "heading_bias",
    "clock",
    "clock_drift",
)
OFF = 0.05
"""Of its usual sigma is what a source still has, in the model and in the data, when it is off."""

PIXEL_SIGMA = 0.7
CONTROL_SIGMA = np.array([0.02, 0.03, 0.05])
PLANE_SIGMA = np.array([0.3, 0.01, 0.01])
VERGE_M = 0.4
SHARED_SIGMA = np.array([*[0.02] * 3, *[0.15] * 3, 0.6, 1.0, 1.5, 0.02, 0.05, 0.004])
SHARED_SOURCE: tuple[str, ...] = ("boresight",) * 3 + ("lever_arm",) * 3 + ("position_bias",) * 3
SHARED_SOURCE += ("heading_bias", "clock", "clock_drift")
NO_TIMES = Frames(
    frame_id=(),
    time_utc_s=np.zeros(0),
    sigma_time_s=np.zeros(0),
    matched=np.zeros(0, dtype=bool),
    reason=(),
    clock_offset_s=0.0,
    clock_offset_sigma_s=0.0,
)
"""Photos without times: for all that is measured but a speed."""

LEVER_ARM = np.array([0.12, -0.05, 0.08])


@dataclass(frozen=True)
class Scene:
    """A survey and the truth behind it."""

    survey: Survey
    truth: State
    pivot: Floats
    world: Floats
    """(K, 3) true points."""


class Sources:
    """Which errors are switched on: factors of the sigmas in the model, and of the noise."""

    def __init__(self, on: tuple[str, ...] | None, noise: float) -> None:
        unknown = set(on or ()) - set(SOURCES)
        assert not unknown, unknown
        self._on, self._noise = SOURCES if on is None else on, noise

    def sigma(self, name: str) -> float:
        return 1.0 if name in self._on else OFF

    def noise(self, name: str) -> float:
        return self._noise * self.sigma(name)


def about_z(angle: float) -> Floats:
    """Turn about z: a matrix, in a tenth of the time that scipy takes for one."""
    cosine, sine = np.cos(angle), np.sin(angle)
    return np.array([[cosine, -sine, 0.0], [sine, cosine, 0.0], [0.0, 0.0, 1.0]])


def look_down(yaw: float, tilt: float) -> Floats:
    """World from camera: straight down with image up = yaw from north, then tilted upwards."""
    cosine, sine = np.cos(tilt), np.sin(tilt)
    tilted = np.array([[1.0, 0.0, 0.0], [0.0, -cosine, sine], [0.0, -sine, -cosine]])
    rotation: Floats = about_z(-yaw) @ tilted
    return rotation


def cv_pixels(
    intrinsics: Floats, center: Floats, rotation: Floats, world: Floats
) -> tuple[Floats, Floats]:
    """Pixels by OpenCV, and depths."""
    camera = (world - center) @ rotation
    fx, fy, cx, cy = intrinsics[:4]
    matrix = np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1]])
    pixel, _ = cv2.projectPoints(camera, np.zeros(3), np.zeros(3), matrix, intrinsics[4:])
    return np.asarray(pixel[:, 0], np.float64), camera[:, 2]


def calibration_covariance() -> Floats:
    """Focal lengths go together."""
    correlation = np.eye(9)
    correlation[0, 1] = correlation[1, 0] = FOCAL_CORRELATION
    return correlation * np.outer(INTRINSIC_SIGMA, INTRINSIC_SIGMA)


def gauss_markov(white: Floats, time: Floats, correlation_s: float) -> Floats:
    """Independent errors (N, ...) made to go together over `correlation_s`, as large as before.

    First-order Gauss-Markov process: e_k = rho e_(k-1) + sqrt(1 - rho^2) w_k.
    """
    if correlation_s == 0:
        return white
    errors = np.array(white)
    for k, rho in enumerate(np.exp(-np.diff(time) / correlation_s), start=1):
        errors[k] = rho * errors[k - 1] + np.sqrt(1 - rho**2) * white[k]
    return errors


def own_covariance() -> Floats:
    """Of one frame's telemetry: every axis another sigma, and some go together."""
    sigma = np.array([0.4, 0.5, 0.6, 0.012, 0.015, 0.02])
    correlation = np.eye(6)
    correlation[0, 4] = correlation[4, 0] = 0.5
    correlation[3, 5] = correlation[5, 3] = -0.4
    return correlation * np.outer(sigma, sigma)


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
    gauge: Literal["world", "plane"] = "world",
    tilt: float = 0.3,
    tape_sigma: float = 0.01,
    sources: tuple[str, ...] | None = None,
    spread: float = 9.0,
    along: float = 0.0,
    heights: dict[int, float] | None = None,
    ends: tuple[tuple[int, int], ...] | None = None,
    verge: tuple[int, ...] = (),
    correlation_s: float = 0.0,
) -> Scene:
    """A random scene.

    `noise` scales every error (0: exact data); `sources` names the errors that are switched on
    (None: all); `along` spreads frames and points over that many metres of a road to the east;
    `ends` are the lines (default: random pairs); `heights` of labels above the plane; labels of
    the `verge` lie on a second plane, VERGE_M higher than the first up to its own errors; errors of
    the telemetry's frames go together over about `correlation_s` (0: each on its own), whatever
    the survey says of them.
    """
    rng = np.random.default_rng(seed)
    source = Sources(sources, noise)
    plane = source.noise("plane") * rng.normal(0, PLANE_SIGMA)
    plane = plane if gauge == "world" else np.zeros(3)
    point = rng.uniform(-spread, spread, (labels, 2))
    point[:, 0] += along * np.linspace(-0.5, 0.5, labels)
    pivot = point.mean(axis=0)
    above = np.zeros(labels)
    for label, height in (heights or {}).items():
        above[label] = height
    departure = source.noise("roughness") * rng.normal(0, roughness, labels)
    second = source.noise("plane") * rng.spawn(1)[0].normal(0, PLANE_SIGMA) + [VERGE_M, 0, 0]
    up = plane[0] + (point - pivot) @ plane[1:]
    if verge:
        on = list(verge)
        up[on] = second[0] + (point[on] - point[on].mean(axis=0)) @ second[1:]
    world = np.column_stack([point, up + departure + above])
    covariance = calibration_covariance() * source.sigma("calibration") ** 2
    error = rng.multivariate_normal(np.zeros(9), calibration_covariance())
    error = source.noise("calibration") * error
    time = 1000.0 + 2.0 * np.arange(frames, dtype=float)
    center = np.column_stack(
        [rng.uniform(-4, 4, frames), rng.uniform(-10, -4, frames), rng.uniform(24, 30, frames)]
    )
    center[:, 0] += along * np.linspace(-0.5, 0.5, frames)
    rotation = np.stack([look_down(rng.normal(0, 0.2), tilt + rng.normal(0, 0.05)) for _ in time])
    if gauge == "plane":
        center[0, :2], rotation[0] = 0.0, look_down(0.0, tilt)
        center[1:, 1] += 30 * np.tan(tilt)
        world[:, 1] += 30 * np.tan(tilt)
        point = world[:, :2]
        pivot = point.mean(axis=0)
    area = np.isin(np.arange(labels), verge).astype(int)
    if verge:
        pivot = np.stack([point[area == a].mean(axis=0) for a in (0, 1)])
        plane = np.concatenate([plane, second])
    pixel_noise = source.noise("pixels") * PIXEL_SIGMA
    picks = _pick(rng, INTRINSICS + error, center, rotation, world, pixel_noise)
    if ends is None:
        start, end = rng.permuted(np.tile(np.arange(labels), (lines, 1)), axis=1)[:, :2].T
    else:
        start, end = np.array(ends, dtype=int).reshape(-1, 2).T
    length = np.linalg.norm(world[start] - world[end], axis=1)
    length = length + source.noise("lengths") * tape_sigma * rng.normal(size=len(length))
    known = np.arange(control)
    control_error = source.noise("control") * rng.normal(0, CONTROL_SIGMA, (control, 3))
    shared, prior, track, seeds = np.zeros(0), None, None, None
    if telemetry:
        shared, prior, track, seeds = _telemetry(rng, source, time, center, rotation, correlation_s)
    survey = Survey(
        frame_id=tuple(f"f{f}" for f in range(frames)),
        seeds=seeds,
        telemetry=prior,
        track=track,
        calibration=Calibration(
            name="test",
            model="brown",
            width_px=2000,
            height_px=1500,
            parameters=INTRINSICS,
            covariance=covariance,
        ),
        label=tuple(f"P{k}" for k in range(labels)),
        height_above_m=above,
        pick_frame=picks[:, 0].astype(int),
        pick_label=picks[:, 1].astype(int),
        pixel_px=picks[:, 2:],
        pick_sigma_px=np.full(len(picks), PIXEL_SIGMA * source.sigma("pixels")),
        line_start=start,
        line_end=end,
        length_m=length,
        length_sigma_m=np.full(len(length), tape_sigma * source.sigma("lengths")),
        control_label=known,
        control_world_m=world[known] + control_error,
        control_sigma_m=np.tile(CONTROL_SIGMA * source.sigma("control"), (control, 1)),
        grounds=(
            _ground(source, "default", 0.0, roughness),
            *((_ground(source, "verge", VERGE_M, roughness),) if verge else ()),
        ),
        area=area,
        gauge=gauge,
    )
    truth = State(
        point=np.column_stack([point, departure]) if roughness else point,
        center=center,
        rotation=rotation,
        intrinsic=np.linalg.lstsq(compute_covariance_root(covariance), error)[0].astype(float),
        plane=plane,
        relief=np.zeros(0),
        telemetry=shared,
    )
    return Scene(survey, truth, pivot, world)


def picked_beside(scene: Scene, size_m: float, seed: int) -> Scene:
    """A scene whose labels were picked beside what was meant, alike in all photos."""
    survey, truth = scene.survey, scene.truth
    off = np.zeros_like(scene.world)
    off[:, :2] = size_m * np.random.default_rng(seed).normal(size=(len(off), 2))
    pixel = np.array(survey.pixel_px)
    for frame in range(len(survey.frame_id)):
        rows = np.flatnonzero(survey.pick_frame == frame)
        seen = [
            cv_pixels(INTRINSICS, truth.center[frame], truth.rotation[frame], world)[0]
            for world in (scene.world + off, scene.world)
        ]
        pixel[rows] += (seen[0] - seen[1])[survey.pick_label[rows]]
    return replace(scene, survey=replace(survey, pixel_px=pixel))


Motion = tuple[float, float, float]
"""Shift to the east and north [m], and rotation about the points' middle [rad]."""


def show_moved(
    scene: Scene, labels: tuple[int, ...], frames: tuple[int, ...], motion: Motion
) -> Survey:
    """Show some points of a scene moved on the ground, in some photos."""
    survey, moved = scene.survey, scene.world.copy()
    own, (east, north, angle) = list(labels), motion
    middle = scene.world[own].mean(axis=0)
    moved[own] = middle + (scene.world[own] - middle) @ about_z(angle).T + [east, north, 0.0]
    pixel = np.array(survey.pixel_px)
    for frame in frames:
        pose = scene.truth.center[frame], scene.truth.rotation[frame]
        before, after = (cv_pixels(INTRINSICS, *pose, world)[0] for world in (scene.world, moved))
        rows = np.flatnonzero(survey.pick_frame == frame)
        pixel[rows] += (after - before)[survey.pick_label[rows]]
    return replace(survey, pixel_px=pixel)


def _ground(source: Sources, name: str, height: float, roughness: float) -> Ground:
    return Ground(
        name=name,
        height_m=height,
        height_sigma_m=PLANE_SIGMA[0] * source.sigma("plane"),
        slope_sigma_rad=PLANE_SIGMA[1] * source.sigma("plane"),
        roughness_sigma_m=roughness * source.sigma("roughness"),
    )


def _pick(
    rng: np.random.Generator,
    intrinsics: Floats,
    center: Floats,
    rotation: Floats,
    world: Floats,
    sigma: float,
) -> Floats:
    """(P, 4) frame, label, u, v of all points well inside each image."""
    picks = []
    for f in range(len(center)):
        pixel, depth = cv_pixels(intrinsics, center[f], rotation[f], world)
        inside = (depth > 0) & (pixel > 20).all(1) & (pixel < [1980, 1480]).all(1)
        noisy = pixel + sigma * rng.normal(size=pixel.shape)
        picks += [(f, k, *noisy[k]) for k in np.flatnonzero(inside)]
    return np.array(picks).reshape(-1, 4)


def _telemetry(
    rng: np.random.Generator,
    source: Sources,
    time: Floats,
    center: Floats,
    rotation: Floats,
    correlation_s: float,
) -> tuple[Floats, TelemetryPrior, Track, Poses]:
    """A flight whose log is wrong by boresight, lever arm, biases and clock, as stated."""
    switch = np.array([source.sigma(name) for name in SHARED_SOURCE])
    noise = np.array([source.noise(name) for name in SHARED_SOURCE])
    usual = np.array(SHARED_SIGMA)
    usual[11] *= min(1.0, 10.0 / len(time))  # a long flight's ends stay within what was logged
    # The drift came last: drawn apart, it leaves every other draw of a scene as it was.
    drift = rng.spawn(1)[0].normal(0, usual[11])
    shared = noise * np.append(rng.normal(0, usual[:11]), drift)
    sigma = usual * switch
    shared[3:6] += LEVER_ARM
    heading = Rotation.from_rotvec([0, 0, shared[9]]).as_matrix()
    boresight = Rotation.from_rotvec(shared[:3]).as_matrix()
    errors = rng.multivariate_normal(np.zeros(6), own_covariance(), len(time))
    errors = gauss_markov(errors, time, correlation_s) * source.noise("telemetry")
    logged_rotation, logged_position = [], []
    for c, r, e in zip(center, rotation, errors, strict=True):
        predicted = r @ Rotation.from_rotvec(e[3:]).as_matrix()
        body = heading.T @ predicted @ boresight.T @ GIMBAL_FROM_CAMERA.T
        logged_rotation.append(body)
        logged_position.append(c + e[:3] + shared[6:9] - heading @ body @ shared[3:6])
    # Logged twice before and after each true instant, on a straight and steady way through it, so
    # that any fair interpolation gives that way; the stated instants are late by the clock
    # correction.
    instants = np.array([-0.6, -0.45, 0.45, 0.6])
    sampled = (time[:, None] + instants).ravel()
    velocity, rate = rng.normal(0, 3, (len(time), 3)), rng.normal(0, 0.05, (len(time), 3))
    turns = [Rotation.from_rotvec(instant * rate) for instant in instants]
    middle = Rotation.from_matrix(np.array(logged_rotation))
    attitude = np.stack([(middle * turn).as_quat() for turn in turns], axis=1).reshape(-1, 4)
    way = instants[:, None] * velocity[:, None]
    track = Track(
        position_time_s=sampled,
        position_world_m=(np.array(logged_position)[:, None] + way).reshape(-1, 3),
        attitude_time_s=sampled,
        world_from_body_xyzw=attitude,
        gimbal_time_s=np.zeros(0),
        world_from_gimbal_xyzw=np.zeros((0, 4)),
        sigma_time_s=time[:1],
        sigma_position_m=np.array([[0.5, 0.6]]),
        sigma_attitude_rad=np.array([[0.015, 0.02]]),
        source="test",
    )
    middle_s = 1000.0 + (len(time) - 1)
    # What the camera's clock reads: t = s - clock - drift (s - middle), solved for s.
    stated = (time + shared[10] - shared[11] * middle_s) / (1.0 - shared[11])
    prior = TelemetryPrior(
        frame_index=np.arange(len(time)),
        time_s=stated,
        middle_s=middle_s,
        gimbal_from_camera=GIMBAL_FROM_CAMERA,
        covariance=np.tile(own_covariance() * source.sigma("telemetry") ** 2, (len(time), 1, 1)),
        clock_sigma_s=sigma[10],
        clock_drift_sigma=sigma[11],
        boresight_sigma_rad=sigma[0],
        heading_bias_sigma_rad=sigma[9],
        lever_arm_m=LEVER_ARM,
        lever_arm_sigma_m=sigma[3],
        position_bias_sigma_m=sigma[6:9],
    )
    seeds = Poses(
        frame_id=tuple(f"f{f}" for f in range(len(time))),
        center_world_m=center + 0.5 * (np.abs(noise).max() > 0),
        world_from_camera=rotation @ Rotation.from_rotvec([0.01] * 3).as_matrix(),
        covariance=np.tile(np.eye(6), (len(time), 1, 1)),
    )
    return shared, prior, track, seeds
