"""Single photos of level ground with known truth: predicted, drawn and adjusted many times."""

from __future__ import annotations

from dataclasses import dataclass
from zlib import crc32

import numpy as np

from uavgram.estimation.first_poses.photo_problem import Photos, SharedErrors
from uavgram.estimation.repeated.single_photo import add_errors, adjust_photos, predict_lengths
from uavgram.geometry.camera.projection import project
from uavgram.geometry.motion.rotation import (
    ENU_FROM_NED,
    GIMBAL_FROM_CAMERA,
    exp_so3,
    matrix_from_ypr,
)
from uavgram.model.arrays import Floats, Ints
from uavgram.model.camera import Calibration
from uavgram.model.options import GroundOptions
from uavgram.model.simulation import Cell
from uavgram.pipeline.threads import one_blas_thread

SIZE_PX = (4000, 3000)
FOCAL_PX = 2250.0
AREA_M = (40.0, 30.0)
PAIR_COUNT = 12
"""Number of withheld distances in a scene."""
MIN_WITHHELD_M = 3.0
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
    apart = np.linalg.norm(pairs[:, 1] - pairs[:, 0], axis=1) >= MIN_WITHHELD_M
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


@dataclass(frozen=True, kw_only=True)
class StudyScene:
    """A photo, its taped lengths, and the sizes of all errors.

    Attributes
    ----------
    height_m, tilt_deg
        Of the camera above the ground; of the view from straight down.
    lines
        Number of taped lengths around the scene.
    pick_px
        Of a pick.
    tape_m, tape_scale
        Of a length; of the tape, relative to all lengths.
    focal_share, centre_px
        Standard deviations of the focal length, relative to it, and of the principal point.
    """

    height_m: float = 40.0
    tilt_deg: float = 20.0
    lines: int = 6
    pick_px: float = 0.8
    tape_m: float = 0.01
    tape_scale: float = 0.0
    focal_share: float = 0.0
    centre_px: float = 0.0


DISTANCE_COUNT, MIN_MEASURED_M = 16, 5.0
"""Number of measured distances, and the shortest of them [m]."""

EDGE_SHARE = 0.75
"""Distance of the taped lengths from the middle, relative to half the area."""

LINE_M = 10.0
"""Length of each taped length [m]."""

LOG_SIGMAS = np.array(LOG_SIGMA)
"""Sigmas of the log's pose: centre [m], rotation about the camera's axes [rad]."""

GROUND_ROOT = np.diag(
    [GroundOptions.height_sigma_m, *[np.deg2rad(GroundOptions.slope_sigma_deg)] * 2]
)
"""Root of the ground plane's prior covariance: the default of projects."""

CAMERA = make_study_camera(0.0)
LENS = CAMERA.parameters


@dataclass(frozen=True)
class StudyPhoto:
    """A scene's photo without errors, its true positions (E, 2), and measured pairs (M, 2)."""

    scene: StudyScene
    shared: SharedErrors
    exact: Photos
    place_m: Floats
    pairs: Ints


def make_photo(scene: StudyScene) -> StudyPhoto:
    """Compute the geometry of a scene.

    Parameters
    ----------
    scene
        The photo.

    Raises
    ------
    ValueError
        A part of it is outside the photo.
    """
    ends, line = _list_taped(scene)
    wanted = _list_distances()
    place = np.concatenate([ends, wanted.reshape(-1, 2)])
    pairs = len(ends) + np.arange(2 * DISTANCE_COUNT).reshape(-1, 2)
    tilt = np.deg2rad(scene.tilt_deg)
    center = np.array([0.0, -scene.height_m * np.tan(tilt), scene.height_m])
    # image up is north; tilting lifts the view from straight down to the north
    rotation = exp_so3(np.array([tilt, 0.0, 0.0])) @ np.diag([1.0, -1.0, -1.0])
    pixel = _project_exactly(place, center, rotation)
    if not (np.all(pixel > 0) and np.all(pixel < np.array(SIZE_PX))):
        raise ValueError(f"not everything is in the photo: {scene}")
    exact = Photos(
        pixel_px=pixel[None],
        pixel_weight=np.full((1, len(place)), 1.0 / scene.pick_px),
        height_m=np.zeros((1, len(place))),
        ground=np.zeros((1, 3)),
        center=center[None],
        rotation=rotation[None],
        information=np.diag(LOG_SIGMAS**-2.0)[None],
        line=line[None],
        toward=np.zeros((1, 0, 2)),
        placed=np.zeros((1, 0), np.int64),
        reading_m=_lengths(place, line)[None],
        reading_weight=np.full((1, len(line)), 1.0 / scene.tape_m),
    )
    shared = SharedErrors(CAMERA, _camera_root(scene), GROUND_ROOT, scene.tape_scale)
    return StudyPhoto(scene, shared, exact, place, pairs)


