"""Corners of calibration boards with known truth, projected by OpenCV; and real ones."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import ArrayLike

from uavgram.estimation.calibration.problem import State, compute_board_middle
from uavgram.model.arrays import Floats
from uavgram.model.board import BoardObservations, BoardPhoto, flat_board
from uavgram.model.camera import LensModel

BROWN5 = np.array([820.0, 815, 512, 380, -0.21, 0.09, 8e-4, -5e-4, -0.02])
BROWN3 = np.array([820.0, 815, 512, 380, -0.21, 0.09, 0, 0, -0.02])
BROWN8 = np.array([820.0, 815, 512, 380, 0.3, 0.15, 8e-4, -5e-4, 0.01, 0.55, 0.1, 0.02])
FISHEYE = np.array([420.0, 418, 512, 380, 0.05, -0.02, 0.008, -0.002])
SIZE = (1024, 768)


@dataclass(frozen=True)
class Scene:
    """Observations, and what they were made from."""

    observations: BoardObservations
    parameters: Floats
    rotation: Floats  # (M, 3, 3) camera_from_board
    translation: Floats  # (M, 3) of the board's origin


def opencv_pixels(
    parameters: Floats,
    point: Floats,
    rotation: Floats,
    translation: Floats,
    model: LensModel = "brown",
) -> Floats:
    """(n, 2) pixels of (n, 3) points by OpenCV itself."""
    fx, fy, cx, cy = parameters[:4]
    matrix = np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1]])
    function = cv2.projectPoints if model == "brown" else cv2.fisheye.projectPoints
    turn = cv2.Rodrigues(rotation)[0]
    pixel = function(
        np.ascontiguousarray(point[:, None]), turn, translation, matrix, parameters[4:]
    )
    return np.asarray(pixel[0].reshape(-1, 2), np.float64)


def true_state(scene: Scene, parameters: ArrayLike, bow: ArrayLike = ()) -> State:
    """The scene's truth as the estimator's state."""
    middle = compute_board_middle(scene.observations.board)
    return State(
        np.asarray(parameters),
        np.asarray(bow, float),
        scene.rotation,
        scene.translation + scene.rotation @ middle,
    )


def make_scene(
    seed: int = 0,
    parameters: Floats = BROWN5,
    model: LensModel = "brown",
    *,
    photos: int = 12,
    noise: float = 0.1,
    sigma: float | None = None,
    shape: tuple[int, int] = (9, 6),
    bow: ArrayLike | None = None,
    tilt_deg: float = 35.0,
    distance: tuple[float, float] = (8.0, 14.0),
    whole: bool = True,
) -> Scene:
    """A board of unit squares in random poses; `noise` in pixels, said to be `sigma`.

    bow: (2,) heights along x and along y, as the estimator understands them.
    """
    rng = np.random.default_rng(seed)
    board = flat_board(shape[0], shape[1], 1.0)
    true = board.corner_board_m.copy()
    middle = true.mean(axis=0)
    if bow is not None:
        half = (np.array(shape) - 1) / 2
        true[:, 2] += (1 - ((true[:, :2] - middle[:2]) / half) ** 2) @ np.asarray(bow)
    made: list[BoardPhoto] = []
    rotations: list[Floats] = []
    translations: list[Floats] = []
    while len(made) < photos:
        tilt, direction = np.radians(tilt_deg) * rng.uniform(0.3, 1), rng.uniform(0, 2 * np.pi)
        axis = np.array([np.cos(direction), np.sin(direction), 0]) * tilt
        spin = np.array([0, 0, rng.uniform(-np.pi, np.pi)])
        rotation = cv2.Rodrigues(axis)[0] @ cv2.Rodrigues(spin)[0]
        depth = rng.uniform(*distance)
        reach = np.array(SIZE) / 2 / parameters[:2] * depth * 0.75
        place = np.array([*(rng.uniform(-1, 1, 2) * reach), depth])
        translation = place - rotation @ middle
        if ((true @ rotation.T + translation)[:, 2] < 0.5).any():
            continue
        pixel = opencv_pixels(parameters, true, rotation, translation, model)
        inside = ((pixel > 0) & (pixel < np.array(SIZE) - 1)).all(axis=1)
        if inside.sum() < (len(true) if whole else 20):
            continue
        corner = np.flatnonzero(inside)
        found = pixel[inside] + rng.normal(size=(inside.sum(), 2)) * noise
        made.append(
            BoardPhoto(
                file=f"photo{len(made):02d}.jpg",
                width_px=SIZE[0],
                height_px=SIZE[1],
                corner=corner,
                pixel_px=found,
                sigma_px=np.full(len(corner), sigma or noise or 1.0),
            )
        )
        rotations.append(rotation)
        translations.append(translation)
    observations = BoardObservations(board=board, photos=tuple(made))
    return Scene(observations, np.asarray(parameters), np.array(rotations), np.array(translations))


def with_noise(scene: Scene, seed: int, noise: float) -> BoardObservations:
    """The same photos with new noise: `scene` itself must be without."""
    rng = np.random.default_rng(seed)
    photos = tuple(
        replace_pixels(photo, photo.pixel_px + rng.normal(size=photo.pixel_px.shape) * noise, noise)
        for photo in scene.observations.photos
    )
    return BoardObservations(board=scene.observations.board, photos=photos)


def replace_pixels(photo: BoardPhoto, pixel: Floats, sigma: float | None = None) -> BoardPhoto:
    """The photo with other pixels, and perhaps another sigma."""
    return BoardPhoto(
        file=photo.file,
        width_px=photo.width_px,
        height_px=photo.height_px,
        corner=photo.corner,
        pixel_px=pixel,
        sigma_px=photo.sigma_px if sigma is None else np.full(len(pixel), sigma),
        setting=photo.setting,
    )


def opencv_chess(data_dir: Path, side: str) -> BoardObservations:
    """OpenCV's own sample photos, corners by OpenCV."""
    photos = []
    for path in sorted((data_dir / "opencv_chess").glob(f"{side}[0-9]*.jpg")):
        image = cv2.imread(str(path), cv2.IMREAD_GRAYSCALE)
        assert image is not None
        found, corner = cv2.findChessboardCorners(image, (9, 6))
        assert found, path
        stop = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_COUNT, 30, 0.001)
        pixel = cv2.cornerSubPix(image, corner, (5, 5), (-1, -1), stop).reshape(-1, 2)
        height, width = image.shape
        photos.append(
            BoardPhoto(
                file=path.name,
                width_px=width,
                height_px=height,
                corner=np.arange(54),
                pixel_px=np.asarray(pixel, np.float64),
                sigma_px=np.full(54, 0.1),
            )
        )
    return BoardObservations(board=flat_board(9, 6, 1.0), photos=tuple(photos))


