"""Single photos of level ground with known truth, for the comparison of pose methods."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from uavgram.geometry.camera.projection import project
from uavgram.geometry.motion.rotation import (
    ENU_FROM_NED,
    GIMBAL_FROM_CAMERA,
    exp_so3,
    matrix_from_ypr,
)
from uavgram.model.arrays import Floats
from uavgram.model.camera import Calibration

SIZE_PX = (4000, 3000)
FOCAL_PX = 2250.0
AREA_M = (40.0, 30.0)
PAIR_COUNT = 12
"""Number of withheld distances in a scene."""
MIN_DISTANCE_M = 3.0
"""Smallest withheld distance; shorter ones depend little on the pose."""
DRAW_COUNT = 400
"""Number of candidate lines, and of withheld distances, for each scene."""
LOG_SIGMA = (1.5, 1.5, 3.0, *np.deg2rad([1.0, 1.0, 2.0]).tolist())
"""Sigmas of a usual drone's log: centre [m], rotation about the camera's axes [rad]."""


@dataclass(frozen=True, kw_only=True)
class Setting:
    """Properties of scenes; pairs of numbers are the ends of a range.

    Attributes
    ----------
    features
        Smallest and largest number of lines in a scene.
    length_m, tilt_deg, height_m
        Of the lines; of the view from straight down; of the camera above the ground.
    turn_deg
        Range of the lines' directions.
    share
        Relative size of the part of the area with the lines, which is in a random corner.
    pick_px, place_m, tape_m
        Standard deviations.
    relief_m
        Unstated standard deviation of the points' height above the ground.
    bulge
        Radial distortion k1 of the lens, unknown to the methods.
    """

    name: str
    features: tuple[int, int] = (4, 8)
    length_m: tuple[float, float] = (3.0, 15.0)
    tilt_deg: tuple[float, float] = (0.0, 60.0)
    height_m: float = 40.0
    turn_deg: float = 180.0
    share: float = 1.0
    pick_px: float = 0.8
    place_m: float = 0.01
    tape_m: float = 0.01
    relief_m: float = 0.0
    bulge: float = 0.0


@dataclass(frozen=True, eq=False)
class MethodScenes:
    """B scenes with n lines each.

    Attributes
    ----------
    calibration
        The lens, assumed exact.
    pixel_px, pick_sigma_px
        (B, n, 2, 2) picks of start and end of each line, and sigma of each coordinate.
    place_m, place_sigma_m
        (B, n, 2, 2) stated places of start and end.
    length_m, length_sigma_m
        (B, n) taped lengths.
    center, rotation
        (B, 3), (B, 3, 3) the truth.
    logged
        Centres (B, 3) and rotations (B, 3, 3) in the log.
    check_px, check_m
        (B, m, 2, 2) picks of the ends of withheld distances; (B, m) these.
    """

    calibration: Calibration
    pixel_px: Floats
    pick_sigma_px: float
    place_m: Floats
    place_sigma_m: float
    length_m: Floats
    length_sigma_m: float
    center: Floats
    rotation: Floats
    logged: tuple[Floats, Floats]
    check_px: Floats
    check_m: Floats


def draw_scenes(setting: Setting, lines: int, count: int, seed: int) -> MethodScenes:
    """Draw scenes.

    Parameters
    ----------
    setting
        Their properties.
    lines, count
        Lines in each; number of scenes.
    seed
        Of the draws.

    Raises
    ------
    ValueError
        The lines of the setting do not fit into the ground that a camera sees.
    """
    rng = np.random.default_rng((1909, seed, lines))
    truth = make_study_camera(setting.bulge)
    drawn = [_draw_scene(setting, lines, truth, rng) for _ in range(count)]
    center, rotation, ends, pairs = (np.stack(part) for part in zip(*drawn, strict=True))
    # picks with the true lens and relief, positions and lengths on level ground
    measured = np.linalg.norm(ends[:, :, 1] - ends[:, :, 0], axis=-1)
    pixel = _project_points(truth, center, rotation, _raise(ends, setting.relief_m, rng))
    check = _raise(pairs, setting.relief_m, rng)
    # logged pose with normal errors
    error = np.array(LOG_SIGMA) * rng.normal(size=(count, 6))
    return MethodScenes(
        calibration=make_study_camera(0.0),
        pixel_px=_add_noise(pixel, setting.pick_px, rng),
        pick_sigma_px=setting.pick_px,
        place_m=ends + setting.place_m * rng.normal(size=ends.shape),
        place_sigma_m=setting.place_m,
        length_m=measured + setting.tape_m * rng.normal(size=measured.shape),
        length_sigma_m=setting.tape_m,
        center=center,
        rotation=rotation,
        logged=(center + error[:, :3], rotation @ exp_so3(error[:, 3:])),
        check_px=_add_noise(_project_points(truth, center, rotation, check), setting.pick_px, rng),
        check_m=np.linalg.norm(check[:, :, 1, :2] - check[:, :, 0, :2], axis=-1),
    )


def make_study_camera(bulge: float) -> Calibration:
    """Return a camera of 12 megapixels with radial distortion k1."""
    focal, (width, height) = FOCAL_PX, SIZE_PX
    return Calibration(
        name="study",
        model="brown",
        width_px=width,
        height_px=height,
        parameters=np.array([focal, focal, (width - 1) / 2, (height - 1) / 2, bulge, 0, 0, 0, 0]),
        covariance=np.zeros((9, 9)),
    )


def _draw_scene(
    setting: Setting, lines: int, lens: Calibration, rng: np.random.Generator
) -> tuple[Floats, Floats, Floats, Floats]:
    """Draw centre, rotation, ends (n, 2, 2) of lines, and those (m, 2, 2) of withheld distances."""
    pitch = np.deg2rad(rng.uniform(*setting.tilt_deg)) - np.pi / 2
    roll = np.deg2rad(3.0) * rng.normal()
    body = ENU_FROM_NED @ matrix_from_ypr(rng.uniform(0.0, 2.0 * np.pi), pitch, roll)
    rotation = body @ GIMBAL_FROM_CAMERA
    axis = rotation[:, 2]
    center = -axis / -axis[2] * setting.height_m  # it looks at the middle of the area
    camera = lens, center, rotation
    found = _keep_visible(_draw_lines(setting, rng), camera, lines)
    pairs = rng.uniform(-0.5, 0.5, (DRAW_COUNT, 2, 2)) * AREA_M
    apart = np.linalg.norm(pairs[:, 1] - pairs[:, 0], axis=1) >= MIN_DISTANCE_M
    return center, rotation, found, _keep_visible(pairs[apart], camera, PAIR_COUNT)


def _draw_lines(setting: Setting, rng: np.random.Generator) -> Floats:
    """Draw (k, 2, 2) ends of lines inside their part of the area."""
    half = np.array(AREA_M) / 2 * setting.share
    middle = (np.array(AREA_M) / 2 - half) * rng.choice([-1.0, 1.0], 2)
    turn = np.deg2rad(setting.turn_deg) / 2
    angle = rng.uniform(0.0, np.pi) + rng.uniform(-turn, turn, DRAW_COUNT)
    start = middle + rng.uniform(-half, half, (DRAW_COUNT, 2))
    ahead = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    end = start + ahead * rng.uniform(*setting.length_m, (DRAW_COUNT, 1))
    inside = np.all(np.abs(end - middle) <= half, axis=1)
    return np.asarray(np.stack([start, end], axis=1)[inside])


def _keep_visible(ends: Floats, camera: tuple[Calibration, Floats, Floats], count: int) -> Floats:
    """Return the first (count, 2, 2) lines with both ends in the photo."""
    lens, center, rotation = camera
    world = np.concatenate([ends, np.zeros((*ends.shape[:2], 1))], axis=-1)
    pixel = _project_points(lens, center[None], rotation[None], world[None])[0]
    with np.errstate(invalid="ignore"):
        inside = ((pixel > 0) & (pixel < np.array(SIZE_PX) - 1)).all(axis=(1, 2))
    if inside.sum() < count:
        raise ValueError(f"a photo shows {inside.sum()} of the {count} lines that a scene needs")
    return np.asarray(ends[inside][:count])


def _raise(ends: Floats, relief_m: float, rng: np.random.Generator) -> Floats:
    """Return (..., 3) world points, with random heights of the relief."""
    up = relief_m * rng.normal(size=(*ends.shape[:-1], 1))
    return np.concatenate([ends, up], axis=-1)


def _project_points(lens: Calibration, center: Floats, rotation: Floats, world: Floats) -> Floats:
    """Project world points (B, k, 2, 3) to pixels (B, k, 2, 2); NaN behind the camera."""
    away = world - center[:, None, None]
    return project(lens.model, lens.parameters, np.einsum("bji,bkej->bkei", rotation, away))


def _add_noise(pixel: Floats, sigma_px: float, rng: np.random.Generator) -> Floats:
    return pixel + sigma_px * rng.normal(size=pixel.shape)
