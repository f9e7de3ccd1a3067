"""Small photos of a level, textured ground from known poses: what ties them is known exactly."""

from __future__ import annotations

from collections import defaultdict
from functools import cache
from itertools import combinations
from pathlib import Path

import cv2
import numpy as np

from uavgram.geometry.motion.rotation import exp_so3
from uavgram.imaging.raster import Image, make_texture
from uavgram.model.arrays import Floats
from uavgram.model.camera import Calibration
from uavgram.model.frames import Poses
from uavgram.model.survey import TiePicks

WIDTH_PX, HEIGHT_PX, FOCAL_PX = 640, 480, 620.0
GROUND_PX, PER_M = 2400, 20.0

CAMERA = Calibration(
    name="plain",
    model="brown",
    width_px=WIDTH_PX,
    height_px=HEIGHT_PX,
    parameters=np.array([FOCAL_PX, FOCAL_PX, 319.5, 239.5, 0.0, 0.0, 0.0, 0.0, 0.0]),
    covariance=np.zeros((9, 9)),
)
K = np.array([[FOCAL_PX, 0.0, 319.5], [0.0, FOCAL_PX, 239.5], [0.0, 0.0, 1.0]])
DOWN = np.diag([1.0, -1.0, -1.0])
"""World from camera, looking straight down with north up."""


@cache
def ground() -> Image:
    """A picture of the ground, 20 pixels a metre, its middle at the origin."""
    rng = np.random.default_rng(5)
    noise = make_texture(rng, (GROUND_PX, GROUND_PX), {2: 0.5, 5: 0.7, 14: 0.7, 60: 0.6})
    return np.asarray(np.clip(120.0 + 35.0 * noise, 0, 255), np.uint8)


def flight(*, sigma_m: float = 0.5, sigma_rad: float = 0.01) -> Poses:
    """Four photos in a row, tilted a little, and a fifth that flew the other way."""
    rng = np.random.default_rng(2)
    turn = [exp_so3(rng.normal(0.0, 0.05, 3)) for _ in range(5)]
    turn[4] = turn[4] @ exp_so3(np.array([0.0, 0.0, np.pi]))
    center = np.array([[7.0 * (k - 1.5), 0.0, 30.0] for k in range(4)] + [[2.0, 6.0, 31.0]])
    return Poses(
        frame_id=tuple(f"p{k}.png" for k in range(5)),
        center_world_m=center,
        world_from_camera=np.array([DOWN @ one for one in turn]),
        covariance=np.tile(np.diag([sigma_m**2] * 3 + [sigma_rad**2] * 3), (5, 1, 1)),
    )


def photo(poses: Poses, k: int) -> Image:
    """What a camera sees, with noise and a brightness of its own."""
    pixel_from_ground = K @ _camera_from_ground(poses, k)
    scale = np.array(
        [
            [1 / PER_M, 0.0, -0.5 * GROUND_PX / PER_M],
            [0.0, -1 / PER_M, 0.5 * GROUND_PX / PER_M],
            [0.0, 0.0, 1.0],
        ]
    )
    seen = cv2.warpPerspective(ground(), pixel_from_ground @ scale, (WIDTH_PX, HEIGHT_PX))
    noise = np.random.default_rng(k).normal(0.0, 2.0, seen.shape)
    return np.asarray(np.clip(seen * (1.0 - 0.05 * k) + noise, 0, 255), np.uint8)


def write_photos(folder: Path, poses: Poses) -> tuple[str, ...]:
    """Files of all photos."""
    folder.mkdir(parents=True, exist_ok=True)
    for k, name in enumerate(poses.frame_id):
        cv2.imwrite(str(folder / name), photo(poses, k))
    return tuple(str(folder / name) for name in poses.frame_id)


def epipolar(poses: Poses, ties: TiePicks) -> tuple[Floats, Floats]:
    """Distances from the true epipolar lines [px] of all pairs of sightings, and over sigma."""
    of_tie = defaultdict(list)
    for row, tie in enumerate(ties.tie):
        of_tie[tie].append(row)
    pairs = [pair for rows in of_tie.values() for pair in combinations(rows, 2)]
    one, other = np.array(pairs).reshape(-1, 2).T
    photos = np.array([poses.frame_id.index(name) for name in ties.image])
    rays = np.column_stack([ties.pixel_px, np.ones(len(photos))]) @ np.linalg.inv(K).T
    rotation, center = poses.world_from_camera[photos], poses.center_world_m[photos]
    world = np.einsum("nij,nj->ni", rotation, rays)
    normal = np.cross(center[other] - center[one], world[one])
    line = np.einsum("nji,nj->ni", rotation[other], normal)
    off = FOCAL_PX * (line * rays[other]).sum(axis=1) / np.hypot(line[:, 0], line[:, 1])
    return off, off / np.hypot(ties.sigma_px[one], ties.sigma_px[other])


def _camera_from_ground(poses: Poses, k: int) -> Floats:
    """(3, 3) from (east, north, 1) on the ground to the camera's axes."""
    rotation = poses.world_from_camera[k].T
    return np.column_stack([rotation[:, :2], -rotation @ poses.center_world_m[k]])