def phantom3(data_dir: Path) -> tuple[BoardObservations, dict[str, Any]]:
    """Published corners of a Phantom 3's board, and the published camera (of 30 photos)."""
    control = json.loads((data_dir / "phantom3_lenscalib" / "control.json").read_text())
    photos = []
    for photo in control["photos"]:
        place = [[int(n) for n in o["id"].split("_")] for o in photo["observations"]]
        photos.append(
            BoardPhoto(
                file=photo["file"],
                width_px=photo["size"][0],
                height_px=photo["size"][1],
                corner=np.array([row * 9 + column for row, column in place]),
                pixel_px=np.array([o["uv"] for o in photo["observations"]]),
                sigma_px=np.full(len(place), 0.2),
            )
        )
    return BoardObservations(board=flat_board(9, 11, 0.06), photos=tuple(photos)), control["camera"]


def opencv_calibration(
    observations: BoardObservations, flags: int = 0, times: int = 5
) -> tuple[Floats, Floats, Floats, Floats]:
    """Parameters (P,), their standard deviations, rms and the poses' ones, by OpenCV.

    Its threads add up in any order, and its iterations stop where the sum no longer falls: some
    1e-5 of a sigma from one another, now and then more. So it is the median of several times.
    """
    board = observations.board.corner_board_m.astype(np.float32)
    points = [board[photo.corner] for photo in observations.photos]
    pixels = [photo.pixel_px.astype(np.float32)[:, None] for photo in observations.photos]
    first = observations.photos[0]
    count = 12 if flags & cv2.CALIB_RATIONAL_MODEL else 9
    runs = []
    for _ in range(times):
        rms, matrix, distortion, _, _, sigma, pose_sigma, _ = cv2.calibrateCameraExtended(  # type: ignore[call-overload] # no None in its stubs
            points,
            pixels,
            (first.width_px, first.height_px),
            None,
            None,
            flags=flags,
            criteria=(3, 300, 1e-16),
        )
        camera = [matrix[0, 0], matrix[1, 1], matrix[0, 2], matrix[1, 2]]
        parameters = np.concatenate([camera, distortion.ravel()[: count - 4]])
        runs.append((parameters, sigma.ravel()[:count], rms, pose_sigma.reshape(-1, 6)))
    return tuple(np.median(np.stack(values), axis=0) for values in zip(*runs, strict=True))


def as_float32(observations: BoardObservations) -> BoardObservations:
    """The same corners, rounded as OpenCV rounds them."""
    photos = tuple(
        replace_pixels(photo, photo.pixel_px.astype(np.float32).astype(float))
        for photo in observations.photos
    )
    return BoardObservations(board=observations.board, photos=photos)
