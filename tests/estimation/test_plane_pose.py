"""Poses from lengths alone: the search finds the truth, and every other exact solution."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from uavgram.estimation.plane_pose import normal_grid, search_plane
from uavgram.estimation.plane_resection import resect_from_plane

DOWN = np.diag([1.0, -1.0, -1.0])


def camera_over_plane(rng, max_tilt_deg):
    """Centre and world-from-camera of a camera tilted by up to that angle, in any direction."""
    tilt, azimuth, spin = rng.uniform(0, np.deg2rad(max_tilt_deg)), *rng.uniform(0, 2 * np.pi, 2)
    axis = np.array([np.cos(azimuth), np.sin(azimuth), 0])
    rotation = Rotation.from_rotvec(tilt * axis).as_matrix() @ DOWN
    return np.array([0, 0, rng.uniform(10, 60)]), rotation @ Rotation.from_euler(
        "z", spin
    ).as_matrix()


def points_in_view(rng, center, rotation, count):
    """(count, 2) points of the plane z = 0 in a field of view of 70 by 55 degrees, and rays."""
    found, rays = [], []
    while len(found) < count:
        ray = np.array([rng.uniform(-0.7, 0.7), rng.uniform(-0.52, 0.52), 1.0])
        direction = rotation @ ray
        if direction[2] < -0.15 * np.linalg.norm(ray):  # not at the horizon
            found.append(center[:2] - direction[:2] / direction[2] * center[2])
            rays.append(ray)
    return np.array(found), np.array(rays)


def true_plane(center, rotation):
    return -rotation[2] / center[2]


def tilt_and_height(plane):
    size = np.linalg.norm(plane)
    return plane / size, 1 / size


@pytest.mark.parametrize("part", range(3))
def test_the_right_plane_is_found_from_four_to_ten_unconnected_lines_in_all_300_scenes(part):
    rng = np.random.default_rng(part)
    for scene in range(100):
        lines = int(rng.integers(4, 11))
        center, rotation = camera_over_plane(rng, 60)
        point, ray = points_in_view(rng, center, rotation, 2 * lines)
        length = np.linalg.norm(point[:lines] - point[lines:], axis=1)
        sigma = 0.002 * length
        found = search_plane(ray[:lines], ray[lines:], length, sigma)
        truth = true_plane(center, rotation)
        assert found[0].cost < 1e-10, scene
        np.testing.assert_allclose(found[0].plane, truth, atol=1e-6 * np.linalg.norm(truth))


def every_exact_solution(start, end, length, starts):
    """Planes by scipy from many first values: what an exhaustive search finds."""

    def residual(m):
        depth = np.concatenate([start @ m, end @ m])
        if (depth <= 1e-6).any():
            return np.full(len(length), 1e3)
        apart = start / (start @ m)[:, None] - end / (end @ m)[:, None]
        return np.linalg.norm(apart, axis=1) / length - 1

    found = []
    for first in starts:
        result = least_squares(residual, first, method="lm", xtol=1e-14, ftol=1e-14, gtol=1e-14)
        new = all(np.linalg.norm(m - result.x) > 1e-4 * np.linalg.norm(m) for m in found)
        if 2 * result.cost < 1e-16 and new:
            found.append(result.x)
    return found


@pytest.mark.parametrize("figure", ["lines", "triangle"])
def test_three_lengths_give_every_solution_of_an_exhaustive_search(figure):
    rng = np.random.default_rng(7)
    numbers = []
    for scene in range(12):
        center, rotation = camera_over_plane(rng, 50)
        if figure == "lines":
            point, ray = points_in_view(rng, center, rotation, 6)
            a, b = np.arange(3), np.arange(3, 6)
        else:
            point, ray = points_in_view(rng, center, rotation, 3)
            a, b = np.array([0, 1, 2]), np.array([1, 2, 0])
        length = np.linalg.norm(point[a] - point[b], axis=1)
        found = search_plane(ray[a], ray[b], length, 1e-4 * length)
        exact = [f.plane for f in found if f.cost < 1e-6]
        normals = normal_grid()[rng.permutation(len(normal_grid()))[:60]]
        starts = [n / (center[2] * rng.uniform(0.6, 1.5)) for n in normals]
        expected = every_exact_solution(
            ray[a], ray[b], length, [*starts, true_plane(center, rotation)]
        )
        for m in expected:
            if np.degrees(np.arccos(m[2] / np.linalg.norm(m))) < 85:
                near = min(np.linalg.norm(m - p) / np.linalg.norm(m) for p in exact)
                assert near < 1e-5, (scene, m, exact)
        for i, p in enumerate(exact):
            apart = [np.linalg.norm(p - q) for q in exact[:i]]
            assert not apart or min(apart) > 1e-6 * np.linalg.norm(p)
        numbers.append(len(exact))
    assert max(numbers) > 1  # the ambiguity that the search is there for
    if figure == "triangle":
        assert np.mean(np.array(numbers) > 1) > 0.8


def test_lengths_that_no_plane_explains_still_give_the_best_one():
    rng = np.random.default_rng(3)
    center, rotation = camera_over_plane(rng, 20)
    point, ray = points_in_view(rng, center, rotation, 10)
    length = np.linalg.norm(point[:5] - point[5:], axis=1)
    length[2] += 1.0
    found = search_plane(ray[:5], ray[5:], length, np.full(5, 0.01))
    assert found
    assert found[0].cost > 10
    assert [c.cost for c in found] == sorted(c.cost for c in found)


def test_two_picks_on_the_same_pixel_are_no_length():
    ray = np.array([[0.1, 0.1, 1], [0.2, -0.1, 1], [-0.3, 0.2, 1], [0.0, 0.3, 1]])
    end = ray + np.array([0.1, 0.05, 0])
    end[1] = ray[1]
    assert search_plane(ray, end, np.full(4, 5.0), np.full(4, 0.01)) == ()


@pytest.mark.parametrize("count", [4, 5, 12])
def test_resection_equals_that_of_opencv(count):
    rng = np.random.default_rng(count)
    for _ in range(40):
        center, rotation = camera_over_plane(rng, 60)
        center[:2] = rng.uniform(-30, 30, 2)
        point, ray = points_in_view(rng, center, rotation, count)
        flat = np.column_stack([point, np.zeros(count)])
        ok, rvec, tvec = cv2.solvePnP(
            flat, np.ascontiguousarray(ray[:, :2]), np.eye(3), None, flags=cv2.SOLVEPNP_IPPE
        )
        assert ok
        turn = Rotation.from_rotvec(rvec[:, 0]).as_matrix().T
        found_center, found_rotation = resect_from_plane(point, ray)
        np.testing.assert_allclose(found_center, -turn @ tvec[:, 0], atol=1e-4 * center[2])
        np.testing.assert_allclose(found_rotation, turn, atol=1e-4)
        np.testing.assert_allclose(found_center, center, atol=1e-6 * center[2])
        np.testing.assert_allclose(found_rotation, rotation, atol=1e-7)


def test_points_in_line_resect_nothing():
    rng = np.random.default_rng(0)
    along = rng.uniform(-5, 5, 6)
    point = np.column_stack([along, 2 * along + 1])
    center, rotation = np.array([0, 0, 20.0]), DOWN
    camera = (np.column_stack([point, np.zeros(6)]) - center) @ rotation
    assert resect_from_plane(point, camera / camera[:, 2:]) is None
    assert resect_from_plane(np.zeros((4, 2)), np.ones((4, 3))) is None
