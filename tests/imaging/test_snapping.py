"""Snapping: the exact place, and a sigma that holds what repeated noise really does."""

from __future__ import annotations

from collections.abc import Callable

import cv2
import numpy as np
import pytest
from scipy.special import erf

from uavgram.imaging.photos.preview import Pixels
from uavgram.imaging.snapping import (
    CORNER_HALF_PX,
    SMALLEST_SIGMA_PX,
    Region,
    Snapped,
    UnclearRegion,
    snap_corner,
    snap_within,
)
from uavgram.model.arrays import Floats

PLACE = np.array([60.37, 48.81])
GRID = np.mgrid[:100, :120][::-1].astype(float)


def checker(blur: float = 1.0) -> Floats:
    u, v = GRID - PLACE[:, None, None]
    grey: Floats = 110 + 70 * erf(u / blur / 2**0.5) * erf(v / blur / 2**0.5)
    return grey


def disc(radius: float = 9.0, blur: float = 1.0) -> Floats:
    away = np.hypot(*(GRID - PLACE[:, None, None]))
    grey: Floats = 70 + 60 * (1 - erf((away - radius) / blur / 2**0.5))
    return grey


def photo(grey: Floats, noise: float, rng: np.random.Generator) -> Pixels:
    noisy = np.clip(np.round(grey + rng.normal(0, noise, grey.shape)), 0, 255)
    return np.repeat(noisy.astype(np.uint8)[..., None], 3, axis=2)


def snap_target(picture: Pixels, u_px: float, v_px: float) -> Snapped | str:
    found = snap_within(picture, Region.near(np.array([u_px, v_px])), corners=False)
    return found if isinstance(found, Snapped) else found.why


@pytest.mark.parametrize(("target", "snap"), [(checker, snap_corner), (disc, snap_target)])
def test_a_target_is_found_to_a_few_hundredths_of_a_pixel(
    target: Callable[[], Floats], snap: Callable[[Pixels, float, float], Snapped | str]
) -> None:
    found = snap(photo(target(), 1.0, np.random.default_rng(1)), 58.0, 50.0)
    assert isinstance(found, Snapped)
    assert np.hypot(found.u_px - PLACE[0], found.v_px - PLACE[1]) < 0.06
    assert found.sigma_px < 0.1


def test_a_corner_is_where_opencv_finds_it() -> None:
    grey = photo(checker(), 2.0, np.random.default_rng(6))
    found = snap_corner(grey, 58.0, 50.0)
    assert isinstance(found, Snapped)
    start = np.array([[[58.0, 50.0]]], np.float32)
    ends = cv2.TERM_CRITERIA_EPS | cv2.TERM_CRITERIA_MAX_ITER, 100, 1e-5
    other = cv2.cornerSubPix(grey[..., 0], start, (CORNER_HALF_PX,) * 2, (-1, -1), ends)
    assert np.hypot(*(other.ravel() - np.array([found.u_px, found.v_px]))) < 0.03


@pytest.mark.parametrize(("target", "snap"), [(checker, snap_corner), (disc, snap_target)])
def test_the_sigma_is_that_of_repeated_noise(
    target: Callable[[], Floats], snap: Callable[[Pixels, float, float], Snapped | str]
) -> None:
    rng = np.random.default_rng(2)
    tried = [snap(photo(target(), 12.0, rng), 60.0, 49.0) for _ in range(60)]
    found = [one for one in tried if isinstance(one, Snapped)]
    assert len(found) == len(tried)
    places = np.array([(one.u_px, one.v_px) for one in found])
    scatter = places.std(axis=0).max()
    stated = np.median([one.sigma_px for one in found])
    # 60 draws know a standard deviation to 9 %; stated is first order.
    assert stated == pytest.approx(max(scatter, SMALLEST_SIGMA_PX), rel=0.4)


def test_a_straight_edge_is_no_corner() -> None:
    u = GRID[0] - PLACE[0]
    edge = photo(110 + 70 * erf(u), 1.0, np.random.default_rng(3))
    assert isinstance(snap_corner(edge, 60.0, 49.0), str)


@pytest.mark.parametrize("noise", [0.0, 0.5, 4.0])
def test_bare_ground_is_neither_corner_nor_target(noise: float) -> None:
    ground = photo(np.full((100, 120), 110.0), noise, np.random.default_rng(4))
    assert isinstance(snap_corner(ground, 60.0, 49.0), str)
    assert isinstance(snap_target(ground, 60.0, 49.0), str)


def test_the_edge_of_the_photo_is_said() -> None:
    refused = snap_corner(np.zeros((9, 9, 3), np.uint8), 1.0, 1.0)
    assert isinstance(refused, str)
    assert "edge" in refused


# Snapping inside the region where a point is expected: the one target there, or none.


REGION_PLACE = np.array([140.37, 118.81])
REGION_GRID = np.mgrid[:240, :280][::-1].astype(float)
AWAY = np.array([20.0, -15.0])
"""25 px: where the point is expected, less where it is."""


