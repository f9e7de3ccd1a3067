"""How far points lie beside a known line: offsets, derivatives, and errors that they share."""

from __future__ import annotations

import numpy as np
import pytest
from derivatives import assert_derivative, central_differences

from uavgram.geometry.ground.line_of_position import (
    compute_inverse_root,
    compute_joint_covariance,
    compute_line_offsets,
)
from uavgram.model.arrays import Floats

ENDS = np.array([[2.0, -1.0, 0.4], [14.0, 4.0, 1.7]])
ALONG = (ENDS[1, :2] - ENDS[0, :2]) / 13.0
LEFT = np.array([-ALONG[1], ALONG[0]])


def beside(share: float, left_m: float, above_m: float) -> Floats:
    place = ENDS[0] + share * (ENDS[1] - ENDS[0]) + [*(left_m * LEFT), above_m]
    return np.asarray(place)


def test_offsets_are_to_the_left_and_up() -> None:
    points = np.stack([beside(0.3, 0.25, -0.1), beside(1.2, -2.0, 0.6)])

    np.testing.assert_allclose(
        compute_line_offsets(points, ENDS, upwards=True).value,
        [[0.25, -0.1], [-2.0, 0.6]],
        atol=1e-12,
    )
    np.testing.assert_allclose(
        compute_line_offsets(points, ENDS, upwards=False).value, [[0.25], [-2.0]], atol=1e-12
    )


def test_derivatives_by_points_and_by_ends_are_central_differences() -> None:
    point = beside(0.7, 0.0, 0.0)
    found = compute_line_offsets(point[None], ENDS, upwards=True)

    def of_point(place: Floats) -> Floats:
        return np.asarray(compute_line_offsets(place[None], ENDS, upwards=True).value[0])

    def of_ends(ends: Floats) -> Floats:
        return np.asarray(
            compute_line_offsets(point[None], ends.reshape(2, 3), upwards=True).value[0]
        )

    assert_derivative(found.gradient[0], central_differences(of_point, point, 1e-5))
    by_ends = found.by_ends[0].reshape(2, 6)
    assert_derivative(by_ends, central_differences(of_ends, ENDS.ravel(), 1e-5))


def test_two_points_at_one_place_err_alike_and_those_at_the_ends_do_not() -> None:
    points = np.stack([beside(share, 0.0, 0.0) for share in (0.0, 1.0, 0.5, 0.5)])
    sigma = np.array([[0.03, 0.03, 0.05], [0.04, 0.04, 0.07]])
    found = compute_joint_covariance(
        compute_line_offsets(points, ENDS, upwards=False).by_ends, sigma, 0.0
    )

    np.testing.assert_allclose(found[0, :2], [0.03**2, 0.0], atol=1e-15)
    np.testing.assert_allclose(found[1, 1], 0.04**2)
    np.testing.assert_allclose(found[2, 2:], (0.03**2 + 0.04**2) / 4)
    own = compute_joint_covariance(
        compute_line_offsets(points, ENDS, upwards=False).by_ends, sigma, 0.01
    )
    np.testing.assert_allclose(own - found, 1e-4 * np.eye(4), atol=1e-15)


def test_the_joint_covariance_is_that_of_drawn_ends() -> None:
    points = np.stack([beside(share, 0.0, 0.0) for share in (-0.4, 0.2, 0.9, 1.6)])
    sigma = np.array([[0.02, 0.03, 0.01], [0.01, 0.02, 0.04]])
    rng = np.random.default_rng(5)
    drawn = [
        compute_line_offsets(
            points, ENDS + sigma * rng.normal(size=(2, 3)), upwards=True
        ).value.ravel()
        for _ in range(4000)
    ]
    stated = compute_joint_covariance(
        compute_line_offsets(points, ENDS, upwards=True).by_ends, sigma, 0.0
    )
    scale = np.sqrt(np.diag(stated))

    # A correlation from n draws has a standard deviation of at most 1 / sqrt(n).
    assert np.abs((np.cov(np.array(drawn).T) - stated) / np.outer(scale, scale)).max() < 0.1


def test_the_inverse_root_whitens_and_is_symmetric() -> None:
    root = np.random.default_rng(2).normal(size=(5, 5))
    covariance = root @ root.T + 0.1 * np.eye(5)
    found = compute_inverse_root(covariance)

    np.testing.assert_allclose(found @ covariance @ found, np.eye(5), atol=1e-10)
    np.testing.assert_allclose(found, found.T, atol=1e-12)


@pytest.mark.parametrize("share", [-30.0, 40.0])
def test_far_along_the_line_its_direction_counts_no_less_than_near(share: float) -> None:
    point = beside(share, 0.0, 0.0)
    lever = compute_line_offsets(point[None], ENDS, upwards=False).by_ends[0, 0, :, :2] @ -LEFT

    assert np.abs(lever).max() == pytest.approx(2.0)
