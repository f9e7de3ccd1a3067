"""Smooth departures of ground from a plane."""

import numpy as np
import pytest

from uavgram.geometry.ground.plane import (
    choose_knots,
    correlated_basis,
    knots_root,
    quadratic_basis,
)
from uavgram.model.arrays import Floats

RNG = np.random.default_rng(4)
PLACES = RNG.uniform(-20.0, 20.0, (40, 2))
KNOTS = PLACES[:12]
ROOT = knots_root(KNOTS, 9.0)


@pytest.mark.parametrize("kind", ["quadratic", "correlated"])
def test_the_slopes_equal_central_differences(kind: str) -> None:
    def value(places: Floats) -> Floats:
        if kind == "quadratic":
            return quadratic_basis(places, np.array([1.0, -3.0]), 7.0).value
        return correlated_basis(places, KNOTS, 9.0, ROOT).value

    basis = (
        quadratic_basis(PLACES, np.array([1.0, -3.0]), 7.0)
        if kind == "quadratic"
        else correlated_basis(PLACES, KNOTS, 9.0, ROOT)
    )
    for axis in range(2):
        step = np.zeros(2)
        step[axis] = 1e-5
        numeric = (value(PLACES + step) - value(PLACES - step)) / 2e-5
        np.testing.assert_allclose(basis.gradient[..., axis], numeric, rtol=1e-5, atol=1e-6)


def test_heights_at_the_knots_have_the_covariance_of_their_distances() -> None:
    value = correlated_basis(KNOTS, KNOTS, 9.0, ROOT).value
    distance = np.linalg.norm(KNOTS[:, None] - KNOTS[None], axis=2)

    np.testing.assert_allclose(value @ value.T, np.exp(-((distance / 9.0) ** 2) / 2), atol=1e-7)


def test_far_from_all_knots_there_is_no_relief() -> None:
    assert np.abs(correlated_basis(np.array([[500.0, 0.0]]), KNOTS, 9.0, ROOT).value).max() < 1e-12


def test_a_quadratic_surface_is_a_known_polynomial() -> None:
    basis = quadratic_basis(np.array([[11.0, 4.0]]), np.array([1.0, -1.0]), 5.0)

    np.testing.assert_allclose(basis.value, [[4.0, 4.0, 1.0]])


def test_knots_lie_at_places_far_apart() -> None:
    line = np.column_stack([np.arange(11.0), np.zeros(11)])

    assert sorted(choose_knots(line, 3)[:, 0].tolist()) == [0.0, 5.0, 10.0]
    assert len(choose_knots(np.zeros((4, 2)), 3)) == 1
