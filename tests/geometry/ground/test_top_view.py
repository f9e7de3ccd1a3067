"""Where a top view's pixels lie in the photos, and how well they are placed."""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
import pytest
import top_views
from scipy.spatial.transform import Rotation
from top_views import LENSES, ORIGIN, UTM, cv_project, looking, make_view

from uavgram.geometry.geodesy import projected_from_enu
from uavgram.geometry.ground.top_view import (
    MAX_OFF_NADIR,
    FrameCovariance,
    View,
    compute_place_sigma,
)
from uavgram.model.arrays import Floats
from uavgram.model.maps import GroundRaster

PLANE, PIVOT = (1.5, 0.04, -0.03), (3.0, -2.0)


@pytest.fixture(scope="module")
def oblique() -> View:
    return make_view([[2.0, -20.0, 30.0]], [looking(35, 12, 4)], plane=PLANE, pivot=PIVOT)


def local_raster(**changes: float) -> GroundRaster:
    size: dict[str, Any] = {
        "west_m": -12.0,
        "north_m": 15.0,
        "pixel_m": 0.5,
        "width": 40,
        "height": 50,
    }
    return GroundRaster(**size | changes, crs=None)


@pytest.mark.parametrize("crs", [None, UTM, "EPSG:3857"])
def test_ground_positions_are_those_of_pyproj_on_the_plane(crs: str | None) -> None:
    view = make_view([[0, 0, 40.0]], [looking()], plane=PLANE, pivot=PIVOT, crs=crs)
    place = {"west_m": -12.0, "north_m": 15.0}
    if crs:
        east, north = projected_from_enu(np.array([[-400.0, 300.0, 0.0]]), ORIGIN, crs)[0, :2]
        place = {"west_m": east, "north_m": north}
    raster = GroundRaster(**place, pixel_m=20.0, width=40, height=30, crs=crs)
    columns, rows = np.arange(40.0), np.arange(30.0)

    world = view.ground(raster, columns, rows)

    row, column = np.mgrid[:30, :40].reshape(2, -1).astype(float)
    expected = top_views.world_of(view, raster, column, row).reshape(30, 40, 3)
    # the surface's height enters as a height: up differs from it by the earth's curvature
    np.testing.assert_allclose(world[..., :2], expected[..., :2], atol=2e-5)
    up = PLANE[0] + (world[..., :2] - PIVOT) @ PLANE[1:]
    np.testing.assert_allclose(world[..., 2], up, atol=1e-6)


@pytest.mark.parametrize("lens", LENSES)
def test_a_place_is_seen_where_opencv_projects_it(lens: str) -> None:
    center, rotation = np.array([1.0, 2.0, 30.0]), looking(15, 200, 3)
    view = make_view([center], [rotation], lens=lens)
    world = np.random.default_rng(1).uniform([-9, -9, -1], [9, 9, 1], (200, 3))

    pixel, off_nadir = view.look(0, world)

    np.testing.assert_allclose(pixel, cv_project(lens, center, rotation, world), atol=1e-8)
    down = (center - world) / np.linalg.norm(center - world, axis=1, keepdims=True)
    np.testing.assert_allclose(off_nadir, np.tan(np.arccos(down[:, 2])), rtol=1e-9)


def test_what_is_above_the_camera_is_not_seen() -> None:
    view = make_view([[0, 0, 30.0]], [looking(80)])

    _, off_nadir = view.look(0, np.array([[0.0, 50.0, 30.0], [0.0, 50.0, 31.0], [0.0, 50.0, 29.0]]))

    assert np.isnan(off_nadir[:2]).all()
    assert not view.shows(np.full(3, 400.0), np.full(3, 300.0), off_nadir).any()


def test_a_photo_shows_its_pixels_to_their_outer_edges_and_no_flat_ground(oblique: View) -> None:
    u = np.array([-0.5, -0.51, 799.5, 799.51, 100, 100, 100, np.nan])
    v = np.array([10, 10, 10, 10, 599.5, 599.6, 100, 10])
    off_nadir = np.array([1.0] * 6 + [MAX_OFF_NADIR * 1.001, 1.0])

    shown = oblique.shows(u, v, off_nadir)

    assert shown.tolist() == [True, False, True, False, True, False, False, False]
    assert np.degrees(np.arctan(1 / MAX_OFF_NADIR)) == pytest.approx(10, abs=0.3)


def test_the_least_height_is_that_above_the_sloping_plane() -> None:
    view = make_view(
        [[100.0, 0, 30.0], [0, 0, 28.0]], [looking()] * 2, plane=(2.0, 0.1, 0.0), pivot=(0, 0)
    )

    assert view.least_height_m == pytest.approx(18.0)


