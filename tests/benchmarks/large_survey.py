"""A mapping flight of any size: frames on a grid, every point in the five frames nearest to it."""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

from uavgram.geometry.camera.projection import project
from uavgram.model.arrays import Floats, Ints
from uavgram.model.camera import Calibration
from uavgram.model.flight_log import Track
from uavgram.model.frames import Poses, TelemetryPrior
from uavgram.model.survey import Ground, Survey

INTRINSICS = np.array([2250.0, 2251.0, 1511.5, 1117.5, -0.08, 0.03, 3e-4, -2e-4, 0.0])
SIGMA = np.array([3.0, 3.0, 2.0, 2.0, 1.5e-3, 3e-3, 1e-4, 1e-4, 1e-3])
GIMBAL_FROM_CAMERA = np.array([[0.0, 0, 1], [1, 0, 0], [0, 1, 0]])
HEIGHT_M, SPACING_M = 40.0, 10.0


def large_survey(frames: int, per_frame: int = 20, seed: int = 0) -> Survey:
    """About `frames` frames with `per_frame` picks each, known lengths on one point in fifty."""
    rng = np.random.default_rng(seed)
    side = round(np.sqrt(frames))
    grid = np.stack(np.meshgrid(np.arange(side), np.arange(-(-frames // side))), -1).reshape(-1, 2)
    center = np.column_stack([grid[:frames] * SPACING_M, np.full(frames, HEIGHT_M)])
    center += rng.normal(0, 0.5, center.shape)
    nadir = np.array([[1.0, 0, 0], [0, -1, 0], [0, 0, -1]])
    rotation = nadir @ Rotation.from_rotvec(rng.normal(0, 0.03, (frames, 3))).as_matrix()
    points = np.zeros((frames * per_frame // 5, 3))
    points[:, :2] = rng.uniform(0, grid[:frames].max(0) * SPACING_M, (len(points), 2))
    nearest = cKDTree(center[:, :2]).query(points[:, :2], k=5)[1]
    frame, label = nearest.ravel(), np.repeat(np.arange(len(points)), 5)
    camera = np.einsum("nji,nj->ni", rotation[frame], points[label] - center[frame])
    pixel = project("brown", INTRINSICS, camera) + rng.normal(0, 0.7, (len(frame), 2))
    inside = (pixel > 5).all(1) & (pixel < [2994, 2244]).all(1)
    tied = np.unique(label[inside])
    place = np.full(len(points), -1)
    place[tied] = np.arange(len(tied))
    lines = rng.choice(tied, len(tied) // 50, replace=False)
    neighbours: Ints = np.asarray(cKDTree(points[tied, :2]).query(points[lines, :2], k=2)[1])
    partner = neighbours[:, 1]
    length = np.linalg.norm(points[lines] - points[tied[partner]], axis=1)
    own = np.diag(np.array([0.5, 0.5, 0.5, 0.02, 0.02, 0.03]) ** 2)
    errors = rng.multivariate_normal(np.zeros(6), own, frames)
    seeds = Poses(
        frame_id=tuple(f"f{i}" for i in range(frames)),
        center_world_m=center + errors[:, :3],
        world_from_camera=rotation @ Rotation.from_rotvec(errors[:, 3:]).as_matrix(),
        covariance=np.tile(own, (frames, 1, 1)),
    )
    return Survey(
        frame_id=seeds.frame_id,
        seeds=seeds,
        telemetry=_prior(frames, own),
        track=_track(seeds),
        calibration=Calibration(
            name="bench", model="brown", width_px=3000, height_px=2250, parameters=INTRINSICS,
            covariance=np.diag(SIGMA**2),
        ),
        label=tuple(f"P{k}" for k in tied),
        height_above_m=np.zeros(len(tied), dtype=int),
        pick_frame=frame[inside],
        pick_label=place[label[inside]],
        pixel_px=pixel[inside],
        pick_sigma_px=np.full(int(inside.sum()), 0.7),
        line_start=place[lines],
        line_end=partner,
        length_m=length + rng.normal(0, 0.01, len(lines)),
        length_sigma_m=np.full(len(lines), 0.01),
        control_label=np.empty(0, dtype=int),
        control_world_m=np.empty((0, 3)),
        control_sigma_m=np.empty((0, 3)),
        grounds=(Ground(
            height_m=0.0, height_sigma_m=0.3, slope_sigma_rad=0.01, roughness_sigma_m=0.0
        ),),
        area=np.zeros(len(tied), dtype=int),
        gauge="world",
    )  # fmt: skip


def _prior(frames: int, own: Floats) -> TelemetryPrior:
    return TelemetryPrior(
        frame_index=np.arange(frames), time_s=10.0 * np.arange(frames, dtype=float),
        middle_s=5.0 * (frames - 1),
        gimbal_from_camera=GIMBAL_FROM_CAMERA, covariance=np.tile(own, (frames, 1, 1)),
        clock_sigma_s=0.05, clock_drift_sigma=5e-5,
        boresight_sigma_rad=0.02, heading_bias_sigma_rad=0.02,
        lever_arm_m=np.zeros(3), lever_arm_sigma_m=0.05,
        position_bias_sigma_m=np.array([2.0, 2.0, 3.0]),
    )  # fmt: skip


def _track(seeds: Poses) -> Track:
    """Through each seed at 5 m/s for a second, straight and steady, as the vehicle's log has it."""
    instants = np.array([-0.6, -0.45, 0.45, 0.6])
    time = (10.0 * np.arange(len(seeds.frame_id))[:, None] + instants).ravel()
    way = instants[:, None] * np.array([5.0, 0.0, 0.0])
    body = seeds.world_from_camera @ GIMBAL_FROM_CAMERA.T
    return Track(
        position_time_s=time,
        position_world_m=(seeds.center_world_m[:, None] + way).reshape(-1, 3),
        attitude_time_s=time,
        world_from_body_xyzw=np.repeat(Rotation.from_matrix(body).as_quat(), 4, axis=0),
        gimbal_time_s=np.empty(0, dtype=int), world_from_gimbal_xyzw=np.empty((0, 4)),
        sigma_time_s=time[:1], sigma_position_m=np.array([[0.5, 0.5]]),
        sigma_attitude_rad=np.array([[0.02, 0.03]]), source="bench",
    )  # fmt: skip
