"""Boards and cameras in space: the cameras around the board, and the boards before the camera.

The board's frame is OpenCV's: x along a row, y down the columns, z into the board. Points above
the board have a negative z, so the eye's up is -z.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import rerun as rr

from uavgram.geometry.camera.projection import back_project
from uavgram.model.arrays import Floats
from uavgram.model.board import CalibrationResult
from uavgram.views.recording.stream import Recorder
from uavgram.views.style import BAD, OBSERVED, QUIET, REFINED, Rgb

AROUND = "around_the_board"
CAMERA = f"{AROUND}/current_camera"
BEFORE = "before_the_camera"

FRUSTUM_SHARE = 0.14
DEPTH_OF_CURRENT = 2.0
"""Depth of the current camera, relative to that of the others."""

ELLIPSOID_ALPHA = 110
NEAR_BLACK: Rgb = (34, 38, 44)
SOFT_WHITE: Rgb = (228, 230, 233)
STATUS_COLOURS: dict[str, Rgb] = {"used": REFINED, "suspect": BAD, "removed": QUIET}


@dataclass(frozen=True, eq=False)
class SceneExtent:
    """Extent of the scene, from which drawings are scaled.

    Attributes
    ----------
    frustum_m
        Depth at which cameras are cut off.
    around_m, before_m
        (N, 3) points that must be visible: of cameras and board, in the board's frame; of camera
        and boards, in the camera's.
    frusta_m, boards_m
        (M, 10, 3) polylines of the cameras, (M, 5, 3) outlines of the boards, likewise.
    """

    frustum_m: float
    around_m: Floats
    before_m: Floats
    frusta_m: Floats
    boards_m: Floats


def measure_extent(result: CalibrationResult) -> SceneExtent:
    """Place cameras and boards."""
    poses, rim = result.photos.poses, _rim(result)
    center, turn = poses.center_world_m, poses.world_from_camera
    away = np.linalg.norm(center - result.board.corner_board_m.mean(axis=0), axis=1)
    depth = FRUSTUM_SHARE * float(np.median(away))
    outline = depth * _frustum(result)
    # world to camera: R^T (x - c); camera to world: c + R x
    boards = np.einsum("mji,mkj->mki", turn, rim[None] - center[:, None])
    frusta = center[:, None] + np.einsum("mij,kj->mki", turn, outline)
    # the current camera is drawn larger
    large = frusta + (DEPTH_OF_CURRENT - 1) * (frusta - center[:, None])
    return SceneExtent(
        frustum_m=depth,
        around_m=np.concatenate([rim, large.reshape(-1, 3)]),
        before_m=np.concatenate([outline, boards.reshape(-1, 3)]),
        frusta_m=frusta,
        boards_m=boards,
    )


def log_space(recorder: Recorder, result: CalibrationResult, room: SceneExtent) -> None:
    """Log the board, the cameras, and the boards in the camera's frame.

    Parameters
    ----------
    recorder
        The open recording.
    result
        The calibration.
    room
        Places of cameras and boards.
    """
    _board(recorder, result)
    poses = result.photos.poses
    colours = [STATUS_COLOURS[status] for status in result.photos.status]
    recorder.lines(f"{AROUND}/cameras", room.frusta_m, colours, 1.8)
    variance = np.diagonal(poses.covariance, axis1=1, axis2=2)[:, :3]
    recorder.static(
        f"{AROUND}/camera_3_sigma",
        rr.Ellipsoids3D(
            centers=poses.center_world_m,
            half_sizes=3 * np.sqrt(np.maximum(variance, 0.0)),
            colors=[(*colour, ELLIPSOID_ALPHA) for colour in colours],
            fill_mode="solid",
        ),
    )
    recorder.lines(f"{BEFORE}/boards", room.boards_m, colours, 2.2)
    recorder.lines(f"{BEFORE}/camera", [room.frustum_m * _frustum(result)], OBSERVED, 3.0)
    boards = [[board] for board in room.boards_m]
    recorder.lines_of_frames(f"{BEFORE}/this_board", boards, OBSERVED, 5.0)


def _board(recorder: Recorder, result: CalibrationResult) -> None:
    """Log squares and rim of the board, in the board's frame."""
    board = result.board
    columns, rows = board.columns + 1, board.rows + 1
    row, column = np.divmod(np.arange(columns * rows), columns)
    black = (row + column) % 2 == 0
    low = np.stack([column - 1.0, row - 1.0], axis=1) * board.square_m
    offset = np.array([[0, 0], [1, 0], [1, 1], [0, 1]]) * board.square_m
    place = low[:, None] + offset
    corners = np.concatenate([place, np.zeros((*place.shape[:2], 1))], axis=-1)
    colours = np.where(black[:, None], NEAR_BLACK, SOFT_WHITE).astype(np.uint8)
    recorder.squares(f"{AROUND}/board", corners, colours)
    recorder.lines(f"{AROUND}/board_rim", [_rim(result)], QUIET, 2.0)


def _rim(result: CalibrationResult) -> Floats:
    """Return the (5, 3) closed outline of the print, in the board's frame."""
    board = result.board
    x = np.array([-1.0, board.columns, board.columns, -1.0, -1.0]) * board.square_m
    y = np.array([-1.0, -1.0, board.rows, board.rows, -1.0]) * board.square_m
    return np.stack([x, y, np.zeros(5)], axis=1)


def _frustum(result: CalibrationResult) -> Floats:
    """Return the (10, 3) polyline of the image frame and four edges at depth 1, with distortion."""
    camera = result.calibration
    corner = np.array([[0, 0], [1, 0], [1, 1], [0, 1]]) * [camera.width_px, camera.height_px] - 0.5
    ray = back_project(camera.model, camera.parameters, corner)
    fx, fy, cx, cy = camera.parameters[:4]
    plain = np.column_stack([(corner - [cx, cy]) / [fx, fy], np.ones(4)])
    # where the distortion has no inverse, take the ray without distortion
    ray = np.where(np.isfinite(ray), ray, plain)
    depth = np.maximum(ray[:, 2:], 0.2 * np.linalg.norm(ray, axis=1, keepdims=True))
    a, b, c, d = ray / depth
    o = np.zeros(3)
    return np.stack([a, b, c, d, a, o, b, c, o, d])
