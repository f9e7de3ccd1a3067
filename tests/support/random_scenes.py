"""Random surveys with known truth over the whole range of use, for studies of many thousands.

What `scenes.make_scene` does for one family of scenes, this does for all: height 15 to 120 m, tilt
0 to 60 degrees, 4 to 10 known lengths, 1 to 20 frames, telemetry good, poor or absent. Pixels come
from OpenCV, small rotations from scipy; nothing here is shared with what the estimator observes by.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations

import numpy as np
import scenes
from scenes import GIMBAL_FROM_CAMERA, LEVER_ARM, Scene, Sources, about_z, cv_pixels, look_down
from scipy.spatial.transform import Rotation

from uavgram.estimation.survey.unknowns import State
from uavgram.model.arrays import Floats, Ints
from uavgram.model.camera import Calibration
from uavgram.model.flight_log import Track
from uavgram.model.frames import PhotoExposures, TelemetryPrior
from uavgram.model.survey import Ground, Survey

LABELS = 9
MEASURED = (7, 8)
"""The labels whose distance is judged, and of which the second's position is."""

CALIBRATION_COVARIANCE = scenes.calibration_covariance()
CALIBRATION_ROOT = np.linalg.cholesky(CALIBRATION_COVARIANCE)

MANY_FRAMES = 0.02
"""Share of the scenes with 6 to 20 frames."""

GOOD = np.array([0.05, 0.06, 0.10, 0.002, 0.008, 0.004])
POOR = np.array([0.5, 0.8, 1.2, 0.005, 0.025, 0.012])
"""Sigmas of one frame's telemetry: centre in the world [m], rotation in the camera [rad]. Every
axis has another, so that an error on the wrong one shows."""

SHARED = {
    "boresight": np.array([0.01, 0.01, 0.01]),
    "lever_arm": np.array([0.15, 0.15, 0.15]),
    "position_bias": np.array([0.6, 0.6, 1.0]),
    "heading_bias": np.array([0.03]),
    "clock": np.array([0.05]),
    "clock_drift": np.array([0.005]),
}
PLANE_SIGMA = np.array([0.3, 0.01, 0.01])
ROUGHNESS_M = 0.06
INSTANTS_S = np.array([-0.6, -0.45, 0.45, 0.6])
"""Of the log's samples about each exposure; the way between them is straight and steady."""


@dataclass(frozen=True, kw_only=True)
class Kind:
    """What a scene may hold.

    Attributes
    ----------
    sources
        The errors that are switched on; None: all.
    telemetry
        Qualities to choose from: ``good``, ``poor``, ``absent``.
    log
        The telemetry is a log that a clock can shift, instead of poses that come with the photos.
    control
        Number of control points.
    lines
        Fewest and most known lengths; the first four share no end.
    bare
        Share of the scenes that have no known length: there the telemetry decides alone.
    rough
        Whether the ground departs from its plane.
    verge
        Whether every second label lies on a plane of its own, beside the road and higher; the
        measured distance then leads from the one to the other.
    frames
        Numbers of frames to choose from; two scenes in a hundred have 6 to 20 all the same, where
        more than one is possible.
    tape_m
        Least and greatest sigma of the known lengths: taped, or paced.
    """

    sources: tuple[str, ...] | None
    telemetry: tuple[str, ...] = ("good", "poor", "absent")
    log: bool = False
    control: int = 0
    lines: tuple[int, int] = (4, 10)
    bare: float = 0.0
    rough: bool = False
    verge: bool = False
    frames: tuple[int, ...] = (1, 1, 1, 1, 1, 1, 2, 2, 3, 3, 4, 5)
    tape_m: tuple[float, float] = (0.01, 0.2)


