"""Targets without a number: chequers, crosses and round targets on grainy ground."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from uavgram.imaging.raster import Image
from uavgram.imaging.targets.symmetry import MODEL_SIGMA_PX
from uavgram.imaging.targets.uncoded import Kind, UncodedTarget, measure_uncoded_target
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
