"""ChArUco boards in rendered photos."""

from __future__ import annotations

from collections.abc import Callable

import cv2
import numpy as np
import pytest
from board_photos import Sensor

from uavgram.imaging.raster import Image
from uavgram.imaging.targets.charuco import charuco_board, dictionary_size, sight_charuco
from uavgram.model.arrays import Floats
from uavgram.model.camera.board import Board, flat_board
from uavgram.model.camera.calibration import LensModel


@pytest.mark.parametrize("model", ["brown", "fisheye"])
@pytest.mark.parametrize(
    "sensor", [Sensor(0.6, 2.0, 0.3), Sensor(0.8, 6.0, 0.3), Sensor(1.5, 2.0, 0.3, jpeg_quality=85)]
)
def test_corners_are_where_they_are_projected(
    charuco: Board, shoot: Callable[..., tuple[Image, Floats]], model: LensModel, sensor: Sensor
) -> None:
    photo, truth = shoot(charuco, model, 0, sensor)
    seen = sight_charuco(photo, charuco)
    assert len(seen.corner) >= 30
    error = seen.pixel_px - truth[seen.corner]
    assert np.sqrt(np.mean(error**2)) < 0.03
    assert np.abs(error).max() < 0.15


def test_any_part_of_the_board_keeps_its_numbers(
    charuco: Board, shoot: Callable[..., tuple[Image, Floats]]
) -> None:
    photo, truth = shoot(
        charuco, "brown", 0, tilt_deg=15, roll_deg=0, distance_m=0.2, shift_m=(0.1, 0.05)
    )
    seen = sight_charuco(photo, charuco)
    assert 8 <= len(seen.corner) < 35
    assert np.abs(seen.pixel_px - truth[seen.corner]).max() < 0.1


def test_our_board_is_opencvs(charuco: Board) -> None:
    theirs = charuco_board(charuco, (8, 6)).getChessboardCorners()
    np.testing.assert_allclose(
        theirs - 0.03 * np.array([1, 1, 0]), charuco.corner_board_m, atol=1e-6
    )


@pytest.mark.parametrize("squares", [(6, 6), (10, 5), (8, 5)])
def test_another_layout_is_told_by_its_size(
    charuco: Board, shoot: Callable[..., tuple[Image, Floats]], squares: tuple[int, int]
) -> None:
    photo, _ = shoot(charuco, "brown", 0)
    asked = flat_board(
        squares[0] - 1, squares[1] - 1, 0.03, kind="charuco", marker_m=0.022,
        dictionary="DICT_5X5_100",
    )  # fmt: skip
    seen = sight_charuco(photo, asked)
    assert seen.is_other_board
    assert seen.found_size == (7, 5)


def test_another_dictionary_is_no_board(
    charuco: Board, shoot: Callable[..., tuple[Image, Floats]]
) -> None:
    photo, _ = shoot(charuco, "brown", 0)
    other = flat_board(7, 5, 0.03, kind="charuco", marker_m=0.022, dictionary="DICT_4X4_100")
    assert len(sight_charuco(photo, other).corner) == 0


def test_dictionaries_have_opencvs_sizes() -> None:
    assert dictionary_size("DICT_5X5_100") == 100
    assert dictionary_size("DICT_APRILTAG_36h11") == 587
    assert dictionary_size("DICT_9X9_1") == 0
    assert dictionary_size("CharucoBoard") == 0
    assert cv2.aruco.DICT_5X5_100 is not None