def meet(
    lens: str, center: Floats, rotation: Floats, parameters: Floats, surface: Floats, pixel: Floats
) -> Floats:
    """(N, 2) east and north of pixels, by OpenCV's undistortion and the plane's equation."""
    fx, fy, cx, cy = parameters[:4]
    matrix = np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1.0]])
    flat = np.ascontiguousarray(pixel[:, None])
    stop = (cv2.TERM_CRITERIA_MAX_ITER | cv2.TERM_CRITERIA_EPS, 300, 1e-14)
    if lens == "fisheye":
        ray = cv2.fisheye.undistortPoints(flat, matrix, parameters[4:], criteria=stop)[:, 0]
    else:
        ray = cv2.undistortPoints(flat, matrix, parameters[4:], None, None, None, stop)[:, 0]
    ray = np.concatenate([ray, np.ones((len(ray), 1))], 1) @ rotation.T
    normal = np.array([-surface[1], -surface[2], 1.0])
    level = surface[0] - surface[1:] @ PIVOT
    far = (level - center @ normal) / (ray @ normal)
    result: Floats = (center + far[:, None] * ray)[:, :2]
    return result


@pytest.mark.parametrize("lens", ["brown", "fisheye"])
def test_sigma_is_that_of_everything_moved_by_its_joint_covariance(lens: str) -> None:
    center, rotation = np.array([2.0, -20.0, 30.0]), looking(35, 12, 4)
    view = make_view([center], [rotation], lens=lens, plane=PLANE, pivot=PIVOT)
    parameters = LENSES[lens]
    count = 9 + len(parameters)
    rng = np.random.default_rng(5)
    scale = np.concatenate(
        [[0.2, 0.3, 0.25], [3e-3, 4e-3, 5e-3], [2.0, 3.0, 1.5, 1.0],
         np.full(len(parameters) - 4, 2e-3), [0.1, 4e-3, 5e-3]]
    )  # fmt: skip
    mixed = rng.normal(size=(count, 2 * count))
    correlation = np.corrcoef(mixed)
    covariance = correlation * np.outer(scale, scale)
    pixel = rng.uniform([60, 60], [740, 540], (30, 2))
    known = FrameCovariance(covariance[None], pixel_sigma_px=0.8, roughness_sigma_m=0.06)

    def place(change: Floats, on_pixel: Floats | float = 0.0) -> Floats:
        moved = rotation @ Rotation.from_rotvec(change[3:6]).as_matrix()
        surface = np.array(PLANE) + change[-3:]
        lens_now = parameters + change[6:-3]
        return meet(lens, center + change[:3], moved, lens_now, surface, pixel + on_pixel)

    def by(step: Floats) -> Floats:
        return (place(step) - place(-step)) / 2

    part = np.stack(
        [by(1e-3 * s * e) / (1e-3 * s) for s, e in zip(scale, np.eye(count), strict=True)], -1
    )
    spread = part @ covariance @ np.swapaxes(part, 1, 2)
    none = np.zeros(count)
    aim = np.stack([place(none, d) - place(none, -d) for d in 0.05 * np.eye(2)], -1) / 0.1
    spread += 0.8**2 * aim @ np.swapaxes(aim, 1, 2)
    raised = part[:, :, -3:-2]
    spread += 0.06**2 * raised @ np.swapaxes(raised, 1, 2)
    expected = np.sqrt(np.linalg.eigvalsh(spread)[:, 1])

    np.testing.assert_allclose(compute_place_sigma(view, 0, pixel, known), expected, rtol=1e-4)


@pytest.mark.parametrize("lens", ["brown", "fisheye"])
def test_with_rows_read_in_turn_places_and_sigmas_are_those_of_each_row(lens: str) -> None:
    center, rotation = np.array([2.0, -20.0, 30.0]), looking(35, 12, 4)
    motion, readout_s = np.array([6.0, -4.0, 1.0, 0.2, -0.3, 0.1]), 0.05
    view = make_view(
        [center], [rotation], lens=lens, plane=PLANE, pivot=PIVOT, sweep=(readout_s * motion)[None]
    )
    parameters = LENSES[lens]
    pixel = np.random.default_rng(6).uniform([60, 60], [740, 540], (12, 2))

    def place(late_by: float) -> np.ndarray:
        places = []
        for one in pixel:
            late_s = (readout_s + late_by) * (one[1] - 299.5) / 600
            turned = rotation @ Rotation.from_rotvec(late_s * motion[3:]).as_matrix()
            here = center + late_s * motion[:3]
            places.append(meet(lens, here, turned, parameters, np.array(PLANE), one[None])[0])
        return np.array(places)

    true = place(0.0)
    up = PLANE[0] + (true - PIVOT) @ np.array(PLANE[1:])
    seen, _ = view.look(0, np.column_stack([true, up]))
    np.testing.assert_allclose(seen, pixel, atol=1e-2)

    count = 10 + len(parameters)
    covariance = np.zeros((1, count, count))
    covariance[0, -1, -1] = 0.004**2  # the readout time alone is uncertain
    known = FrameCovariance(covariance, 0.0, 0.0, motion[None])
    expected = 0.004 * np.linalg.norm(place(1e-4) - place(-1e-4), axis=1) / 2e-4
    np.testing.assert_allclose(compute_place_sigma(view, 0, pixel, known), expected, rtol=1e-4)


def test_sigma_is_none_where_a_pixel_meets_no_ground() -> None:
    view = make_view([[0, 0, 30.0]], [looking(80)])
    known = FrameCovariance(np.eye(18)[None] * 1e-6, 1.0, 0.0)

    sigma = compute_place_sigma(view, 0, np.array([[400.0, 10.0], [400.0, 590.0]]), known)

    assert np.isnan(sigma[0])
    assert np.isfinite(sigma[1])
