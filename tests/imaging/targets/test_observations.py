"""What is made of sightings: observations, messages, and one clear error each for what is wrong."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest

from uavgram.errors import InputError
from uavgram.imaging.photos.decode import jpeg_size
from uavgram.imaging.photos.preview import make_preview
from uavgram.imaging.targets.board_picture import draw_board
from uavgram.imaging.targets.observations import collect_observations
from uavgram.imaging.targets.sighting import Sighting
from uavgram.model.camera.board import Board, BoardObservations, LensSetting, flat_board
from uavgram.model.message import Message
from uavgram.stages.messages import order_messages

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
    assert jpeg_size(encoded) == (320, 240)
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
