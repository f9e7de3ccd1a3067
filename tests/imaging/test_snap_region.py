"""Snapping inside the region where a point is expected: the one target there, or none."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from scipy.special import erf

from uavgram.imaging.photos.preview import Pixels
from uavgram.imaging.snap import Snapped, snap_circle, snap_corner
from uavgram.imaging.snap_region import Region, UnclearRegion, snap_within
from uavgram.model.arrays import Floats

PLACE = np.array([140.37, 118.81])
GRID = np.mgrid[:240, :280][::-1].astype(float)
AWAY = np.array([20.0, -15.0])
"""25 px: where the point is expected, less where it is."""


def disc(place: Floats, radius: float, blur: float = 0.8) -> Floats:
    away = np.hypot(*(GRID - place[:, None, None]))
    found: Floats = 0.5 * (1 - erf((away - radius) / blur / 2**0.5))
    return found


def ringed(place: Floats) -> Floats:
    """A white disc with a black one in it, less the ground."""
    return 130 * disc(place, 7.0) - 180 * disc(place, 3.2)


def square(place: Floats, half: float) -> Floats:
    u, v = np.abs(GRID - place[:, None, None])
    found: Floats = 0.25 * (1 - erf((u - half) / 2**0.5)) * (1 - erf((v - half) / 2**0.5))
    return found


def chequer(place: Floats) -> Floats:
    """A white plate with two black fields that meet in its middle, less the ground.

    The fields end within the plate: their own corners have as much contrast as the middle.
    """
    fields = square(place - 5.25, 5.25) + square(place + 5.25, 5.25)
    return 130 * square(place, 12.0) - 200 * fields


def photo(*things: Floats) -> Pixels:
    """Things on ground that is a little rough."""
    rng = np.random.default_rng(3)
    grey = 100.0 + sum(things) + rng.normal(0, 3.0, GRID.shape[1:])
    return np.repeat(np.clip(np.round(grey), 0, 255).astype(np.uint8)[..., None], 3, axis=2)


def region(sigma_px: float = 10.0, pointer_px: Floats | None = None) -> Region:
    middle = PLACE + AWAY
    pointer = middle if pointer_px is None else pointer_px
    return Region(middle, np.eye(2) * sigma_px**2, pointer)


def snapped(picture: Pixels, where: Region, *, corners: bool = False) -> Snapped | UnclearRegion:
    return snap_within(picture, where, corners=corners)


def off(found: Snapped | UnclearRegion | str, place: Floats = PLACE) -> float:
    assert isinstance(found, Snapped), found
    return float(np.hypot(found.u_px - place[0], found.v_px - place[1]))


def cross(place: Floats) -> Floats:
    """Two painted bars, less the ground."""
    u, v = np.abs(GRID - place[:, None, None])
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
    picture = photo(draw(PLACE))
    for by_itself in (snap_circle(picture, *(PLACE + AWAY)), snap_corner(picture, *(PLACE + AWAY))):
        assert isinstance(by_itself, str) or off(by_itself) > 5.0
    found = snapped(picture, region(), corners=corners)

    assert off(found) < 0.1
    assert isinstance(found, Snapped)
    assert found.what == "target"


@pytest.mark.parametrize("draw", [ringed, chequer])
def test_of_two_alike_none_is_guessed_but_the_pointer_tells(
    draw: Callable[[Floats], Floats],
) -> None:
    other = PLACE + np.array([45.0, -25.0])
    picture = photo(draw(PLACE), draw(other))
    refused = snapped(picture, region(15.0))

    assert isinstance(refused, UnclearRegion)
    assert refused.why.startswith("2 things")
    away = np.linalg.norm(refused.place_px[:, None] - [PLACE, other], axis=2)
    assert sorted(away.argmin(axis=1).tolist()) == [0, 1]
    assert away.min(axis=1).max() < 0.1
    assert off(snapped(picture, region(15.0, other + 3.0)), other) < 0.1


def test_a_line_and_a_corner_are_no_targets_and_a_corner_is_taken_where_one_may_be_meant() -> None:
    line = 130 * square(PLACE + np.array([0.0, 200.0]), 200.0)  # its upper edge ends in the picture
    picture = photo(line * (GRID[0] > PLACE[0]))
    assert isinstance(snapped(picture, region()), UnclearRegion)
    found = snapped(picture, region(), corners=True)

    assert off(found) < 1.0
    assert isinstance(found, Snapped)
    assert found.what == "corner"


@pytest.mark.parametrize("draw", [ringed, chequer])
def test_what_lies_outside_the_region_is_not_taken(draw: Callable[[Floats], Floats]) -> None:
    assert isinstance(snapped(photo(draw(PLACE)), region(3.0)), UnclearRegion)


def test_on_bare_ground_there_is_no_target() -> None:
    assert isinstance(snapped(photo(), region()), UnclearRegion)


def test_a_region_beyond_the_photo_is_said() -> None:
    beyond = Region(np.array([-400.0, 50.0]), np.eye(2), np.zeros(2))
    found = snapped(photo(), beyond)

    assert isinstance(found, UnclearRegion)
    assert "outside" in found.why
