"""Parts of a photo for a report."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from uavgram.imaging.photos.decode import read_pixels
from uavgram.imaging.photos.preview import LONGEST_PX, cut_parts
from uavgram.imaging.photos.reduction import halve
from uavgram.imaging.photos.tone import IDENTITY_TONE, choose_tone
from uavgram.model.arrays import Floats
from uavgram.model.result.pictures import Region, Subject

WIDTH, HEIGHT = 600, 400


def region(left: int, top: int, width: int, height: int, subject: Subject = "point") -> Region:
    return Region(
        subject=subject, row=0, frame=0, left_px=left, top_px=top, width_px=width, height_px=height
    )


@pytest.fixture
def photo(tmp_path: Path) -> Path:
    v, u = np.mgrid[:HEIGHT, :WIDTH]
    pixels = np.stack([u * 255 // WIDTH, v * 255 // HEIGHT, (u + v) // 4], axis=-1)
    cv2.imwrite(str(tmp_path / "a.png"), pixels.astype(np.uint8))
    return tmp_path / "a.png"


def decoded(content: bytes) -> Floats:
    pixels = cv2.imdecode(np.frombuffer(content, np.uint8), cv2.IMREAD_COLOR)
    assert pixels is not None
    return pixels.astype(np.float64)


def test_a_part_shows_the_pixels_of_the_photo_and_says_that_they_are_as_stored(photo: Path) -> None:
    (picture,) = cut_parts([read_pixels(photo)], IDENTITY_TONE, [region(120, 200, 90, 60)])
    wanted = decoded(photo.read_bytes())[200:260, 120:210]

    assert decoded(picture.jpeg).shape == wanted.shape
    assert np.abs(decoded(picture.jpeg) - wanted).max() < 8  # JPEG
    assert (picture.shown_px, picture.stretch) == (90, None)


def test_a_large_part_is_reduced(photo: Path) -> None:
    (picture,) = cut_parts([read_pixels(photo)], IDENTITY_TONE, [region(0, 0, WIDTH, HEIGHT)])
    shown = decoded(picture.jpeg)

    assert picture.shown_px == shown.shape[1] == LONGEST_PX["point"]
    assert shown.shape[0] == LONGEST_PX["point"] * HEIGHT // WIDTH


def test_a_dark_photo_is_brightened_alike_in_all_parts_and_says_so(
    photo: Path,
) -> None:
    dark = (decoded(photo.read_bytes()) // 5).astype(np.uint8)
    parts = [region(0, 0, 60, 60), region(400, 300, 60, 60)]
    pictures = cut_parts([dark], choose_tone(dark), parts)

    assert pictures[0].stretch == pictures[1].stretch is not None
    assert decoded(pictures[1].jpeg).mean() > 2 * dark[300:360, 400:460].mean()


def test_parts_of_the_same_place_are_the_same_picture_and_each_keeps_its_own_row(
    photo: Path,
) -> None:
    parts = [region(0, 0, 400, 400), region(0, 0, 400, 400, "measurement"), region(2, 0, 400, 400)]
    first, larger, higher = cut_parts([read_pixels(photo)], IDENTITY_TONE, parts)
    again = cut_parts([read_pixels(photo)], IDENTITY_TONE, [*parts, replace(parts[0], row=7)])

    assert again[:3] == (first, larger, higher)
    assert again[3] == replace(first, region=replace(parts[0], row=7))
    assert len({first.jpeg, larger.jpeg, higher.jpeg}) == 3


def test_a_half_that_is_there_already_is_the_one_that_is_made(photo: Path) -> None:
    pixels = read_pixels(photo)
    large = region(0, 0, 2 * LONGEST_PX["point"], 200)
    pixels = np.hstack([pixels, pixels])

    assert cut_parts([pixels, halve(pixels)], IDENTITY_TONE, [large]) == cut_parts(
        [pixels], IDENTITY_TONE, [large]
    )


@pytest.mark.parametrize(("left", "at_edge"), [(2, (0, 255)), (3, (128, 255))])
def test_parts_shown_at_half_size_lie_where_they_are_in_the_photo(
    left: int, at_edge: tuple[int, int]
) -> None:
    pixels = np.zeros((740, 740, 3), np.uint8)
    pixels[:, 402:] = 255

    (picture,) = cut_parts([pixels], IDENTITY_TONE, [region(left, 4, 720, 720)])

    assert picture.shown_px == 360
    assert decoded(picture.jpeg)[100, 199:201].mean(axis=1) == pytest.approx(at_edge, abs=25)
