"""Projection against OpenCV, its inverse, and every derivative against central differences."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest
import yaml
from derivatives import assert_derivative, central_differences
from hypothesis import given, settings
from hypothesis import strategies as st

from uavgram.geometry.camera.lens import largest_radius
from uavgram.geometry.camera.projection import (
    BeyondFold,
    back_project,
    back_project_with_jacobian,
    project,
    project_with_jacobian,
    share_without_rays,
)
from uavgram.model.arrays import Floats
from uavgram.model.camera import LensModel

PINHOLE = np.array([1000.0, 1010, 640, 480, 0, 0, 0, 0, 0])
# A Raspberry Pi camera V2, half resolution: folds back inside the image (k3 < 0).
FOLDING = np.array(
    [1329.49, 1329.34, 809.95, 618.55, 0.16641, -0.22344, -0.0037763, 0.0024125, -0.60796]
)
CAMERAS: dict[str, tuple[LensModel, Floats, tuple[int, int] | None]] = {
    "pinhole": ("brown", PINHOLE, (1280, 960)),
    "folding": ("brown", FOLDING, (1640, 1232)),
    "barrel": ("brown", np.array([800.0, 790, 650, 470, -0.32, 0.11, 1e-3, -2e-3, -0.02]), None),
    "pincushion": ("brown", np.array([900.0, 905, 630, 490, 0.2, 0.1, -1e-3, 5e-4, 0.05]), None),
    "radial": ("brown", np.array([800.0, 790, 650, 470, -0.2, 0.05, 0, 0, 0.001]), None),
    "decentred": ("brown", np.array([900.0, 905, 630, 490, -0.1, 0.1, 0.02, -0.03, 0.0]), None),
    "rational": (
        "brown",
        np.array([800.0, 790, 650, 470, 0.9, 0.3, 1e-3, -2e-3, 0.02, 1.2, 0.6, 0.07]),
        None,
    ),
    "rational folding": (  # and without tangential terms
        "brown",
        np.array([900.0, 905, 630, 490, 0.1, -0.2, 0, 0, 0.01, 0.2, 0.1, 0.05]),
        None,
    ),
    "rational pole": (  # k4 < 0: to infinity at a radius of 1.4
        "brown",
        np.array([900.0, 905, 630, 490, 0.1, 0, 1e-4, 1e-3, 0, -0.5, 0, 0]),
        None,
    ),
    "equidistant": ("fisheye", np.array([500.0, 505, 640, 480, 0, 0, 0, 0]), None),
    "wide": ("fisheye", np.array([420.0, 425, 640, 480, 0.08, -0.03, 0.01, -0.002]), None),
    "bent": ("fisheye", np.array([900.0, 905, 640, 480, -0.3, 0.02, 0.01, -0.02]), None),
}
every_camera = pytest.mark.parametrize("name", CAMERAS)


def camera(name: str) -> tuple[LensModel, Floats, tuple[int, int]]:
    model, parameters, size = CAMERAS[name]
    return model, parameters, size or (1280, 960)


def points(count: int = 2000, spread: float = 3.0) -> Floats:
    rng = np.random.default_rng(1)
    z = rng.uniform(0.5, 80, (count, 1))
    return np.concatenate([rng.uniform(-spread, spread, (count, 2)) * z, z], axis=1)


def opencv(model: LensModel, parameters: Floats, point: Floats) -> Floats:
    fx, fy, cx, cy = parameters[:4]
    k = np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1]])
    function = cv2.projectPoints if model == "brown" else cv2.fisheye.projectPoints
    pixel = function(point[:, None], np.zeros(3), np.zeros(3), k, parameters[4:])[0][:, 0]
    return np.asarray(pixel, np.float64)


def pixels(size: tuple[int, int], step: int = 7) -> Floats:
    u, v = np.meshgrid(np.arange(0.0, size[0], step), np.arange(0.0, size[1], step))
    return np.stack([u, v], axis=-1)


@every_camera
def test_plain_formula_is_opencvs_to_a_billionth_pixel(name: str) -> None:
    model, parameters, _ = camera(name)
    ours = project(model, parameters, points(), beyond_fold="extend")
    expected = opencv(model, parameters, points())
    # beyond a fold pixels run to 1e6, where 1e-9 is the spacing of the numbers themselves
    np.testing.assert_allclose(ours, expected, rtol=2e-15, atol=1e-9)


@every_camera
def test_inside_the_fold_nothing_is_missing_and_beyond_it_everything(name: str) -> None:
    model, parameters, _ = camera(name)
    point = points()
    ours = project(model, parameters, point)
    radius = np.hypot(*point[:, :2].T) / point[:, 2]
    largest = largest_radius(model, parameters)
    missing = np.asarray(np.isnan(ours).any(axis=1))
    assert missing[radius > largest].all()
    assert not missing[radius < 0.9 * largest].any()
    np.testing.assert_allclose(
        ours[~missing], opencv(model, parameters, point[~missing]), atol=1e-9
    )


def test_random_lenses_agree_with_opencv() -> None:
    rng = np.random.default_rng(2)
    for _ in range(100):
        parameters = np.concatenate(
            [rng.uniform(300, 5000, 4), rng.normal(size=5) * [0.3, 0.3, 0.02, 0.02, 0.3]]
        )
        fisheye = np.concatenate([parameters[:4], rng.normal(size=4) * 0.1])
        point = points(50, 0.9)
        both: tuple[tuple[LensModel, Floats], ...] = (("brown", parameters), ("fisheye", fisheye))
        for model, lens in both:
            ours = project(model, lens, point, beyond_fold="extend")
            np.testing.assert_allclose(ours, opencv(model, lens, point), atol=1e-9)


@every_camera
def test_on_the_axis_and_next_to_it(name: str) -> None:
    model, parameters, _ = camera(name)
    point = np.array([[0, 0, 2.0], [1e-200, 0, 1], [1e-12, -1e-13, 1], [3e-8, 1e-8, 1]])
    pixel, d_point, d_parameters = project_with_jacobian(model, parameters, point)
    np.testing.assert_allclose(pixel, opencv(model, parameters, point), atol=1e-9)
    np.testing.assert_allclose(d_point[0, :, :2], np.diag(parameters[:2]) / 2, rtol=1e-15)
    assert np.isfinite(d_parameters).all()
    np.testing.assert_allclose(d_point[1], d_point[0] * 2, rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize("beyond_fold", ["nan", "extend"])
@every_camera
def test_behind_the_camera_there_is_no_pixel(name: str, beyond_fold: BeyondFold) -> None:
    model, parameters, _ = camera(name)
    point = np.array([[0.1, 0.1, -1], [0.1, 0.1, 0], [0, 0, 0], [np.nan, 0, 1], [0, 0, 1]])
    for answer in project_with_jacobian(model, parameters, point, beyond_fold=beyond_fold):
        missing = np.isnan(answer.reshape(5, -1))
        assert missing[:3].all()
        assert missing[3].any()
        assert not missing[4].any()


@every_camera
def test_forward_derivatives_equal_central_differences(name: str) -> None:
    model, parameters, _ = camera(name)
    spread = min(0.6 * largest_radius(model, parameters), 2.0)
    point = points(300, spread)
    pixel, d_point, d_parameters = project_with_jacobian(
        model, parameters, point, beyond_fold="extend"
    )
    np.testing.assert_array_equal(pixel, project(model, parameters, point, beyond_fold="extend"))

    def forward(x: Floats, p: Floats = parameters) -> Floats:
        return project(model, p, x, beyond_fold="extend")

    direction = point / point[:, 2:]  # derivatives by the point scale with 1 / z
    assert_derivative(
        d_point * point[:, 2, None, None], central_differences(forward, direction, 1e-4)
    )
    numeric = central_differences(lambda p: forward(point, p), parameters, 1e-3)
    assert_derivative(d_parameters, numeric)
    size = np.abs(numeric).max(axis=(0, 1))  # each parameter by its own measure too
    assert (np.abs(d_parameters - numeric) <= 1e-6 * size).all()


@every_camera
def test_nan_marks_the_same_points_in_every_answer(name: str) -> None:
    model, parameters, _ = camera(name)
    pixel, d_point, d_parameters = project_with_jacobian(model, parameters, points())
    np.testing.assert_array_equal(pixel, project(model, parameters, points()))
    bad = np.isnan(pixel[:, 0])
    for answer in (d_point, d_parameters):
        assert np.isnan(answer[bad]).all()
        assert np.isfinite(answer[~bad]).all()


@every_camera
def test_back_projection_is_inverted_by_opencv_over_the_whole_image(name: str) -> None:
    model, parameters, size = camera(name)
    grid = pixels(size)
    ray = back_project(model, parameters, grid)
    found = np.isfinite(ray).all(axis=-1)
    assert np.isnan(ray[~found]).all()
    assert (ray[found][:, 2] == 1).all()
    np.testing.assert_allclose(
        opencv(model, parameters, ray[found]), grid[found], rtol=0, atol=1e-9
    )
    if name not in ("folding", "rational folding", "barrel", "equidistant", "wide", "bent"):
        assert found.all()


@every_camera
def test_what_can_be_seen_can_be_back_projected_onto_itself(name: str) -> None:
    model, parameters, _ = camera(name)
    point = points()
    pixel = project(model, parameters, point)
    seen = np.isfinite(pixel[:, 0])
    expected = (point / point[:, 2:])[seen]
    ray = back_project(model, parameters, pixel[seen])
    d_pixel = back_project_with_jacobian(model, parameters, pixel[seen])[1]
    # one rounding of the pixel, as far as it moves the ray
    slack = 1e-9 * np.abs(d_pixel).max(axis=(1, 2))[:, None] + 1e-12
    assert (np.abs(ray - expected) <= slack).all()


@every_camera
def test_principal_point_is_the_optical_axis_exactly(name: str) -> None:
    model, parameters, _ = camera(name)
    ray, d_pixel, d_parameters = back_project_with_jacobian(model, parameters, parameters[2:4])
    np.testing.assert_array_equal(ray, [0, 0, 1])
    expected = np.zeros((3, 2))
    expected[:2] = np.diag(1 / parameters[:2])
    np.testing.assert_allclose(d_pixel, expected, rtol=1e-14, atol=1e-18)
    np.testing.assert_allclose(d_parameters[:, 2:4], -expected, rtol=1e-14, atol=1e-18)


@every_camera
def test_backward_derivatives_equal_central_differences(name: str) -> None:
    model, parameters, size = camera(name)
    grid = pixels(size, 61)
    ray = back_project(model, parameters, grid)
    radius = np.hypot(ray[..., 0], ray[..., 1])
    # near the fold, and near 90 degrees, no finite difference holds
    grid = grid[radius < min(0.85 * largest_radius(model, parameters), 3.0)]
    assert len(grid) > 200
    ray, d_pixel, d_parameters = back_project_with_jacobian(model, parameters, grid)
    np.testing.assert_array_equal(ray, back_project(model, parameters, grid))
    assert_derivative(
        d_pixel, central_differences(lambda x: back_project(model, parameters, x), grid, 0.1)
    )
    scale = np.array([10.0] * 4 + [0.01] * (len(parameters) - 4))

    def scaled(s: Floats) -> Floats:
        return back_project(model, parameters + s * scale, grid)

    assert_derivative(
        d_parameters * scale, central_differences(scaled, np.zeros(len(parameters)), 0.004)
    )


@pytest.mark.parametrize(
    ("model", "coefficients", "expected"),
    [
        ("brown", [-1 / 3, 0, 0, 0, 0], 1.0),
        ("brown", [-1 / 3, 0, 0.1, 0.1, 0], 1.0),  # tangential terms are left out
        ("brown", [0, -1 / 5, 0, 0, 0], 1.0),
        ("brown", [0, 0, 0, 0, -1 / 7], 1.0),
        ("brown", [1 / 3, 1 / 5, 0, 0, 1 / 7], np.inf),
        ("brown", [0, 0, 0, 0, 0], np.inf),
        ("brown", [-1 / 3, 0, 0.1, 0.1, 0, 0, 0, 0], 1.0),
        ("brown", [0, 0, 0, 0, 0, 1, 0, 0], 1.0),  # t / (1 + t^2)
        (
            "brown",
            [0, 0, 0, 0, 0, -1 / 4, 0, 0],
            0.99 * 2.0,
        ),  # before the pole of t / (1 - t^2 / 4)
        ("brown", [0.3, 0.2, 0, 0, 0.1, 0.3, 0.2, 0.1], np.inf),  # the identity
        ("fisheye", [-1 / 3, 0, 0, 0], np.tan(1.0)),
        ("fisheye", [0, 0, 0, -1 / 9], np.tan(1.0)),
        ("fisheye", [-1 / 12, 0, 0, 0], np.inf),  # at 2 rad, behind the plane of the lens
        ("fisheye", [0, 0, 0, 0], np.inf),
    ],
)
def test_largest_radius_by_hand(
    model: LensModel, coefficients: list[float], expected: float
) -> None:
    parameters = np.array([1000.0, 1000, 500, 500, *coefficients])
    assert largest_radius(model, parameters) == pytest.approx(expected, rel=1e-12)


def test_pixels_outside_the_fold_have_no_ray() -> None:
    parameters = np.array([1000.0, 1000, 0, 0, -1 / 3, 0, 0, 0, 0])
    rim = 1000 * 2 / 3
    ray = back_project("brown", parameters, np.array([[rim - 1e-6, 0], [rim + 1e-6, 0]]))
    assert ray[0, 0] == pytest.approx(1, abs=1e-4)
    assert np.isnan(ray[1]).all()


def test_fisheye_rays_end_at_a_right_angle() -> None:
    parameters = CAMERAS["equidistant"][1]
    rim = 500 * np.pi / 2
    ray, d_pixel, d_parameters = back_project_with_jacobian(
        "fisheye", parameters, np.array([[640 + rim - 1e-3, 480], [640 + rim + 1e-3, 480]])
    )
    assert ray[0, 0] == pytest.approx(1 / np.tan(1e-3 / 500), rel=1e-6)
    for answer in (ray, d_pixel, d_parameters):
        assert np.isfinite(answer[0]).all()
        assert np.isnan(answer[1]).all()


def test_every_invertible_pixel_of_a_folding_lens_with_tangential_terms_is_found() -> None:
    # The image of the fold curve is the border of what the lens can see: a polygon made from a
    # dense set of directions, each followed outwards until its Jacobian turns over.
    largest = largest_radius("brown", FOLDING)
    direction = np.linspace(0, 2 * np.pi, 2000, endpoint=False)
    radius = np.linspace(0, largest, 2000)[1:-1]
    x, y = radius * np.cos(direction)[:, None], radius * np.sin(direction)[:, None]
    point = np.stack([x, y, np.ones_like(x)], axis=-1)
    seen = np.isfinite(project("brown", FOLDING, point)[..., 0])
    last = np.where(seen.all(axis=1), len(radius), np.argmin(seen, axis=1)) - 1
    rim = project("brown", FOLDING, point[np.arange(len(last)), last]).astype(np.float32)
    grid = pixels((1640, 1232), 5)
    depth = np.array(
        [cv2.pointPolygonTest(rim, (u, v), measureDist=True) for u, v in grid.reshape(-1, 2)]
    )
    found = np.isfinite(back_project("brown", FOLDING, grid)[..., 0]).ravel()
    assert found[depth > 0.1].all()
    assert not found[depth < -0.1].any()
    assert (~found).any()


def test_a_real_camera_sees_nothing_in_2_7_percent_of_its_image(data_dir: Path) -> None:
    file = yaml.safe_load((data_dir / "cuav" / "camera.yaml").read_text())
    grid = pixels((file["width_px"], file["height_px"]), 3)
    ray = back_project("brown", np.array(file["parameters"]), grid)
    assert np.isnan(ray[..., 0]).mean() == pytest.approx(0.0271, abs=0.0005)


@pytest.mark.parametrize("model", ["brown", "fisheye"])
def test_what_is_no_pixel_has_no_ray(model: LensModel) -> None:
    parameters = CAMERAS["decentred" if model == "brown" else "wide"][1]
    pixel = np.array([[np.nan, 3], [3, np.inf], [-np.inf, np.nan], [650, 480]])
    ray = back_project(model, parameters, pixel)
    assert np.isnan(ray[:3]).all()
    assert np.isfinite(ray[3]).all()


@every_camera
def test_leading_axes_and_blocks_change_nothing(name: str) -> None:
    model, parameters, size = camera(name)
    many = np.tile(points(300, 0.5), (60, 1))  # more than one block
    whole = project_with_jacobian(model, parameters, many)
    shaped = project_with_jacobian(model, parameters, many.reshape(60, 300, 3))
    for flat, deep in zip(whole, shaped, strict=True):
        np.testing.assert_array_equal(flat.reshape(deep.shape), deep)
        np.testing.assert_array_equal(deep[0], deep[-1])
    one = project(model, parameters, many[7])
    np.testing.assert_array_equal(one, whole[0][7])
    back = back_project_with_jacobian(model, parameters, pixels(size, 20)[:2])
    alone = back_project_with_jacobian(model, parameters, pixels(size, 20)[1, 3])
    for block, single in zip(back, alone, strict=True):
        np.testing.assert_allclose(block[1, 3], single, rtol=1e-12, atol=1e-15)
    assert project(model, parameters, np.empty((0, 3))).shape == (0, 2)
    assert back_project(model, parameters, np.empty((0, 2))).shape == (0, 3)


@settings(max_examples=200)
@given(
    st.sampled_from(["brown", "fisheye"]),
    st.lists(st.floats(-0.3, 0.3), min_size=4, max_size=4),
    st.tuples(st.floats(-0.02, 0.02), st.floats(-0.02, 0.02)),
    st.tuples(st.floats(-1.5, 1.5), st.floats(-1.5, 1.5)),
)
def test_whatever_lens_a_ray_found_projects_to_its_pixel(
    model: LensModel, k: list[float], p: tuple[float, float], direction: tuple[float, float]
) -> None:
    coefficients = [k[0], k[1], *p, k[2]] if model == "brown" else k
    parameters = np.array([1000.0, 1100, 640, 480, *coefficients])
    pixel = project(model, parameters, np.array([*direction, 1.0]))
    ray = back_project(model, parameters, pixel)
    if np.isnan(pixel).any():
        assert np.isnan(ray).all()
    elif np.isfinite(ray).all():  # lost only where the tangential terms fold the rim
        np.testing.assert_allclose(project(model, parameters, ray), pixel, rtol=0, atol=1e-9)
    else:
        radius = np.hypot(*direction)
        assert model == "brown"
        assert radius > 0.8 * largest_radius(model, parameters)


def test_inputs_stay_as_they_were() -> None:
    for model, parameters, _ in map(camera, CAMERAS):
        arrays = parameters.copy(), points(10), pixels((100, 100), 20)
        for array in arrays:
            array.flags.writeable = False
        project_with_jacobian(model, *arrays[:2])
        back_project_with_jacobian(model, arrays[0], arrays[2])


def test_the_rim_of_the_image_without_rays_is_measured() -> None:
    # Of the cuav camera (CanberraUAV's calibration), an independent fill of the fold's border gives
    # 2.69 % of the image; of a lens without distortion nothing is lost.
    parameters = np.array([
        1329.4945879587194, 1329.336471299515, 809.9528740604338, 618.5527699408506,
        0.16641467032409257, -0.2234393189584932, -0.0037763249278537124, 0.0024124935430655313,
        -0.6079587461332615,
    ])  # fmt: skip
    assert share_without_rays("brown", parameters, 1640, 1232) == pytest.approx(0.027, abs=0.002)
    parameters[4:] = 0
    assert share_without_rays("brown", parameters, 1640, 1232) == 0