def random_scene(seed: int | tuple[int, ...], kind: Kind) -> Scene:
    """One scene: its survey with noise, and its truth (the interior orientation's left out)."""
    rng = np.random.default_rng(seed)
    source = Sources(kind.sources, 1.0)
    quality = kind.telemetry[rng.integers(len(kind.telemetry))]
    world_gauge = quality != "absent" or kind.control > 0
    center, rotation = _cameras(rng, kind)
    planes = source.noise("plane") * rng.normal(0, PLANE_SIGMA)[None] * world_gauge
    area = np.arange(LABELS) % 2 * kind.verge
    if kind.verge:
        own = source.noise("plane") * rng.spawn(1)[0].normal(0, PLANE_SIGMA)
        planes = np.stack([planes[0], own])
        planes[1, 0] += scenes.VERGE_M
    departure = source.noise("roughness") * ROUGHNESS_M * rng.normal(size=LABELS) * kind.rough
    planar = _ground_points(rng, center, rotation)
    if not world_gauge:
        planar, center, rotation = _at_gauge(planar, center, rotation)
    pivot = np.stack([planar[area == a].mean(axis=0) for a in range(len(planes))])
    up = planes[area, 0] + np.sum(planes[area, 1:] * (planar - pivot[area]), axis=1) + departure
    world = np.column_stack([planar, up])
    error = source.noise("calibration") * CALIBRATION_ROOT @ rng.normal(size=9)
    covariance = source.sigma("calibration") ** 2 * CALIBRATION_COVARIANCE
    picks = _picks(rng, scenes.INTRINSICS + error, center, rotation, world, source)
    start, end = _line_ends(rng, kind)
    tape = np.exp(rng.uniform(*np.log(kind.tape_m))) * source.sigma("lengths")
    length = np.linalg.norm(world[start] - world[end], axis=1)
    known = np.arange(kind.control)
    control_sigma = scenes.CONTROL_SIGMA * source.sigma("control")
    shared, prior, flight = np.zeros(0), None, None
    if quality != "absent":
        own = GOOD if quality == "good" else POOR
        shared, prior, flight = _telemetry(rng, source, own, kind, center, rotation)
    survey = Survey(
        frame_id=tuple(f"f{f}" for f in range(len(center))),
        seeds=None,
        telemetry=prior,
        track=flight,
        calibration=Calibration(
            name="test",
            model="brown",
            width_px=2000,
            height_px=1500,
            parameters=scenes.INTRINSICS,
            covariance=covariance,
        ),
        label=tuple(f"P{k}" for k in range(LABELS)),
        height_above_m=np.zeros(LABELS),
        pick_frame=picks[:, 0].astype(int),
        pick_label=picks[:, 1].astype(int),
        pixel_px=picks[:, 2:],
        pick_sigma_px=np.full(len(picks), scenes.PIXEL_SIGMA * source.sigma("pixels")),
        line_start=start,
        line_end=end,
        length_m=length + tape * rng.normal(size=len(length)),
        length_sigma_m=np.full(len(length), tape),
        control_label=known,
        control_world_m=world[known] + control_sigma * rng.normal(size=(kind.control, 3)),
        control_sigma_m=np.tile(control_sigma, (kind.control, 1)),
        grounds=(
            _ground(source, kind, "road", 0.0),
            *(_ground(source, kind, "verge", scenes.VERGE_M),) * kind.verge,
        ),
        area=area,
        gauge="world" if world_gauge else "plane",
    )
    truth = State(
        point=np.column_stack([planar, departure]) if kind.rough else planar,
        center=center,
        rotation=rotation,
        intrinsic=np.zeros(9),
        plane=planes.ravel(),
        relief=np.zeros(0),
        telemetry=shared,
    )
    return Scene(survey, truth, pivot, world)


def _ground(source: Sources, kind: Kind, name: str, height: float) -> Ground:
    return Ground(
        name=name,
        height_m=height,
        height_sigma_m=PLANE_SIGMA[0] * source.sigma("plane"),
        slope_sigma_rad=PLANE_SIGMA[1] * source.sigma("plane"),
        roughness_sigma_m=ROUGHNESS_M * source.sigma("roughness") * kind.rough,
    )


