"""Which points are on the ground, of heights that the poses raise and tilt together."""

from __future__ import annotations

import numpy as np
import pytest

from uavgram.model.arrays import Bools, Floats
from uavgram.stages.ground_consensus import find_ground_points

OWN_M = 0.05
ROUGH_M = 0.1


def survey(
    ground: int, raised: tuple[float, ...], seed: int, tilt_m: float = 3.0
) -> tuple[Bools, Floats, Floats]:
    """Points on the ground and off it: truth, heights as the photos show them, covariance.

    The heights share an error of their level and of two slopes. Each error is drawn by itself: a
    draw from the covariance depends on the arithmetic of the machine, as its singular vectors do.
    """
    rng = np.random.default_rng(seed)
    true = np.concatenate([np.zeros(ground), raised])
    place = rng.uniform(-1.0, 1.0, (len(true), 2))
    modes = np.column_stack([np.ones(len(true)), place]) * tilt_m
    covariance = modes @ modes.T + OWN_M**2 * np.eye(len(true))
    uneven = ROUGH_M * rng.standard_normal(len(true))
    shared, own = modes @ rng.standard_normal(3), OWN_M * rng.standard_normal(len(true))
    height = true + uneven + shared + own
    return true == 0.0, height, covariance


@pytest.mark.parametrize("seed", range(8))
def test_points_on_the_ground_are_found_among_twice_as_many_roofs(seed: int) -> None:
    cars = (*np.full(24, 1.4), *np.full(20, 0.9), 5.2, 3.8, 6.0)
    on_ground, height, covariance = survey(24, cars, seed)

    found = find_ground_points(height, covariance, np.full(len(height), ROUGH_M))

    # Of 400 draws, 366 have at most one wrong label and 399 at most five; one has another plane.
    assert np.count_nonzero(found != on_ground) <= 1


@pytest.mark.parametrize("seed", range(4))
def test_points_that_are_all_on_the_ground_are_found_on_it(seed: int) -> None:
    on_ground, height, covariance = survey(12, (), seed)

    found = find_ground_points(height, covariance, np.full(12, ROUGH_M))

    assert np.count_nonzero(~found) <= 1
    assert on_ground.all()


def test_a_height_that_nothing_shows_counts_as_on_the_ground() -> None:
    unknown = find_ground_points(np.array([0.3]), np.array([[100.0]]), np.array([ROUGH_M]))
    shown = find_ground_points(np.array([1.4]), np.array([[0.01]]), np.array([ROUGH_M]))

    assert unknown.tolist() == [True]
    assert shown.tolist() == [False]


def test_a_point_far_below_the_others_is_not_on_the_ground_and_does_not_move_it() -> None:
    _, height, covariance = survey(12, (-4.0,), 3)

    alone = find_ground_points(height[:12], covariance[:12, :12], np.full(12, ROUGH_M))
    found = find_ground_points(height, covariance, np.full(13, ROUGH_M))

    assert found.tolist() == [*alone, False]
    assert np.count_nonzero(alone) >= 11
