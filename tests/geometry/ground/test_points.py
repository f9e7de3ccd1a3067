"""Ground points with covariance: the values of the kernels, the covariance of all sources."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from uavgram.geometry.camera.projection import back_project
from uavgram.geometry.ground.plane import intersect_ground
from uavgram.geometry.ground.points import BLOCK, View, compute_ground_points
from uavgram.model.arrays import Floats

LENSES = {
    "brown": np.array([3000.0, 2990, 1999.5, 1499.5, -0.1, 0.02, 3e-4, -2e-4, 0.001]),
    "rational": np.array(
        [3000.0, 2990, 1999.5, 1499.5, 0.05, 0.02, 3e-4, -2e-4, 0.001, 0.1, 0.01, 0.002]
    ),
    "fisheye": np.array([1500.0, 1502, 1999.5, 1499.5, 0.02, -0.01, 0.003, -0.001]),
}
PIXEL = np.array([[1.0, 0.3], [0.3, 2.0]])
ABOVE = 0.7


def view(lens: str, *, plane: bool = True) -> View:
    rng = np.random.default_rng(5)
    parameters = LENSES[lens]
    sigmas = [0.1] * 3 + [0.002] * 3 + [5.0] * 4 + [1e-3] * (len(parameters) - 4)
    sigma = np.array(sigmas + [0.05, 0.01, 0.02] * plane)
    root = rng.normal(size=(len(sigma), len(sigma))) * sigma[:, None]
    turn = Rotation.from_euler("xyz", [0.4, 0.1, 0.2]).as_matrix()
    return View(
        "fisheye" if lens == "fisheye" else "brown",
        parameters,
        np.array([1.0, 2, 50]),
        np.diag([1.0, -1, -1]) @ turn,
        np.array([0.5, 0.02, -0.01]),
        np.array([3.0, 4.0]),
        root @ root.T,
    )


def pixels(count: int) -> Floats:
    return np.random.default_rng(0).uniform([0, 0], [4000, 3000], (count, 2))


def by_kernels(at: View, pixel: Floats, change: Floats) -> Floats:
    """East and north with everything changed: pose, lens, plane, and the pixel at the end."""
    count = len(at.parameters)
    own = at.parameters + change[6 : 6 + count]
    ray = back_project(at.model, own, pixel + change[-2:])
    rotation = at.world_from_camera @ Rotation.from_rotvec(change[3:6]).as_matrix()
    plane = at.plane + change[6 + count : 9 + count]
    center = at.center_world_m + change[:3]
    return intersect_ground(center, ray @ rotation.T, plane, at.pivot_m, ABOVE)[:, :2]


@pytest.mark.parametrize("lens", LENSES)
def test_covariance_is_that_of_central_differences(lens: str) -> None:
    at, pixel = view(lens), pixels(60)
    if lens == "fisheye":  # its corners see the sky
        pixel = 0.4 * pixel + [1200.0, 1200.0]
    found = compute_ground_points(at, pixel, PIXEL, ABOVE)
    count = len(at.parameters)
    plain = np.zeros(11 + count)
    np.testing.assert_allclose(
        found.point_world_m[:, :2], by_kernels(at, pixel, plain), atol=1e-9, equal_nan=True
    )
    step = np.array([1e-4] * 3 + [1e-6] * 3 + [1e-2] * 4 + [1e-6] * (count - 4))
    step = np.concatenate([step, [1e-4, 1e-6, 1e-6, 1e-3, 1e-3]])
    columns = []
    for k, size in enumerate(step):
        change = plain.copy()
        change[k] = size
        columns.append((by_kernels(at, pixel, change) - by_kernels(at, pixel, -change)) / 2 / size)
    jacobian = np.stack(columns, axis=2)
    joint = np.zeros((len(step), len(step)))
    joint[:-2, :-2], joint[-2:, -2:] = at.covariance, PIXEL
    expected = jacobian @ joint @ jacobian.swapaxes(1, 2)
    scale = np.abs(expected).max(axis=(1, 2), keepdims=True)
    assert np.isfinite(expected).all()
    assert (np.abs(found.covariance_m2 - expected) <= 1e-6 * scale).all()


def test_points_are_those_of_opencv_and_a_level_plane() -> None:
    at = view("brown", plane=False)
    level = replace(at, plane=np.zeros(3))
    pixel = pixels(500)
    matrix = np.array([[3000.0, 0, 1999.5], [0, 2990, 1499.5], [0, 0, 1]])
    criteria = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 100, 1e-14)
    plain = cv2.undistortPoints(pixel, matrix, at.parameters[4:], criteria=criteria)[:, 0]
    ray = np.column_stack([plain, np.ones(500)]) @ at.world_from_camera.T
    expected = at.center_world_m - ray * (at.center_world_m[2] / ray[:, 2])[:, None]
    found = compute_ground_points(level, pixel, PIXEL)
    np.testing.assert_allclose(found.point_world_m, expected, atol=1e-8)


def test_blocks_threads_and_noise_of_each_pixel_change_nothing() -> None:
    at, pixel = view("brown"), pixels(3 * BLOCK + 17)
    found = compute_ground_points(at, pixel, PIXEL, ABOVE)
    each = np.tile(PIXEL, (len(pixel), 1, 1))
    above = np.full(len(pixel), ABOVE)
    for other in (
        compute_ground_points(at, pixel, each, above),
        compute_ground_points(at, pixel, PIXEL, ABOVE, threads=2),
        compute_ground_points(at, pixel, each, above, threads=3),
    ):
        np.testing.assert_allclose(other.point_world_m, found.point_world_m, rtol=1e-12)
        np.testing.assert_allclose(other.covariance_m2, found.covariance_m2, rtol=1e-12)
    assert compute_ground_points(at, pixel[:0], PIXEL).point_world_m.shape == (0, 3)


def test_pixels_that_show_no_ground_are_nan() -> None:
    at = view("brown")
    up = replace(at, world_from_camera=at.world_from_camera @ np.diag([1.0, -1, -1]))
    for each, pixel in ((up, pixels(5)), (at, np.array([[np.nan, 0.0], [1e9, 0.0]]))):
        found = compute_ground_points(each, pixel, PIXEL)
        assert np.isnan(found.point_world_m).all()
        assert np.isnan(found.covariance_m2).all()


def test_a_covariance_of_another_size_is_refused() -> None:
    at = view("brown")
    with pytest.raises(ValueError, match="expected 15 x 15, or 18 with the plane, got"):
        replace(at, covariance=np.eye(7))
