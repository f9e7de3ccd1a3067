"""Boards, lenses and rendered photos that the tests of the targets share."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypedDict, Unpack

import board_photos
import pytest
from board_photos import Sensor

from uavgram.imaging.raster import Image
from uavgram.model.arrays import Floats
from uavgram.model.board import Board, flat_board
from uavgram.model.camera import LensModel

SIZE_PX = (960, 720)


class Pose(TypedDict, total=False):
    """Where the board is seen from; what is not named has a usual value."""

    tilt_deg: float
    azimuth_deg: float
    roll_deg: float
    distance_m: float
    shift_m: tuple[float, float]


BROWN = [620.0, 618.0, 481.0, 357.0, -0.25, 0.08, 1e-3, -5e-4, 0.0]
SENSOR = board_photos.Sensor(vignetting=0.3)
FISHEYE = [380.0, 381.0, 478.0, 362.0, 0.02, -0.01, 0.0, 0.0]


@pytest.fixture(scope="session")
def chessboard() -> Board:
    return flat_board(9, 6, 0.025)


@pytest.fixture(scope="session")
def charuco() -> Board:
    return flat_board(7, 5, 0.03, kind="charuco", marker_m=0.022, dictionary="DICT_5X5_100")


@pytest.fixture(scope="session")
def shoot() -> Callable[..., tuple[Image, Floats]]:
    """``shoot(board, model, k, sensor)``: photo k of a board, and its true corners."""

    def render(
        board: Board, model: LensModel, k: int, sensor: Sensor = SENSOR, **pose: Unpack[Pose]
    ) -> tuple[Image, Floats]:
        parameters = BROWN if model == "brown" else FISHEYE
        where: Pose = {
            "tilt_deg": 32,
            "azimuth_deg": 30 + 100 * k,
            "roll_deg": 20 + 60 * k,
            "distance_m": 0.3 if model == "brown" else 0.2,
            "shift_m": (0.02, 0.0),
            **pose,
        }
        seen = board_photos.look(board, **where)
        photo = board_photos.photograph(
            board, model, parameters, seen, SIZE_PX, sensor, seed=k, step_px=2
        )
        return photo, board_photos.true_corners(board, model, parameters, seen)

    return render
