"""Corners searched by OpenCV where the image ends."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest

from uavgram.imaging.raster import Image
from uavgram.imaging.targets.chessboard import sight_chessboard
from uavgram.imaging.targets.gradient import measure_gradient_corners, search_corners
from uavgram.imaging.targets.grid import grow_grid
from uavgram.imaging.targets.saddle import cut_windows
from uavgram.io.photos.catalogue import read_grey
from uavgram.model.camera.board import flat_board

SQUARE = 20


@pytest.fixture(scope="module")
def squares() -> Image:
    """160 x 120 px of a chessboard without blur: corners at (20 k - 0.5, 20 l - 0.5)."""
    v, u = np.mgrid[:120, :160] // SQUARE
    sharp = np.where((u + v) % 2, 200, 50).astype(np.uint8)
    return np.asarray(cv2.GaussianBlur(sharp, (0, 0), 1.0), np.uint8)


OUTSIDE = [[-0.01, 50.0], [160.0, 50.0], [159.99999999, 50.0], [50.0, 120.0], [np.nan, 50.0]]


@pytest.mark.parametrize("place", OUTSIDE)
def test_a_corner_that_starts_outside_the_image_does_not_lose_the_others(
    squares: Image, place: list[float]
) -> None:
    found = search_corners(squares, np.array([place, [41.0, 58.0]]), 4, 20, 0.01)

    assert np.isnan(found[0]).all()
    np.testing.assert_allclose(found[1], [39.5, 59.5], atol=0.02)


@pytest.mark.parametrize("place", [[0.0, 0.0], [159.0, 119.0], [159.5, 119.5]])
def test_corners_on_the_rim_are_searched(squares: Image, place: list[float]) -> None:
    assert np.isfinite(search_corners(squares, np.array([place]), 4, 20, 0.01)).all()


def test_an_image_smaller_than_the_window_holds_no_corner(squares: Image) -> None:
    part = np.ascontiguousarray(squares[:12])
    assert np.isnan(search_corners(part, np.array([[40.0, 6.0]]), 4, 20, 0.01)).all()
    assert np.isfinite(
        search_corners(squares[:13].copy(), np.array([[40.0, 6.0]]), 4, 20, 0.01)
    ).all()


def test_gradients_know_nothing_beyond_the_edge(squares: Image) -> None:
    start = np.array([[41.0, 58.0], [161.0, 59.5]])
    axes = np.tile(SQUARE * np.eye(2), (2, 1, 1))
    windows = cut_windows(squares, start, axes, 5, 0.35)
    corner, covariance = measure_gradient_corners(squares, windows, start, np.ones(2))

    np.testing.assert_allclose(corner[0], [39.5, 59.5], atol=0.02)
    assert np.isfinite(covariance[0]).all()
    assert np.isnan(corner[1]).all()
    assert np.isnan(covariance[1]).all()


def test_a_seed_that_reaches_beyond_the_edge_is_grown(squares: Image) -> None:
    v, u = np.mgrid[1:4, 5:9]
    seed = np.stack([SQUARE * u - 0.5, SQUARE * v - 0.5], axis=-1)  # the last column is at 159.5
    seed[:, 3:] += 2.0
    grown = grow_grid(squares, seed, 8)

    assert grown is not None
    assert grown.pixel_px.shape[:2] == (5, 7)  # all inner corners
    assert np.isfinite(grown.pixel_px).all()


@pytest.mark.parametrize("cut", [np.s_[287:808, 68:1193]])
def test_a_real_board_cut_by_the_edge_is_seen(data_dir: Path, cut: tuple[slice, slice]) -> None:
    photo = read_grey(data_dir / "gopro_board" / "GOPR0038.jpg")
    sight_chessboard(np.ascontiguousarray(photo[cut]), flat_board(8, 6, 0.025))


def test_a_photo_is_found_the_same_whatever_was_found_before(data_dir: Path) -> None:
    """OpenCV's detector draws random numbers; here 12 corners or 22 depended on them."""
    photo = read_grey(data_dir / "gopro_board" / "GOPR0057.jpg")
    board = flat_board(8, 6, 0.025)
    counts = set()
    for state in (0, 1):
        cv2.setRNGSeed(state)
        counts.add(len(sight_chessboard(photo, board).corner))
    assert len(counts) == 1
