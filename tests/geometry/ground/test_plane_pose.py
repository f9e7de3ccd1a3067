"""A camera over a plane, from lengths alone."""

from __future__ import annotations

import numpy as np
import pytest
from derivatives import assert_derivative, central_differences

from uavgram.geometry.ground.plane import intersect_ground
from uavgram.geometry.ground.plane_pose import (
    compute_end_components,
    differentiate_by_ends,
    differentiate_by_plane,
    lengths_on_plane,
    pose_above_plane,
)
from uavgram.model.arrays import Floats


def planes() -> Floats:
    normal = np.array([[0.0, 0, 1], [0.1, 0.5, 0.8], [-0.6, 0.2, 0.7], [0, -0.3, 0.9]])
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    result: Floats = normal / np.array([[40.0], [55], [12], [80]])
    return result


def rays(seed: int) -> Floats:
    plane_coordinates = np.random.default_rng(seed).uniform(-0.4, 0.4, (6, 2))
    return np.concatenate([plane_coordinates, np.ones((6, 1))], axis=1)


def pairs(start: Floats, end: Floats) -> Floats:
    """Ends (3, 2, L) of lines with rays (L, 3)."""
    return np.stack([start.T, end.T], axis=1)


def lengths(plane: Floats, ends: Floats) -> Floats:
    """(S, L) on planes (S, 3)."""
    return lengths_on_plane(np.moveaxis(plane, -1, 0)[..., None], ends[:, :, None]).length


def test_lengths_are_those_between_the_ground_points_of_the_pose() -> None:
    start, end = rays(1), rays(2)
    found = lengths(planes(), pairs(start, end))
    for plane, length in zip(planes(), found, strict=True):
        center, rotation = pose_above_plane(plane)
        ground = [
            intersect_ground(center, ray @ rotation.T, np.zeros(3), np.zeros(2))
            for ray in (start, end)
        ]
        np.testing.assert_allclose(length, np.linalg.norm(ground[0] - ground[1], axis=1))


@pytest.mark.parametrize("plane", planes())
def test_derivatives_by_the_plane_equal_central_differences(plane: Floats) -> None:
    ends = pairs(rays(1), rays(2))
    on_plane = lengths_on_plane(plane[:, None], ends)
    found = differentiate_by_plane(on_plane, compute_end_components(on_plane))
    numeric = central_differences(lambda m: lengths_on_plane(m[:, None], ends).length, plane, 1e-5)
    assert_derivative(found.T, numeric)


@pytest.mark.parametrize("plane", planes())
def test_derivatives_by_the_ends_equal_central_differences(plane: Floats) -> None:
    ends = pairs(rays(1), rays(2))
    on_plane = lengths_on_plane(plane[:, None], ends)
    found = differentiate_by_ends(on_plane, compute_end_components(on_plane))

    def moved(shift: Floats) -> Floats:
        by = np.append(shift.reshape(2, 2), [[0.0, 0.0]], axis=0)
        return lengths_on_plane(plane[:, None], ends + by[:, :, None]).length

    numeric = central_differences(moved, np.zeros(4), 1e-4)
    assert_derivative(found.reshape(4, -1).T, numeric)


def test_beyond_the_horizon_there_is_no_length() -> None:
    level = np.array([0.0, 0.1, 0.0])[:, None]  # looking along the ground, 10 m above it
    above, below = np.array([[0.0, -0.2, 1.0]]), np.array([[0.0, 0.2, 1.0]])
    for ends in (pairs(above, below), pairs(below, above), pairs(below, below)):
        found = lengths_on_plane(level, ends)
        assert np.isnan(found.length).all()
        assert np.isnan(differentiate_by_plane(found, compute_end_components(found))).all()
        assert np.isnan(differentiate_by_ends(found, compute_end_components(found))).all()


@pytest.mark.parametrize("plane", [*planes(), np.array([0, 0.1, 0])])
def test_pose_stands_over_the_origin_with_image_up_to_the_north(plane: Floats) -> None:
    center, rotation = pose_above_plane(plane)
    np.testing.assert_allclose(center, np.array([0, 0, 1 / np.linalg.norm(plane)]))
    np.testing.assert_allclose(rotation @ rotation.T, np.eye(3), atol=1e-15)
    assert np.linalg.det(rotation) == pytest.approx(1)
    np.testing.assert_allclose(rotation @ plane * center[2], [0, 0, -1], atol=1e-15)
    image_up = rotation @ [0, -1, 0]
    assert image_up[0] == pytest.approx(0, abs=1e-15)
    assert image_up[1] >= 0


def test_looking_at_the_horizon_the_optical_axis_is_north() -> None:
    _, rotation = pose_above_plane(np.array([0, 0.1, 0]))
    np.testing.assert_allclose(rotation @ [0, 0, 1], [0, 1, 0], atol=1e-15)
