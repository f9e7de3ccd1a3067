"""Targets without a number: chequers, crosses and round targets on grainy ground."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest
from scipy.special import erf

from uavgram.imaging.raster import Image
from uavgram.imaging.targets.uncoded import (
    MODEL_SIGMA_PX,
    Kind,
    UncodedTarget,
    find_centre_of_symmetry,
    measure_uncoded_target,
)
from uavgram.model.arrays import Floats

SIDE_PX, FINE = 61, 6


def test_centres_are_found_to_hundredths_of_a_pixel_with_sigmas_to_match() -> None:
    rng = np.random.default_rng(4)
    every: list[Floats] = []
    for name, kind in KINDS.items():
        off, sigma = [], []
        for _ in range(14):
            center = 30.0 + rng.uniform(-0.5, 0.5, 2)
            view = _view(rng, 10.0)
            photo = _photo(rng, _painted(name, center, view))
            found = measure_uncoded_target(photo, center + rng.normal(0.0, 0.8, 2))
            if found is not None:
                assert found.kind is kind, name
                off.append(found.pixel_px - center)
                sigma.append(np.sqrt(found.sigma_px**2 - MODEL_SIGMA_PX**2))  # by noise alone
        away, z = np.array(off), np.array(off) / np.array(sigma)[:, None]
        assert len(off) >= 13, name
        assert np.sqrt((away**2).mean()) <= 0.06, name
        every.append(z)
    # of 140 values: three sigmas about 0.85 to 1
    assert 0.6 < np.sqrt((np.concatenate(every) ** 2).mean()) < 1.25


def test_nothing_is_invented() -> None:
    rng = np.random.default_rng(5)
    for name in ("ground", "edge", "corner", "bar", "tee"):
        for _ in range(3):
            center = 30.0 + rng.uniform(-0.5, 0.5, 2)
            photo = _photo(rng, _painted(name, center, _view(rng, 10.0)))
            assert measure_uncoded_target(photo, center) is None, name


@pytest.mark.parametrize("name", ["chequer", "disc", "cross"])
def test_a_target_that_is_half_covered_is_refused(name: str) -> None:
    rng = np.random.default_rng(6)
    for _ in range(2):
        view = _view(rng, 10.0)
        grey = _painted(name, np.array([30.0, 30.0]), view)
        grey[:, : 30 * FINE] = 110.0
        assert measure_uncoded_target(_photo(rng, grey), np.array([30.0, 30.0])) is None


def test_the_middle_of_a_tilted_circle_is_off_by_what_is_said() -> None:
    focal, radius, away, tilt = 1000.0, 1.0, 30.0, 0.8
    angle = np.linspace(0.0, 2 * np.pi, 3600, endpoint=False)
    along, across = radius * np.cos(angle), radius * np.sin(angle)
    depth = away + along * np.sin(tilt)
    outline = focal * np.column_stack([along * np.cos(tilt) / depth, across / depth])
    (u, _), axes, _ = cv2.fitEllipse(outline.astype(np.float32))
    a, b = sorted((0.5 * axes[0], 0.5 * axes[1]), reverse=True)
    found = UncodedTarget(Kind.DISC, np.zeros(2), 0.1, 1.0, (a, b))
    assert found.off_center_px(focal) == pytest.approx(abs(u), rel=0.02)


KINDS = {
    "chequer": Kind.CHEQUER,
    "cross": Kind.CROSS,
    "disc": Kind.DISC,
    "ring": Kind.DISC,
    "hole": Kind.DISC,
}


def _view(rng: np.random.Generator, size_px: float) -> Floats:
    """(2, 2) pixels by half sides of a target: turned, and flattened to 0.7 to 1."""
    first, second = (_turn(angle) for angle in rng.uniform(0.0, 2 * np.pi, 2))
    flat = np.diag([1.0, rng.uniform(0.7, 1.0)])
    return np.asarray(size_px * first @ flat @ second)


def _turn(angle: float) -> Floats:
    return np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])


def _painted(name: str, center_px: Floats, view: Floats) -> Floats:
    """A target in front of ground, six samples by pixel each way."""
    at = (np.arange(SIDE_PX * FINE) + 0.5) / FINE - 0.5
    u, v = np.meshgrid(at - center_px[0], at - center_px[1])
    x, y = np.einsum("ij,jvu->ivu", np.linalg.inv(view), np.stack([u, v]))
    away, board = np.hypot(x, y), np.maximum(np.abs(x), np.abs(y)) < 1.0
    grey = np.full(x.shape, 110.0)
    shapes: dict[str, tuple[tuple[Floats, float], ...]] = {
        "ground": (),
        "edge": ((x > 0.0, 220.0),),
        "corner": (((x > 0.0) & (y > 0.0), 220.0),),
        "bar": ((np.abs(x) < 0.3, 220.0),),
        "tee": (((np.abs(x) < 0.2) & (y < 0.2), 220.0), ((np.abs(y) < 0.2), 220.0)),
        "chequer": ((board, 30.0), (board & (x * y > 0), 220.0)),
        "cross": ((board & (np.minimum(np.abs(x), np.abs(y)) < 0.2), 225.0),),
        "disc": ((away < 1.0, 225.0),),
        "ring": ((away < 1.0, 30.0), (away < 0.8, 225.0), (away < 0.3, 30.0)),
        "hole": ((away < 1.3, 220.0), (away < 0.7, 30.0)),
    }
    for where, value in shapes[name]:
        grey = np.where(where, value, grey)
    return np.asarray(grey)


def _photo(rng: np.random.Generator, fine: Floats) -> Image:
    """Blurred by 0.7 px, on grainy ground, with noise and through JPEG."""
    grain = cv2.GaussianBlur(rng.normal(0.0, 40.0, (SIDE_PX, SIDE_PX)), (0, 0), 1.2)
    grey = fine.reshape(SIDE_PX, FINE, SIDE_PX, FINE).mean(axis=(1, 3))
    share = np.abs(grey - 110.0) < 20.0
    grey = cv2.GaussianBlur(grey + grain * share, (0, 0), 0.7) + rng.normal(0.0, 2.0, grey.shape)
    packed = cv2.imencode(
        ".jpg", grey.clip(0, 255).astype(np.uint8), [cv2.IMWRITE_JPEG_QUALITY, 90]
    )
    return np.asarray(cv2.imdecode(packed[1], cv2.IMREAD_GRAYSCALE), dtype=np.uint8)


# Centres of chequers in photos of a real camera: how far they scatter, and what is said of it.


BOARD = (9, 6)
DEGREE = 5
RADIUS_PX = 10.0


@pytest.mark.parametrize("side", ["left", "right"])
def test_corners_of_a_real_board_scatter_as_is_said(data_dir: Path, side: str) -> None:
    """A flat board and a lens map corners smoothly: what is left over is the error of centres."""
    every = [residuals(path) for path in sorted((data_dir / "opencv_chess").glob(f"{side}*.jpg"))]
    off, sigma = (np.concatenate(part) for part in zip(*every, strict=True))
    assert len(off) > 600
    assert np.sqrt((off**2).mean()) < 0.06  # OpenCV's cornerSubPix: 0.10
    z = off / sigma[:, None]
    assert 0.8 < np.sqrt((z**2).mean()) < 1.25


def residuals(path: Path) -> tuple[Floats, Floats]:
    """(n, 2) what a smooth map of the board leaves over, as large as errors are; sigmas (n,)."""
    photo: Image = np.asarray(cv2.imread(str(path), cv2.IMREAD_GRAYSCALE), np.uint8)
    seen, corner = cv2.findChessboardCorners(photo, BOARD)
    if not seen:
        return np.zeros((0, 2)), np.zeros(0)
    start = corner.reshape((*BOARD[::-1], 2)).astype(np.float64)
    steps = (np.linalg.norm(np.diff(start, axis=k), axis=2).min() for k in (0, 1))
    radius = min(0.55 * min(steps), RADIUS_PX)
    board = np.stack(np.meshgrid(*map(np.arange, BOARD)), -1).reshape(-1, 2).astype(np.float64)
    found = [
        find_centre_of_symmetry(photo, place, radius * np.eye(2)) for place in start.reshape(-1, 2)
    ]
    there = [(at, one) for at, one in zip(board, found, strict=True) if one and one.likeness > 0.97]
    if len(there) < 35:
        return np.zeros((0, 2)), np.zeros(0)
    at = np.array([place for place, _ in there])
    center = np.array([one.pixel_px for _, one in there])
    matrix, _ = cv2.findHomography(at, center)
    bent = center - cv2.perspectiveTransform(at[:, None], matrix)[:, 0]
    x, y = ((at - at.mean(axis=0)) / 4.0).T
    powers = [(i, j) for i in range(DEGREE + 1) for j in range(DEGREE + 1 - i)]
    design = np.stack([x**i * y**j for i, j in powers], axis=1)
    hat = design @ np.linalg.pinv(design)
    off = (bent - hat @ bent) / np.sqrt(1.0 - np.diag(hat))[:, None]
    return off, np.array([one.sigma_px for _, one in there])


# The centre of what looks the same after half a turn: exact, and as exact as is said.


SYMMETRY_SIDE_PX = 61
BLUR_PX = (0.7, 1.2, 2.0)  # a pixel's own aperture in it
NOISE = 2.0


def chequer(center_px: Floats, angles: Floats, blur_px: float) -> Floats:
    """Four fields whose edges are blurred by a bell: a formula, with no sampling of its own."""
    v, u = np.mgrid[:SYMMETRY_SIDE_PX, :SYMMETRY_SIDE_PX]
    du, dv = u - center_px[0], v - center_px[1]
    one, other = (
        erf((np.cos(angle) * dv - np.sin(angle) * du) / (np.sqrt(2.0) * blur_px))
        for angle in angles
    )
    return np.asarray(125.0 + 95.0 * one * other)


def errors(noise: float) -> tuple[Floats, Floats]:
    """(n, 2) errors of centres anywhere in a pixel, and their sigmas (n,) by noise alone."""
    rng = np.random.default_rng(3)
    off, sigma = [], []
    for k in range(90):
        center = 30.0 + rng.uniform(-0.5, 0.5, 2)
        first = rng.uniform(0.0, np.pi)
        angles = np.array([first, first + rng.uniform(1.1, 2.0)])
        grey = chequer(center, angles, BLUR_PX[k % 3]) + noise * rng.normal(
            size=(SYMMETRY_SIDE_PX, SYMMETRY_SIDE_PX)
        )
        photo: Image = np.clip(np.rint(grey), 0, 255).astype(np.uint8)
        found = find_centre_of_symmetry(photo, center + rng.uniform(-0.7, 0.7, 2), 9.0 * np.eye(2))
        assert found is not None
        off.append(found.pixel_px - center)
        sigma.append(np.sqrt(np.trace(found.covariance_px2) / 2.0))
    return np.array(off), np.array(sigma)


def test_centres_are_exact_wherever_in_a_pixel_they_lie() -> None:
    off, _ = errors(0.0)
    assert np.sqrt(np.mean(off**2)) < 0.003
    assert np.abs(off).max() < 0.012


def test_noise_makes_centres_as_wrong_as_is_said() -> None:
    off, sigma = errors(NOISE)
    z = off / sigma[:, None]
    assert 0.8 < np.sqrt(np.mean(z**2)) < 1.25  # of 180 values: three sigmas are 0.16