def draw_disc(place: Floats, radius: float, blur: float = 0.8) -> Floats:
    away = np.hypot(*(REGION_GRID - place[:, None, None]))
    found: Floats = 0.5 * (1 - erf((away - radius) / blur / 2**0.5))
    return found


def ringed(place: Floats) -> Floats:
    """A white disc with a black one in it, less the ground."""
    return 130 * draw_disc(place, 7.0) - 180 * draw_disc(place, 3.2)


def square(place: Floats, half: float) -> Floats:
    u, v = np.abs(REGION_GRID - place[:, None, None])
    found: Floats = 0.25 * (1 - erf((u - half) / 2**0.5)) * (1 - erf((v - half) / 2**0.5))
    return found


def chequer(place: Floats) -> Floats:
    """A white plate with two black fields that meet in its middle, less the ground.

    The fields end within the plate: their own corners have as much contrast as the middle.
    """
    fields = square(place - 5.25, 5.25) + square(place + 5.25, 5.25)
    return 130 * square(place, 12.0) - 200 * fields


def make_photo(*things: Floats) -> Pixels:
    """Things on ground that is a little rough."""
    rng = np.random.default_rng(3)
    grey = 100.0 + sum(things) + rng.normal(0, 3.0, REGION_GRID.shape[1:])
    return np.repeat(np.clip(np.round(grey), 0, 255).astype(np.uint8)[..., None], 3, axis=2)


def region(sigma_px: float = 10.0, pointer_px: Floats | None = None) -> Region:
    middle = REGION_PLACE + AWAY
    pointer = middle if pointer_px is None else pointer_px
    return Region(middle, np.eye(2) * sigma_px**2, pointer)


def snapped(picture: Pixels, where: Region, *, corners: bool = False) -> Snapped | UnclearRegion:
    return snap_within(picture, where, corners=corners)


def off(found: Snapped | UnclearRegion | str, place: Floats = REGION_PLACE) -> float:
    assert isinstance(found, Snapped), found
    return float(np.hypot(found.u_px - place[0], found.v_px - place[1]))


def cross(place: Floats) -> Floats:
    """Two painted bars, less the ground."""
    u, v = np.abs(REGION_GRID - place[:, None, None])
    bars = [
        0.25 * (1 - erf((a - 12) / 1.2)) * (1 - erf((b - 2.2) / 1.2)) for a, b in ((u, v), (v, u))
    ]
    painted: Floats = 110 * np.maximum(*bars)
    return painted


@pytest.mark.parametrize("draw", [ringed, chequer, cross])
@pytest.mark.parametrize("corners", [False, True])
def test_a_target_25_px_from_where_it_is_expected_is_found(
    draw: Callable[[Floats], Floats], *, corners: bool
) -> None:
    picture = make_photo(draw(REGION_PLACE))
    by_itself = snap_corner(picture, *(REGION_PLACE + AWAY))
    assert isinstance(by_itself, str) or off(by_itself) > 5.0
    found = snapped(picture, region(), corners=corners)

    assert off(found) < 0.1
    assert isinstance(found, Snapped)
    assert found.what == "target"


@pytest.mark.parametrize("draw", [ringed, chequer])
def test_of_two_alike_none_is_guessed_but_the_pointer_tells(
    draw: Callable[[Floats], Floats],
) -> None:
    other = REGION_PLACE + np.array([45.0, -25.0])
    picture = make_photo(draw(REGION_PLACE), draw(other))
    refused = snapped(picture, region(15.0))

    assert isinstance(refused, UnclearRegion)
    assert refused.why.startswith("2 things")
    away = np.linalg.norm(refused.place_px[:, None] - [REGION_PLACE, other], axis=2)
    assert sorted(away.argmin(axis=1).tolist()) == [0, 1]
    assert away.min(axis=1).max() < 0.1
    assert off(snapped(picture, region(15.0, other + 3.0)), other) < 0.1


def test_a_line_and_a_corner_are_no_targets_and_a_corner_is_taken_where_one_may_be_meant() -> None:
    line = 130 * square(
        REGION_PLACE + np.array([0.0, 200.0]), 200.0
    )  # its upper edge ends in the picture
    picture = make_photo(line * (REGION_GRID[0] > REGION_PLACE[0]))
    assert isinstance(snapped(picture, region()), UnclearRegion)
    found = snapped(picture, region(), corners=True)

    assert off(found) < 1.0
    assert isinstance(found, Snapped)
    assert found.what == "corner"


@pytest.mark.parametrize("draw", [ringed, chequer])
def test_what_lies_outside_the_region_is_not_taken(draw: Callable[[Floats], Floats]) -> None:
    assert isinstance(snapped(make_photo(draw(REGION_PLACE)), region(3.0)), UnclearRegion)


def test_on_bare_ground_there_is_no_target() -> None:
    assert isinstance(snapped(make_photo(), region()), UnclearRegion)


def test_a_region_beyond_the_photo_is_said() -> None:
    beyond = Region(np.array([-400.0, 50.0]), np.eye(2), np.zeros(2))
    found = snapped(make_photo(), beyond)

    assert isinstance(found, UnclearRegion)
    assert "outside" in found.why
