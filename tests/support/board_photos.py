"""Rendered photos of calibration boards: where every corner lies is known from the geometry alone.

The print is a texture whose texels end on the squares' edges; each pixel is the mean of
`SUBDIVISION` squared rays through it, so a corner lies where it is projected to a few thousandths
of a pixel.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray

from uavgram.geometry.camera.projection import back_project, project
from uavgram.model.arrays import Floats
from uavgram.model.board import Board
from uavgram.model.camera import LensModel

Grey = NDArray[np.uint8]
Light = NDArray[np.float32]
BoardPose = tuple[ArrayLike, ArrayLike]
"""(rvec, tvec): camera_from_board."""

TEXELS_PER_SQUARE = 60
BLACK, WHITE, FLOOR = 30.0, 215.0, 120.0
SUBDIVISION = 6


@dataclass(frozen=True)
class Sensor:
    """What lens and sensor do to the light; grey values of 255."""

    blur_px: float = 0.7
    noise: float = 2.0
    vignetting: float = 0.0  # share of the light that is lost in the corners
    jpeg_quality: int = 0  # 0: as it is


def print_board(board: Board, quiet_squares: float = 1.0) -> tuple[Light, Floats]:
    """Texture of the print with its white rim, and (2, 3) texel_from_board [texels per metre]."""
    n, rim = TEXELS_PER_SQUARE, round(quiet_squares * TEXELS_PER_SQUARE)
    columns, rows = board.columns + 1, board.rows + 1
    if board.kind == "charuco":
        dictionary = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, board.dictionary))
        target = cv2.aruco.CharucoBoard(
            (columns, rows), float(board.square_m), float(board.marker_m), dictionary
        )
        image = target.generateImage((columns * n, rows * n), marginSize=0, borderBits=1)
    else:
        row, column = np.indices((rows * n, columns * n)) // n
        image = np.where((row + column) % 2 == 0, 0, 255).astype(np.uint8)
    light = np.where(image > 127, WHITE, BLACK).astype(np.float32)
    texture = cv2.copyMakeBorder(light, rim, rim, rim, rim, cv2.BORDER_CONSTANT, value=WHITE)
    scale, first = n / board.square_m, rim + n - 0.5  # texel coordinate of the first corner
    return texture.astype(np.float32), np.array([[scale, 0.0, first], [0.0, scale, first]])


def true_corners(board: Board, model: LensModel, parameters: ArrayLike, pose: BoardPose) -> Floats:
    """(B, 2) pixels of the board's corners; NaN where the lens has none. pose: (rvec, tvec)."""
    turn, shift = cv2.Rodrigues(np.asarray(pose[0], float))[0], np.asarray(pose[1], float)
    return project(model, np.asarray(parameters, float), board.corner_board_m @ turn.T + shift)


def photograph(
    board: Board,
    model: LensModel,
    parameters: ArrayLike,
    pose: BoardPose,
    size_px: tuple[int, int],
    sensor: Sensor = Sensor(),
    *,
    seed: int = 0,
    step_px: int = 1,
) -> Grey:
    """(height, width) uint8 photo of a board on a grey floor.

    Parameters
    ----------
    board, model, parameters
        Board and lens.
    pose
        (rvec, tvec): camera_from_board.
    size_px
        Width and height.
    step_px
        Rays are computed at every such pixel and interpolated: 1 is exact, 8 is fast.
    """
    texture, affine = print_board(board)
    maps = _texel_maps(model, np.asarray(parameters, float), pose, size_px, step_px)
    u = (maps[..., 0] * affine[0, 0] + affine[0, 2]).astype(np.float32)
    v = (maps[..., 1] * affine[1, 1] + affine[1, 2]).astype(np.float32)
    light = np.empty((size_px[1], size_px[0]), np.float32)
    for first in range(0, size_px[1], 256):  # bands: the subdivided maps of a photo are large
        rows = slice(first, min(first + 256, size_px[1]))
        light[rows] = _mean_light(texture, u, v, rows, size_px[0])
    return _expose(light, sensor, np.random.default_rng(seed))