def _cameras(rng: np.random.Generator, kind: Kind) -> tuple[Floats, Floats]:
    """Frames about a scene at the origin, all at one height, each looking at it."""
    count = rng.choice(kind.frames)
    if max(kind.frames) > 1 and rng.random() < MANY_FRAMES:
        count = rng.integers(6, 21)
    height = 15.0 * 8.0 ** rng.random()
    tilt = rng.uniform(0, np.pi / 3)
    yaw = rng.uniform(-np.pi, np.pi) + rng.normal(0, 0.5, count)
    back = height * np.tan(tilt)
    center = np.column_stack([-back * np.sin(yaw), -back * np.cos(yaw), np.full(count, height)])
    center += rng.normal(0, 0.05 * height, center.shape)
    cosine, sine, zero = np.cos(yaw), np.sin(yaw), np.zeros(count)
    turn = np.stack([cosine, sine, zero, -sine, cosine, zero, zero, zero, zero + 1], axis=1)
    wobble = Rotation.from_rotvec(rng.normal(0, 0.03, (count, 3))).as_matrix()
    return center, turn.reshape(-1, 3, 3) @ look_down(0.0, tilt) @ wobble


def _ground_points(rng: np.random.Generator, center: Floats, rotation: Floats) -> Floats:
    """(K, 2) points scattered over the middle of the first image, and so on the ground z = 0."""
    x = rng.uniform(-0.42, 0.42, LABELS)
    y = rng.uniform(-0.33, 0.33, LABELS)
    ray = np.column_stack([x, y, np.ones(LABELS)]) @ rotation[0].T
    # No ray flatter than 10 degrees: beyond, a pixel is worth many metres.
    sink = np.minimum(ray[:, 2], -np.sin(np.deg2rad(10)) * np.linalg.norm(ray, axis=1))
    planar: Floats = center[0, :2] - center[0, 2] * ray[:, :2] / sink[:, None]
    return planar


def _at_gauge(planar: Floats, center: Floats, rotation: Floats) -> tuple[Floats, Floats, Floats]:
    """The same scene, its first frame above the origin and its image up towards north."""
    image_up = -rotation[0, :2, 1]
    turn = about_z(np.arctan2(*image_up))
    foot = np.array([*center[0, :2], 0.0])
    return (planar - foot[:2]) @ turn[:2, :2].T, (center - foot) @ turn.T, turn @ rotation


def _picks(
    rng: np.random.Generator,
    intrinsics: Floats,
    center: Floats,
    rotation: Floats,
    world: Floats,
    source: Sources,
) -> Floats:
    """(P, 4) frame, label, u, v; all labels in the first frame, elsewhere those well inside."""
    picks = []
    for f in range(len(center)):
        pixel, depth = cv_pixels(intrinsics, center[f], rotation[f], world)
        inside = (depth > 0) & (pixel > 20).all(1) & (pixel < [1980, 1480]).all(1)
        seen = np.flatnonzero(inside | (f == 0))
        picks.append(np.column_stack([np.full(len(seen), f), seen, pixel[seen]]))
    table = np.concatenate(picks)
    sigma = source.noise("pixels") * scenes.PIXEL_SIGMA
    table[:, 2:] += sigma * rng.normal(size=(len(table), 2))
    return table


def _line_ends(rng: np.random.Generator, kind: Kind) -> tuple[Ints, Ints]:
    """Ends of the known lengths: four of them apart, the others at random; none measured."""
    count = rng.integers(kind.lines[0], kind.lines[1] + 1) * (rng.random() >= kind.bare)
    pairs = [tuple(sorted(pair)) for pair in rng.permutation(8).reshape(4, 2).tolist()]
    free = [pair for pair in combinations(range(LABELS), 2) if pair not in (*pairs, MEASURED)]
    extra = rng.permutation(len(free))[: max(count - 4, 0)]
    ends = np.array(pairs[:count] + [free[k] for k in extra], dtype=int).reshape(-1, 2)
    return ends[:, 0], ends[:, 1]


