"""ChArUco boards in rendered photos."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import cv2
import numpy as np
import pytest
from board_photos import Sensor

from uavgram.errors import InputError
from uavgram.imaging.photos.decoding import find_jpeg_frame
from uavgram.imaging.photos.preview import make_preview
from uavgram.imaging.raster import Image
from uavgram.imaging.targets.boards import (
    charuco_board,
    collect_observations,
    detect_charuco,
    dictionary_size,
    draw_board,
)
from uavgram.imaging.targets.corners import Sighting
from uavgram.model.arrays import Floats
from uavgram.model.board import Board, BoardObservations, LensSetting, flat_board
from uavgram.model.camera import LensModel
from uavgram.model.message import Message
from uavgram.stages.messages import order_messages


@pytest.mark.parametrize("model", ["brown", "fisheye"])
@pytest.mark.parametrize(
    "sensor", [Sensor(0.6, 2.0, 0.3), Sensor(0.8, 6.0, 0.3), Sensor(1.5, 2.0, 0.3, jpeg_quality=85)]
)
def test_corners_are_where_they_are_projected(
    charuco: Board, shoot: Callable[..., tuple[Image, Floats]], model: LensModel, sensor: Sensor
) -> None:
    photo, truth = shoot(charuco, model, 0, sensor)
    seen = detect_charuco(photo, charuco)
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
    seen = detect_charuco(photo, charuco)
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
    seen = detect_charuco(photo, asked)
    assert seen.is_other_board
    assert seen.found_size == (7, 5)


def test_another_dictionary_is_no_board(
    charuco: Board, shoot: Callable[..., tuple[Image, Floats]]
) -> None:
    photo, _ = shoot(charuco, "brown", 0)
    other = flat_board(7, 5, 0.03, kind="charuco", marker_m=0.022, dictionary="DICT_4X4_100")
    assert len(detect_charuco(photo, other).corner) == 0


def test_dictionaries_have_opencvs_sizes() -> None:
    assert dictionary_size("DICT_5X5_100") == 100
    assert dictionary_size("DICT_APRILTAG_36h11") == 587
    assert dictionary_size("DICT_9X9_1") == 0
    assert dictionary_size("CharucoBoard") == 0
    assert cv2.aruco.DICT_5X5_100 is not None


# What is made of sightings: observations, messages, and one clear error each for what is wrong.


SIZE_PX = (640, 480)


def sighting(k: int = 0, *, columns: int = 9, rows: int = 6, misfit: float = 0.005) -> Sighting:
    """The corners of a board as a regular grid, moved by k."""
    v, u = np.divmod(np.arange(columns * rows), columns)
    pixel = np.stack([u * 40.0 + 100 + 7 * k, v * 40.0 + 90 + 5 * k], axis=1)
    n = len(pixel)
    return Sighting(
        corner=v * 9 + u,
        pixel_px=pixel,
        sigma_px=np.full(n, 0.05),
        gradient_px=pixel + 0.25,
        gradient_sigma_px=np.full(n, 0.1),
        misfit=misfit,
        found_size=(max(columns, rows), min(columns, rows)),
    )


def collect(
    sightings: list[Sighting], board: Board | None = None
) -> tuple[BoardObservations, tuple[Message, ...]]:
    files = [f"{k}.jpg" for k in range(len(sightings))]
    settings = [LensSetting(camera=file) for file in files]
    return collect_observations(
        board or flat_board(9, 6, 0.025), files, SIZE_PX, settings, sightings
    )


NONE = Sighting()
OTHER = Sighting(found_size=(8, 5), is_other_board=True)


def test_every_photo_with_a_board_becomes_an_observation() -> None:
    observations, messages = collect([sighting(0), NONE, sighting(1), sighting(2)])
    assert [photo.file for photo in observations.photos] == ["0.jpg", "2.jpg", "3.jpg"]
    assert [photo.setting.camera for photo in observations.photos] == ["0.jpg", "2.jpg", "3.jpg"]
    assert np.array_equal(observations.photos[1].pixel_px, sighting(1).pixel_px)
    assert [(message.level, message.code) for message in messages] == [
        ("warning", "photo-without-board")
    ]
    assert "1.jpg" in messages[0].text


@pytest.mark.parametrize(
    ("sightings", "file", "words"),
    [
        ([NONE, NONE, NONE], "0.jpg", "no board"),
        ([NONE, OTHER, OTHER, sighting()], "1.jpg", "8 x 5 inner corners"),
        ([sighting(k, columns=8, rows=6) for k in range(3)], "0.jpg", "8 x 6 inner corners"),
        ([NONE, sighting(0), sighting(1)], "1.jpg", "only 2 of 3 photos"),
        ([sighting(0), sighting(1), sighting(2), sighting(1)], "3.jpg", "1.jpg"),
    ],
)
def test_what_cannot_be_calibrated_is_one_error_that_names_a_photo(
    sightings: list[Sighting], file: str, words: str
) -> None:
    with pytest.raises(InputError, match=words) as caught:
        collect(sightings)
    assert caught.value.path == file


def test_cut_and_foreign_boards_are_said() -> None:
    seen = [sighting(0), sighting(1), sighting(2), sighting(3, columns=7, rows=6), OTHER]
    observations, messages = collect(seen)
    assert len(observations.photos) == 4
    assert {message.code: message.text.split()[0] for message in messages} == {
        "board-partial": "3.jpg",
        "photo-other-board": "4.jpg",
    }


def test_several_cut_boards_are_one_message_that_names_them_all() -> None:
    cut = [sighting(k, columns=7, rows=6) for k in (3, 4)]
    _, messages = collect([sighting(0), sighting(1), sighting(2), *cut])
    (message,) = order_messages(*messages)
    assert message.text.startswith("2 photos show a part of the board")
    assert message.files == ("3.jpg", "4.jpg")


def test_all_photos_are_measured_by_one_operator_and_contradicting_corners_left_out() -> None:
    bad = sighting(1, misfit=0.2)
    moved = bad.gradient_px.copy()
    moved[5] += 3.0
    observations, messages = collect(
        [sighting(0, misfit=0.2), replace(bad, gradient_px=moved), sighting(2)]
    )
    assert [message.code for message in messages] == ["corners-misfit"]
    assert [len(photo.corner) for photo in observations.photos] == [54, 53, 54]
    assert 5 not in observations.photos[1].corner
    for k, photo in enumerate(observations.photos):
        np.testing.assert_array_equal(photo.pixel_px[0], sighting(k).gradient_px[0])
        assert photo.sigma_px[0] == 0.1


def test_the_picture_of_a_photo_shows_marks_where_the_corners_are() -> None:
    observations, _ = collect([sighting(0), sighting(1), sighting(2)])
    photo, board = observations.photos[0], observations.board
    grey = np.full((480, 640), 100, np.uint8)
    encoded = draw_board(make_preview(grey, 320), board, photo, np.zeros((54, 2)))
    assert find_jpeg_frame(encoded) == ((320, 240), True)
    decoded = cv2.imdecode(np.frombuffer(encoded, np.uint8), cv2.IMREAD_COLOR)
    assert decoded is not None
    picture = decoded.astype(int)
    marked = np.abs(picture - 100).max(axis=2) > 30
    v, u = np.nonzero(marked)
    low, high = photo.pixel_px.min(axis=0) / 2, photo.pixel_px.max(axis=0) / 2
    assert abs(u.min() - low[0]) < 8
    assert abs(v.max() - high[1]) < 8
    red = picture[..., 2] - picture[..., :2].max(axis=2) > 60
    place = np.argwhere(red)[:, ::-1].mean(axis=0)
    np.testing.assert_allclose(place, photo.pixel_px[0] / 2, atol=3)