def look(
    board: Board,
    *,
    tilt_deg: float,
    azimuth_deg: float,
    roll_deg: float,
    distance_m: float,
    shift_m: tuple[float, float] = (0.0, 0.0),
) -> tuple[Floats, Floats]:
    """Pose (rvec, tvec) that looks at the board's middle, tilted about an axis in its plane."""
    azimuth = np.deg2rad(azimuth_deg)
    tilt = cv2.Rodrigues(np.deg2rad(tilt_deg) * np.array([np.cos(azimuth), np.sin(azimuth), 0.0]))
    roll = cv2.Rodrigues(np.deg2rad(roll_deg) * np.array([0.0, 0.0, 1.0]))
    turn = tilt[0] @ roll[0]
    middle = board.corner_board_m.mean(axis=0)
    shift = np.array([*shift_m, distance_m]) - turn @ middle
    return cv2.Rodrigues(turn)[0][:, 0], shift


def _texel_maps(
    model: LensModel,
    parameters: Floats,
    pose: BoardPose,
    size_px: tuple[int, int],
    step_px: int,
) -> Floats:
    """(H + 2, W + 2, 2) board x and y [m] seen by pixels -1 to W and H; far out where none is."""
    turn, shift = cv2.Rodrigues(np.asarray(pose[0], float))[0], np.asarray(pose[1], float)
    pad = 2 if step_px > 1 else 1
    nodes = [np.arange(-pad, -(-n // step_px) + pad) for n in size_px]
    u, v = np.meshgrid(*((node + 0.5) * step_px - 0.5 for node in nodes))
    ray = back_project(model, parameters, np.stack([u, v], axis=-1)) @ turn
    center = -turn.T @ shift
    with np.errstate(divide="ignore", invalid="ignore"):
        depth = -center[2] / ray[..., 2]
        board = center[:2] + depth[..., None] * ray[..., :2]
    board[~(depth > 0)] = 1e3
    np.clip(board, -1e3, 1e3, out=board)
    if step_px > 1:
        whole = (u.shape[1] * step_px, u.shape[0] * step_px)
        board = cv2.resize(board, whole, interpolation=cv2.INTER_LINEAR)
    first = pad * step_px - 1
    within: Floats = board[first : first + size_px[1] + 2, first : first + size_px[0] + 2]
    return within


def _mean_light(texture: Light, u: Light, v: Light, rows: slice, width: int) -> Light:
    """(rows, W) mean of the light over each pixel's subdivisions."""
    part = slice(rows.start, rows.stop + 2)
    height = rows.stop - rows.start
    times = min(SUBDIVISION, 32_000 // (width + 2))  # cv2.remap takes no wider pictures
    whole = ((width + 2) * times, (height + 2) * times)
    fine = [cv2.resize(m[part], whole, interpolation=cv2.INTER_LINEAR) for m in (u, v)]
    sampled = cv2.remap(
        texture, fine[0], fine[1], cv2.INTER_NEAREST, borderMode=cv2.BORDER_CONSTANT,
        borderValue=FLOOR,
    )  # fmt: skip
    mean = cv2.resize(sampled, (width + 2, height + 2), interpolation=cv2.INTER_AREA)
    return np.asarray(mean[1:-1, 1:-1], np.float32)


def _expose(light: Light, sensor: Sensor, rng: np.random.Generator) -> Grey:
    height, width = light.shape
    if sensor.blur_px > 0:
        blurred = cv2.GaussianBlur(light, (0, 0), sensor.blur_px, borderType=cv2.BORDER_REPLICATE)
        light = np.asarray(blurred, np.float32)
    if sensor.vignetting:
        v, u = np.ogrid[:height, :width]
        radius2 = ((u / width - 0.5) ** 2 + (v / height - 0.5) ** 2) * 2.0
        light = light * (1.0 - sensor.vignetting * radius2).astype(np.float32)
    light = light + sensor.noise * rng.standard_normal(light.shape, dtype=np.float32)
    photo = np.clip(np.round(light), 0, 255).astype(np.uint8)
    if not sensor.jpeg_quality:
        return photo
    encoded = cv2.imencode(".jpg", photo, [cv2.IMWRITE_JPEG_QUALITY, sensor.jpeg_quality])[1]
    decoded = cv2.imdecode(encoded, cv2.IMREAD_GRAYSCALE)
    assert decoded is not None
    return np.asarray(decoded, np.uint8)
