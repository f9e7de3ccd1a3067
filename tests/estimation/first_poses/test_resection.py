"""Poses over points of a plane: both of its tilts, and the best fit near one."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from uavgram.estimation.first_poses.resection import (
    Pose,
    find_consensus,
    find_second_pose,
    project_points,
    refine_pose,
    resect_each,
    resect_from_plane,
    resect_in_space,
)
from uavgram.model.arrays import Floats

DOWN = np.diag([1.0, -1.0, -1.0])

SIGMA = np.full(5, 3e-4)
"""Of rays, a pixel of a usual lens."""


def seen_by(pose: Pose, point_m: Floats) -> Floats:
    """(n, 3) rays, z = 1, to points (n, 2) of the plane z = 0."""
    center, rotation = pose
    seen = (on_plane(point_m) - center) @ rotation
    return np.asarray(seen / seen[:, 2:])


def on_plane(point_m: Floats) -> Floats:
    """(n, 3) points (n, 2) of the plane z = 0."""
    return np.column_stack([point_m, np.zeros(len(point_m))])


def made_up(seed: int, tilt_deg: float, spread_m: float) -> tuple[Pose, Floats]:
    """A camera 36 m above the middle of five points, tilted about its own x."""
    rng = np.random.default_rng(seed)
    point = rng.uniform(-spread_m, spread_m, (5, 2))
    rotation = DOWN @ Rotation.from_euler("x", tilt_deg, degrees=True).as_matrix()
    sight = rotation[:, 2] / -rotation[2, 2] * 36.0
    return (np.array([*point.mean(axis=0), 0.0]) - sight, rotation), point


def test_the_other_pose_shows_points_alike_where_perspective_is_weak() -> None:
    pose, point = made_up(0, 20.0, 0.05)
    other = find_second_pose(pose, point)
    np.testing.assert_allclose(seen_by(other, point), seen_by(pose, point), atol=2e-6)
    np.testing.assert_allclose(other[1] @ other[1].T, np.eye(3), atol=1e-12)
    assert np.linalg.det(other[1]) == pytest.approx(1.0)
    apart = Rotation.from_matrix(pose[1].T @ other[1]).magnitude()
    assert np.rad2deg(apart) == pytest.approx(40.0, abs=0.01)  # twice the tilt to the sight


@pytest.mark.parametrize("seed", range(5))
def test_a_disturbed_pose_is_polished_back_to_the_truth(seed: int) -> None:
    (center, rotation), point = made_up(seed, 25.0, 12.0)
    ray = seen_by((center, rotation), point)
    turned = rotation @ Rotation.from_rotvec([0.05, -0.04, 0.1]).as_matrix()
    end = refine_pose([(center + np.array([1.0, -2.0, 1.5]), turned)], on_plane(point), ray, SIGMA)
    assert end is not None
    cost, (found, found_rotation) = end
    assert cost * SIGMA[0] ** 2 < 1e-12
    np.testing.assert_allclose(found, center, atol=1e-5)
    np.testing.assert_allclose(found_rotation, rotation, atol=1e-6)


def test_no_pose_below_the_ground_or_with_points_behind_it() -> None:
    (center, rotation), point = made_up(1, 0.0, 12.0)
    ray = seen_by((center, rotation), point)
    assert refine_pose([(-center, rotation)], on_plane(point), ray, SIGMA) is None
    assert refine_pose([(center, -DOWN)], on_plane(point), ray, SIGMA) is None
    direct = resect_from_plane(point, ray)
    assert direct is not None
    np.testing.assert_allclose(direct[0], center, atol=1e-6)


def test_many_poses_at_once_are_those_of_each_one() -> None:
    each = [made_up(seed, 20.0, 12.0) for seed in range(4)]
    point = np.stack([point for _, point in each])
    ray = np.stack([seen_by(*one) for one in each])
    ray[1, 2] = np.nan  # beyond the lens
    point[2] = np.outer(np.arange(5.0), [1.0, 2.0])  # in line
    center, rotation = resect_each(point, ray)
    for k, (pose, _) in enumerate(each):
        alone = resect_from_plane(point[k], ray[k])
        if k in (1, 2):
            assert alone is None
            assert np.isnan(center[k]).all()
        else:
            np.testing.assert_allclose(center[k], pose[0], atol=1e-6)
            np.testing.assert_allclose(rotation[k], pose[1], atol=1e-7)


def on_cars(seed: int) -> tuple[Pose, Floats, Floats]:
    """A camera 30 m above cambered ground, tilted by 60 degrees; points up to 1.4 m high."""
    rng = np.random.default_rng(seed)
    point = np.column_stack([rng.uniform(-15.0, 15.0, (16, 2)), rng.uniform(-0.3, 0.3, 16)])
    point[:6, 2] += 1.1
    rotation = DOWN @ Rotation.from_euler("x", 60.0, degrees=True).as_matrix()
    center = np.array([0.0, 0.0, 30.0]) - [*(rotation[:2, 2] / -rotation[2, 2] * 30.0), 0.0]
    seen = (point - center) @ rotation
    return (center, rotation), point, np.asarray(seen / seen[:, 2:])


@pytest.mark.parametrize("seed", range(4))
def test_the_pose_over_points_in_space_is_that_of_the_camera(seed: int) -> None:
    (center, rotation), point, ray = on_cars(seed)
    sigma = np.full(16, 3e-4)
    every = np.stack([ray, ray * [1.02, 1.02, 1.0]])
    found, turned = resect_in_space(point, every, sigma)
    np.testing.assert_allclose(found[0], center, atol=1e-4)
    np.testing.assert_allclose(turned[0], rotation, atol=1e-5)
    np.testing.assert_allclose(project_points(point, (found[0], turned[0])), ray[:, :2], atol=1e-6)
    ray[3] = np.nan
    assert np.isnan(resect_in_space(point, ray, sigma)[0]).all()


@pytest.mark.parametrize("seed", range(4))
def test_exchanged_points_of_cars_do_not_agree_with_the_others(seed: int) -> None:
    _, point, ray = on_cars(seed)
    ray[[2, 11]] = ray[[11, 2]]
    agree = find_consensus(point, ray, np.full(16, 3e-4))
    assert agree is not None
    np.testing.assert_array_equal(np.flatnonzero(~agree), [2, 11])