def _telemetry(
    rng: np.random.Generator,
    source: Sources,
    sigma: Floats,
    kind: Kind,
    center: Floats,
    rotation: Floats,
) -> tuple[Floats, TelemetryPrior, Track | PhotoExposures]:
    """What was recorded of the flight: wrong by what all frames share, and each by its own."""
    count = len(center)
    shared_sigma = np.concatenate([s * source.sigma(n) for n, s in SHARED.items()])
    shared = shared_sigma * rng.normal(size=len(shared_sigma))
    shared[3:6] += LEVER_ARM
    own = sigma * source.sigma("telemetry") * rng.normal(size=(count, 6))
    heading = about_z(shared[9])
    boresight = Rotation.from_rotvec(shared[:3]).as_matrix()
    predicted = rotation @ Rotation.from_rotvec(own[:, 3:]).as_matrix()
    body = heading.T @ predicted @ boresight.T @ GIMBAL_FROM_CAMERA.T
    position = center + own[:, :3] + shared[6:9] - heading @ body @ shared[3:6]
    time = 1000.0 + 2.0 * np.arange(count, dtype=float)
    middle = float(time.mean())
    # What the camera's clock reads: time = read - clock - drift (read - middle), solved for it.
    read = (time + shared[10] - shared[11] * middle) / (1.0 - shared[11])
    names = tuple(f"f{f}" for f in range(count))
    record = _log(rng, time, position, body) if kind.log else _photos(names, position, body)
    prior = TelemetryPrior(
        frame_index=np.arange(count),
        time_s=read,
        middle_s=middle,
        gimbal_from_camera=GIMBAL_FROM_CAMERA,
        covariance=np.tile(np.diag((sigma * source.sigma("telemetry")) ** 2), (count, 1, 1)),
        clock_sigma_s=shared_sigma[10],
        clock_drift_sigma=shared_sigma[11],
        boresight_sigma_rad=shared_sigma[0],
        heading_bias_sigma_rad=shared_sigma[9],
        lever_arm_m=LEVER_ARM,
        lever_arm_sigma_m=shared_sigma[3],
        position_bias_sigma_m=shared_sigma[6:9],
    )
    return shared, prior, record


def _photos(names: tuple[str, ...], position: Floats, body: Floats) -> PhotoExposures:
    count = len(names)
    return PhotoExposures(
        frame_id=names,
        position_world_m=position,
        world_from_body=body,
        world_from_gimbal=body,
        sigma_position_m=np.ones((count, 2)),
        sigma_attitude_rad=np.ones((count, 2)),
        by_mount=np.zeros(count, dtype=bool),
        source="test",
    )


def _log(rng: np.random.Generator, time: Floats, position: Floats, body: Floats) -> Track:
    count = len(time)
    velocity, rate = rng.normal(0, 5, (count, 3)), rng.normal(0, 0.1, (count, 3))
    sampled = (time[:, None] + INSTANTS_S).ravel()
    turns = Rotation.from_rotvec((INSTANTS_S[:, None] * rate[:, None]).reshape(-1, 3))
    middle = Rotation.from_matrix(np.repeat(body, len(INSTANTS_S), axis=0))
    way = position[:, None] + INSTANTS_S[:, None] * velocity[:, None]
    return Track(
        position_time_s=sampled,
        position_world_m=way.reshape(-1, 3),
        attitude_time_s=sampled,
        world_from_body_xyzw=(middle * turns).as_quat(),
        gimbal_time_s=np.zeros(0),
        world_from_gimbal_xyzw=np.zeros((0, 4)),
        sigma_time_s=time[:1],
        sigma_position_m=np.array([[0.5, 0.6]]),
        sigma_attitude_rad=np.array([[0.015, 0.02]]),
        source="test",
    )
