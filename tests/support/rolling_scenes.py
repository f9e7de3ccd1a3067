"""Small surveys whose photos are read row after row, with known truth: a projection of its own."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scenes import GIMBAL_FROM_CAMERA, INTRINSICS, LEVER_ARM, PIXEL_SIGMA, Scene, cv_pixels
from scipy.spatial.transform import Rotation

from uavgram.estimation.survey.likelihood import compute_covariance_root
from uavgram.estimation.survey.observed import add_readout
from uavgram.model.arrays import Floats
from uavgram.model.flight_log import Track

NOMINAL = np.zeros(12)
NOMINAL[3:6] = LEVER_ARM


def true_motion(scene: Scene) -> Floats:
    """(F, 6) of the cameras, from the log's samples about each exposure and the true mount."""
    track, shared = scene.survey.track, scene.truth.telemetry
    assert isinstance(track, Track)
    first, last = slice(1, None, 4), slice(2, None, 4)  # of four samples the inner two
    span = (track.position_time_s[last] - track.position_time_s[first])[:, None]
    velocity = (track.position_world_m[last] - track.position_world_m[first]) / span
    start, end = (Rotation.from_quat(track.world_from_body_xyzw[part]) for part in (first, last))
    rate = (start.inv() * end).as_rotvec() / span
    middle = start * Rotation.from_rotvec(0.5 * span * rate)
    to_world = Rotation.from_rotvec([0, 0, shared[9]]) * middle
    camera = Rotation.from_matrix(GIMBAL_FROM_CAMERA) * Rotation.from_rotvec(shared[:3])
    swung = to_world.apply(np.cross(rate, shared[3:6]))
    return np.concatenate([velocity + swung, camera.inv().apply(rate)], axis=1)


def row_pixels(
    scene: Scene, motion: Floats, readout_s: float, frame: int, intrinsics: Floats
) -> Floats:
    """(K, 2) pixels of all points in a frame by OpenCV, each at the instant of its own row."""
    center, rotation = scene.truth.center[frame], scene.truth.rotation[frame]
    pixel, _ = cv_pixels(intrinsics, center, rotation, scene.world)
    height = scene.survey.calibration.height_px
    for _ in range(20):
        late_s = readout_s * (pixel[:, 1] - (height - 1) / 2) / height
        here = center + late_s[:, None] * motion[frame, :3]
        turned = Rotation.from_matrix(rotation) * Rotation.from_rotvec(
            late_s[:, None] * motion[frame, 3:]
        )
        camera = turned.inv().apply(scene.world - here)
        pixel, _ = cv_pixels(intrinsics, np.zeros(3), np.eye(3), camera)
    return pixel


def read_in_rows(scene: Scene, readout_s: float, *, noise: float = 1.0, seed: int = 0) -> Scene:
    """The scene with picks as a camera of such a readout time has them, and that as an unknown."""
    survey, motion = scene.survey, true_motion(scene)
    error = compute_covariance_root(survey.calibration.covariance) @ scene.truth.intrinsic
    frames = range(len(survey.frame_id))
    every = np.stack([row_pixels(scene, motion, readout_s, f, INTRINSICS + error) for f in frames])
    pixel = every[survey.pick_frame, survey.pick_label]
    pixel += noise * PIXEL_SIGMA * np.random.default_rng((77, seed)).normal(size=pixel.shape)
    rolling = add_readout(replace(survey, pixel_px=pixel), NOMINAL)
    truth = replace(scene.truth, readout=np.array([readout_s]))
    return replace(scene, survey=rolling, truth=truth)