def draw_observations(photo: StudyPhoto, count: int, rng: np.random.Generator) -> Photos:
    """Draw observations with all errors of the scene.

    Parameters
    ----------
    photo, count
        Photo to draw, and number of draws.
    rng
        Of the draws.
    """
    shared = photo.shared
    camera = rng.standard_normal((shared.camera_root.shape[1], count)).T
    pick = rng.standard_normal((count, 2 * len(photo.place_m)))
    reading = rng.standard_normal((count, photo.exact.line.shape[1]))
    tape = rng.standard_normal((count, 1))[:, : bool(shared.tape_scale_sigma)]
    off = rng.standard_normal((count, 6))
    ground = rng.standard_normal((count, shared.ground_root.shape[1]))
    # true = prior @ exp(error), so the prior's rotation has the opposite one
    errors = [reading, pick, off[:, :3], -off[:, 3:], -camera, ground, -tape]
    return add_errors(shared, photo.exact, np.concatenate(errors, axis=1))


def _project_exactly(place_m: Floats, center: Floats, rotation: Floats) -> Floats:
    """Project points on level ground to (E, 2) pixels with the stated lens."""
    world = np.column_stack([place_m, np.zeros(len(place_m))])
    return project("brown", LENS, (world - center) @ rotation)


def _camera_root(scene: StudyScene) -> Floats:
    """Return the root of the camera's covariance: focal length, and principal point."""
    root = np.zeros((9, 3))
    root[:2, 0] = scene.focal_share * FOCAL_PX
    root[2, 1] = root[3, 2] = scene.centre_px
    return root[:, np.any(root != 0, axis=0)]


def _list_taped(scene: StudyScene) -> tuple[Floats, Ints]:
    """Return ends (E, 2) of the taped lengths, and their pairs (L, 2)."""
    turn = 2 * np.pi * (np.arange(scene.lines) + 0.5) / scene.lines
    out = np.array([np.cos(turn), np.sin(turn)]).T * np.array(AREA_M) / 2 * EDGE_SHARE
    along = np.array([-np.sin(turn), np.cos(turn)]).T
    reach = LINE_M / 2 * along
    ends = np.stack([out - reach, out + reach], axis=1).reshape(-1, 2)
    return ends, np.arange(2 * scene.lines).reshape(-1, 2)


def _list_distances() -> Floats:
    """Return the (M, 2, 2) ends of the measured distances: the same in all scenes."""
    drawn = np.random.default_rng(1901).uniform(-0.5, 0.5, (200, 2, 2)) * np.array(AREA_M)
    length = np.linalg.norm(drawn[:, 1] - drawn[:, 0], axis=1)
    return np.asarray(drawn[length >= MIN_MEASURED_M][:DISTANCE_COUNT])


def _lengths(place_m: Floats, pairs: Ints) -> Floats:
    return np.asarray(
        np.linalg.norm(place_m[..., pairs[:, 1], :] - place_m[..., pairs[:, 0], :], axis=-1)
    )


@dataclass(frozen=True, kw_only=True)
class StudyCell:
    """Position of a cell in its study: curve, value on the axis with its text, and the scene."""

    curve: str
    at: float
    label: str
    scene: StudyScene


def simulate_cell(place: StudyCell, repetitions: int) -> Cell:
    """Predict and simulate a cell.

    Parameters
    ----------
    place
        The cell.
    repetitions
        Number of draws.
    """
    scene = place.scene
    with one_blas_thread():
        photo = make_photo(scene)
        expected = predict_lengths(photo.shared, photo.exact, photo.pairs)
        rng = np.random.default_rng([19, crc32(repr(scene).encode())])
        draws = draw_observations(photo, repetitions, rng)
        truth = photo.exact.center[0], photo.exact.rotation[0]
        found = adjust_photos(photo.shared, draws, truth)
    # errors of the distances in the repetitions that converged
    ends = found.place_m[:, photo.pairs]
    error = np.linalg.norm(ends[:, :, 1] - ends[:, :, 0], axis=2)
    error -= _lengths(photo.place_m, photo.pairs)
    good = found.converged & np.isfinite(error).all(axis=1)
    error = error[good]
    # root mean square of errors over predicted errors, and its 95 % range
    low, middle, high = compute_ratio(error / expected.error_m)
    total = expected.variance.sum()
    return Cell(
        curve=place.curve,
        at=place.at,
        label=place.label,
        predicted_m=float(np.sqrt(np.mean(expected.error_m**2))),
        simulated_m=float(np.sqrt(np.mean(error**2))),
        ratio=middle,
        ratio_range=(low, high),
        bias_m=float(np.sqrt(np.mean(error.mean(axis=0) ** 2))),
        shares=tuple(float(part.sum() / total) for part in expected.parts),
        repetitions=repetitions,
        lost=int((~good).sum()),
    )


def compute_ratio(z: Floats) -> tuple[float, float, float]:
    """Compute the root mean square of (B, M), whose rows are independent, and its 95 % range."""
    each = np.mean(z**2, axis=1)
    middle, half = float(each.mean()), 1.96 * float(each.std(ddof=1)) / np.sqrt(len(each))
    return (
        float(np.sqrt(max(middle - half, 0.0))),
        float(np.sqrt(middle)),
        float(np.sqrt(middle + half)),
    )
