"""Stated sigmas of corners against their true errors, and the operators against laws."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pytest
from board_photos import Sensor

from uavgram.imaging.raster import Image
from uavgram.imaging.targets import corners
from uavgram.imaging.targets.chessboard import detect_chessboard, grow_grid
from uavgram.imaging.targets.corners import (
    SIGMA_FLOOR_PX,
    cut_windows,
    fit_saddles,
    grid_axes,
    measure_corners,
    measure_gradient_corners,
    search_corners,
)
from uavgram.io.photos.catalogue import read_grey
from uavgram.model.arrays import Floats
from uavgram.model.board import Board, flat_board


def drawn_saddle(
    rng: np.random.Generator,
    count: int,
    *,
    blur: float = 1.0,
    noise: float = 4.0,
    bleed: float = 0.0,
    half: int = 11,
    truth: Floats | None = None,
) -> tuple[Floats, Floats, Floats]:
    """Corners by formula, independent of the renderer: (N, K, K) in one tall image."""
    side = 2 * half + 3
    truth = rng.uniform(-0.5, 0.5, (count, 2)) if truth is None else truth
    start = np.stack([np.full(count, half + 1), np.arange(count) * side + half + 1], axis=1)
    state = np.zeros((count, corners.PARAMETERS))
    state[:, :2] = truth
    state[:, 2], state[:, 3], state[:, 4] = 0.2, 1.9, blur
    state[:, 5], state[:, 6], state[:, 9] = 80.0, 120.0, bleed
    v, u = np.mgrid[-half - 1 : half + 2, -half - 1 : half + 2].reshape(2, -1)
    value = corners._saddle(np.stack([u, v], axis=1).astype(float), state)[0]
    image = value.reshape(count * side, side) + noise * rng.standard_normal((count * side, side))
    axes = np.array([[np.cos(0.2), np.sin(0.2)], [np.cos(1.9), np.sin(1.9)]]) * 40.0
    return image, start + truth, np.broadcast_to(axes, (count, 2, 2))


def test_the_saddles_derivatives_are_those_of_its_values() -> None:
    rng = np.random.default_rng(1)
    offset = rng.uniform(-6, 6, (40, 2))
    state = np.array([[0.3, -0.2, 0.2, 1.7, 1.3, 80.0, 120.0, 0.4, -0.3, 15.0]])
    jacobian = corners._saddle(offset, state)[1][0]
    for k in range(corners.PARAMETERS):
        step = np.zeros(corners.PARAMETERS)
        step[k] = 1e-6
        up, down = (corners._saddle(offset, state + s * step)[0][0] for s in (1, -1))
        np.testing.assert_allclose(jacobian[k], (up - down) / 2e-6, atol=1e-5, err_msg=str(k))


@pytest.mark.parametrize("blur", [0.7, 2.0])
def test_both_operators_err_as_much_as_they_say_under_white_noise(blur: float) -> None:
    """Chi-square of 400 corners, two coordinates each: bounds of six sigma about one."""
    rng = np.random.default_rng(2)
    image, truth, axes = drawn_saddle(rng, 400, blur=blur)
    windows = cut_windows(image, np.round(truth), axes, 10, 1.0)
    fit = fit_saddles(windows, np.round(truth), axes)
    corner, covariance = measure_gradient_corners(
        image.astype(np.float32), windows, fit.pixel_px, np.full(400, 4.0)
    )
    # Both states a little too much: noise passes for correlation of the fit's residuals, and adds
    # to the gradients that the operator counts on.
    for name, pixel, cov, most in (
        ("saddle", fit.pixel_px, fit.covariance_px2, 1.15),
        ("gradient", corner, covariance, 1.3),
    ):
        error = pixel - truth
        squared = np.einsum("ni,nij,nj->n", error, np.linalg.inv(cov), error)
        assert 0.6 < squared.mean() / 2.0 < most, name


def test_bleeding_and_blur_do_not_shift_a_corner() -> None:
    rng = np.random.default_rng(3)
    for blur, bleed in ((0.5, 40.0), (3.0, -40.0)):
        image, truth, axes = drawn_saddle(rng, 50, blur=blur, bleed=bleed, noise=0.0)
        windows = cut_windows(image, np.round(truth), axes, 10, 1.0)
        fit = fit_saddles(windows, np.round(truth), axes)
        np.testing.assert_allclose(fit.pixel_px, truth, atol=1e-3)
        np.testing.assert_allclose(fit.blur_px, blur, atol=1e-2)


@pytest.mark.parametrize("kind", ["chessboard", "charuco"])
@pytest.mark.parametrize(("blur", "noise"), [(0.6, 2.0), (0.6, 8.0), (1.2, 4.0), (2.0, 8.0)])
def test_corners_of_rendered_boards_err_as_much_as_they_say(
    request: pytest.FixtureRequest,
    shoot: Callable[..., tuple[Image, Floats]],
    kind: str,
    blur: float,
    noise: float,
) -> None:
    """Where the floor rules (little noise), less than stated; never much more."""
    board = request.getfixturevalue(kind)
    ratios = []
    for k in range(2):
        photo, truth = shoot(board, "brown", k, Sensor(blur, noise, 0.3))
        axes = grid_axes(truth.reshape(board.rows, board.columns, 2))
        assert axes.shape == (board.rows, board.columns, 2, 2)
        reach = 0.35 if kind == "chessboard" else 0.17
        start = np.round(truth).reshape(board.rows, board.columns, 2)
        seen = measure_corners(photo, start, reach, (board.columns, board.rows))
        assert len(seen.corner) == board.columns * board.rows
        ratios.append((seen.pixel_px - truth) / seen.sigma_px[:, None])
    ratio = np.sqrt(np.mean(np.concatenate(ratios) ** 2))
    low = 0.8 if noise > 5 else 0.45
    assert low < ratio < 1.2
    assert seen.sigma_px.min() >= SIGMA_FLOOR_PX


def test_sharpened_and_overexposed_photos_show_a_misfit(
    chessboard: Board, shoot: Callable[..., tuple[Image, Floats]]
) -> None:
    import cv2

    plain, _ = shoot(chessboard, "brown", 0, Sensor(1.5, 2.0))
    soft = cv2.GaussianBlur(plain, (0, 0), 3.0)
    sharp = np.asarray(cv2.addWeighted(plain, 4.0, soft, -3.0, 60.0), np.uint8)
    _, truth = shoot(chessboard, "brown", 0)
    grid = np.round(truth).reshape(6, 9, 2)
    misfit = [measure_corners(photo, grid, 0.35, (9, 6)).misfit for photo in (plain, sharp)]
    assert misfit[0] < 0.01
    assert misfit[1] > 2.0 * misfit[0]


# Corners searched by OpenCV where the image ends.


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
    detect_chessboard(np.ascontiguousarray(photo[cut]), flat_board(8, 6, 0.025))


def test_a_photo_is_found_the_same_whatever_was_found_before(data_dir: Path) -> None:
    """OpenCV's detector draws random numbers; here 12 corners or 22 depended on them."""
    photo = read_grey(data_dir / "gopro_board" / "GOPR0057.jpg")
    board = flat_board(8, 6, 0.025)
    counts = set()
    for state in (0, 1):
        cv2.setRNGSeed(state)
        counts.add(len(detect_chessboard(photo, board).corner))
    assert len(counts) == 1
