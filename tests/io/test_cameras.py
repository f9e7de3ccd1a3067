"""OpenCV's calibration files: its own data, files that it writes here, and broken ones."""

from __future__ import annotations

import dataclasses
import json
import math
from collections.abc import Callable, Sequence
from importlib.resources import files
from pathlib import Path
from typing import Any, Protocol

import cv2
import numpy as np
import pytest

from uavgram.errors import InputError
from uavgram.geometry.camera.projection import project
from uavgram.io.cameras import (
    colmap_text,
    is_colmap_cameras,
    is_odm_cameras,
    is_opencv_calibration,
    opencv_text,
    read_colmap_camera,
    read_drone_cameras,
    read_odm_camera,
    read_opencv_calibration,
)
from uavgram.model.arrays import Floats
from uavgram.model.camera import Calibration, LensModel


class Write(Protocol):
    """What `write` gives; `more` are further keys of the file."""

    def __call__(
        self,
        name: str = ...,
        matrix: Floats = ...,
        distortion: Floats = ...,
        size: tuple[int, int] | None = ...,
        **more: float | str | Floats,
    ) -> Path: ...


K = np.array([[1500.0, 0, 960], [0, 1510, 540], [0, 0, 1]])
D = np.array([[0.1, -0.2, 0.001, -0.002, 0.05]])


@pytest.fixture
def write(tmp_path: Path) -> Write:
    """Write a calibration by cv2.FileStorage itself."""

    def _write(
        name: str = "camera.yml",
        matrix: Floats = K,
        distortion: Floats = D,
        size: tuple[int, int] | None = (1920, 1080),
        **more: float | str | Floats,
    ) -> Path:
        path = tmp_path / name
        storage = cv2.FileStorage(str(path), cv2.FileStorage_WRITE)
        if size:
            storage.write("image_width", size[0])
            storage.write("image_height", size[1])
        storage.write("camera_matrix", matrix)
        storage.write("distortion_coefficients", distortion)
        for key, value in more.items():
            storage.write(key, value)
        storage.release()
        return path

    return _write


@pytest.mark.parametrize("name", ["camera.yml", "camera.yaml", "camera.json", "camera.xml"])
def test_what_opencv_writes_is_read_in_each_of_its_formats(write: Write, name: str) -> None:
    sigma = np.arange(1.0, 19.0)[:, None]
    path = write(name, std_deviation_intrinsics=sigma)

    camera, messages = read_opencv_calibration(path)

    assert is_opencv_calibration(path)
    assert (camera.model, camera.width_px, camera.height_px) == ("brown", 1920, 1080)
    np.testing.assert_array_equal(camera.parameters, [1500, 1510, 960, 540, *D.ravel()])
    np.testing.assert_array_equal(camera.covariance, np.diag(np.arange(1.0, 10.0) ** 2))
    assert [m.code for m in messages] == ["camera-sigma-from-file"]


def test_without_errors_wide_ones_are_assumed_and_said(write: Write) -> None:
    camera, messages = read_opencv_calibration(write())
    sigma = np.sqrt(np.diag(camera.covariance))

    np.testing.assert_allclose(sigma[:4], [15.0, 15.1, 9.6, 9.6])
    assert (sigma[4:] > 0).all()
    assert [(m.level, m.code) for m in messages] == [("warning", "camera-sigma-assumed")]


def test_the_order_of_the_coefficients_is_that_of_project_points(write: Write) -> None:
    camera, _ = read_opencv_calibration(write())
    fx, fy, cx, cy = camera.parameters[:4]
    point = np.array([[0.3, -0.2, 1.0]])
    matrix = np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1]])

    expected, _ = cv2.projectPoints(point, np.zeros(3), np.zeros(3), K, D)
    found, _ = cv2.projectPoints(point, np.zeros(3), np.zeros(3), matrix, camera.parameters[4:])
    np.testing.assert_array_equal(found, expected)


def test_four_coefficients_leave_k3_at_zero(write: Write) -> None:
    camera, _ = read_opencv_calibration(write(distortion=D[:, :4]))

    assert camera.parameters[8] == 0.0


@pytest.mark.parametrize("flag", [{"fisheye_model": 1}, {"distortion_model": "equidistant"}])
def test_a_fisheye_calibration_is_recognised_by_its_flag(
    write: Write, flag: dict[str, Any]
) -> None:
    camera, _ = read_opencv_calibration(write(distortion=D[:, :4], **flag))

    assert camera.model == "fisheye"
    np.testing.assert_array_equal(camera.parameters[4:], D[0, :4])
    assert camera.covariance.shape == (8, 8)


def test_a_fixed_aspect_ratio_ties_fx_to_fy(write: Write) -> None:
    sigma = np.array([0, 3.0, 1, 1, 1, 1, 1, 1, 1])  # as calibrateCameraExtended gives them
    camera, _ = read_opencv_calibration(write(std_deviation_intrinsics=sigma, flags=2))
    ratio = 1500 / 1510

    np.testing.assert_allclose(camera.covariance[0, :2], [9 * ratio**2, 9 * ratio])


def test_interactive_calibration_writes_its_sigmas_in_two_pieces(write: Write) -> None:
    camera, messages = read_opencv_calibration(
        write(
            size=None,
            cameraResolution=np.array([1920, 1080]),
            camera_matrix_std_dev=np.arange(1.0, 5.0),
            distortion_coefficients_std_dev=np.arange(5.0, 10.0),
        )
    )

    assert messages[0].code == "camera-sigma-from-file"
    np.testing.assert_array_equal(np.sqrt(np.diag(camera.covariance)), np.arange(1.0, 10.0))


def test_a_ros_camera_info_file_has_no_yaml_header(tmp_path: Path) -> None:
    path = tmp_path / "ost.yaml"
    path.write_text(
        "image_width: 640\nimage_height: 480\ncamera_name: head\ncamera_matrix:\n  rows: 3\n"
        "  cols: 3\n  data: [500.0, 0.0, 320.0, 0.0, 501.0, 240.0, 0.0, 0.0, 1.0]\n"
        "distortion_model: plumb_bob\ndistortion_coefficients:\n  rows: 1\n  cols: 5\n"
        "  data: [0.1, 0.2, 0.0, 0.0, 0.0]\n"
    )
    camera, _ = read_opencv_calibration(path)

    assert is_opencv_calibration(path)
    assert (camera.name, camera.width_px) == ("head", 640)
    np.testing.assert_array_equal(camera.parameters[:5], [500, 501, 320, 240, 0.1])


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"size": None}, "states no image size"),
        ({"size": (0, 480)}, "must be whole pixels"),
        ({"matrix": K[:2]}, "must be 3 x 3"),
        ({"matrix": K + 5 * np.eye(3, k=1)}, "without skew"),
        ({"matrix": -K}, "must be positive"),
        ({"matrix": np.full((3, 3), np.nan)}, "not finite"),
        ({"distortion": np.ones((1, 12))}, "the brown model has 5 or 8"),
        ({"distortion": np.ones((1, 3))}, "the brown model has 5"),
        ({"fisheye_model": 1}, "the fisheye model has 4"),
        ({"std_deviation_intrinsics": np.ones(4)}, "must be 9 numbers"),
        ({"std_deviation_intrinsics": -np.ones(9)}, "none negative"),
    ],
)
def test_a_calibration_that_cannot_be_used_is_refused(
    write: Write, change: dict[str, Any], words: str
) -> None:
    with pytest.raises(InputError, match=words):
        read_opencv_calibration(write(**change))


def test_zero_coefficients_of_a_larger_model_do_no_harm(write: Write) -> None:
    distortion = np.zeros((1, 14))
    distortion[:, :5] = D

    np.testing.assert_array_equal(
        read_opencv_calibration(write(distortion=distortion))[0].parameters[4:], D[0]
    )


@pytest.mark.parametrize(
    ("name", "content", "words"),
    [
        ("a.yml", "%YAML:1.0\n---\ncamera_matrix: [1, 2\n", "cannot be read as a calibration"),
        ("a.xml", '<?xml version="1.0"?>\n<opencv_storage><a>1</a>', "cannot be read as"),
        ("a.json", '{"camera_matrix": 1', "cannot be read as"),
        ("a.yml", "%YAML:1.0\n---\nM1: [1, 2]\nM2: [1, 2]\n", "two cameras"),
        ("a.yml", "%YAML:1.0\n---\nimage_width: 3\n", "holds no camera_matrix"),
        ("a.yml", "%YAML:1.0\n---\ncamera_matrix: abc\n", "no matrix of numbers"),
    ],
)
def test_a_broken_file_is_an_input_error(
    tmp_path: Path, name: str, content: str, words: str
) -> None:
    path = tmp_path / name
    path.write_text(content)

    assert is_opencv_calibration(path)
    with pytest.raises(InputError, match=words):
        read_opencv_calibration(path)


def test_a_missing_file_is_left_to_its_reader(tmp_path: Path) -> None:
    assert not is_opencv_calibration(tmp_path / "absent.yml")
    with pytest.raises(InputError, match="No such file"):
        read_opencv_calibration(tmp_path / "absent.yml")


def test_the_real_files_of_opencv_and_canberrauav_load(data_dir: Path) -> None:
    left, messages = read_opencv_calibration(data_dir / "opencv_chess" / "left_intrinsics.yml")
    cuav, _ = read_opencv_calibration(data_dir / "cuav" / "opencv_calibration.json")

    assert messages[0].code == "camera-sigma-assumed"
    assert (left.width_px, left.height_px) == (640, 480)
    np.testing.assert_allclose(left.parameters[[0, 3, 8]], [535.91573396, 235.5708291, 0.23839153])
    assert (cuav.width_px, cuav.height_px) == (1640, 1232)
    np.testing.assert_allclose(cuav.parameters[[1, 4, 8]], [1329.3364713, 0.16641467, -0.60795875])


MANY = 50_000
YAML = "%YAML:1.0\n---\n"
XML = '<?xml version="1.0"?>\n<opencv_storage>\n'
NESTED = {
    "json lists": '{"camera_matrix":' + "[" * MANY,
    "json objects": '{"camera_matrix":' * MANY,
    "json, closed in comments": '{"camera_matrix":' + "[/*]*/" * MANY,
    "json, closed in quotes": '{"camera_matrix":' + '["]",' * MANY,
    "xml tags": XML + "<camera_matrix>" * MANY,
    "xml tags, closed in comments": XML + "<camera_matrix><!-- </camera_matrix> -->\n" * MANY,
    "yaml lists": f"{YAML}camera_matrix: " + "[" * MANY,
    "yaml lists, closed in comments": f"{YAML}camera_matrix: " + "[ # ]\n" * MANY,
    "yaml lists behind an apostrophe": f"{YAML}a: it's ]\ncamera_matrix: " + "['['," * MANY,
    "yaml items in one line": f"{YAML}camera_matrix:\n   " + "- " * MANY + "1\n",
    "yaml dashes": f"{YAML}camera_matrix:\n   " + "-" * MANY + " x\n",
    "yaml keys in one line": f"{YAML}camera_matrix: " + "x: " * MANY + "1\n",
    "yaml keys without spaces": YAML + "k:" * MANY + "x\n",
    "yaml without its header": "k: " + "[" * MANY,
}


@pytest.mark.parametrize("text", NESTED.values(), ids=NESTED)
def test_what_is_nested_without_end_is_refused_before_opencv_ends_the_program(
    tmp_path: Path, text: str
) -> None:
    path = tmp_path / "camera.yml"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(InputError, match=r"camera\.yml:\d+: has more than 50 levels of brackets"):
        read_opencv_calibration(path)


@pytest.mark.parametrize("comment", ["# " + "[" * 200 + "\n", "  # k: " + "- " * 200 + "\n"])
def test_brackets_in_a_comment_are_no_nesting(tmp_path: Path, comment: str) -> None:
    path = tmp_path / "camera.yml"
    path.write_text(f"{YAML}{comment}k: 1\n", encoding="utf-8")
    with pytest.raises(InputError) as caught:  # the next finding: it holds no camera
        read_opencv_calibration(path)
    assert "levels" not in str(caught.value)


def test_lists_in_a_block_after_a_comment_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "camera.yml"
    path.write_text(f"{YAML}# [\rcamera_matrix: " + "[" * 1500, encoding="utf-8")
    with pytest.raises(InputError, match="more than 50 levels"):
        read_opencv_calibration(path)


def test_yaml_nested_by_its_indents_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "camera.yml"
    levels = "".join(" " * k + "k:\n" for k in range(1500))
    path.write_text(YAML + levels, encoding="utf-8")
    with pytest.raises(InputError, match="more than 50 levels"):
        read_opencv_calibration(path)


@pytest.mark.parametrize("name", ["camera.yml", "camera.json", "camera.xml"])
def test_many_lists_beside_each_other_and_brackets_in_names_are_no_nesting(
    write: Write, name: str
) -> None:
    more: dict[str, Any] = {f"rotation_{k}": np.eye(3) for k in range(300)}
    more |= {f"photo_{k}": f"IMG [{k}] of 2025-03-09" for k in range(100)}
    camera, _ = read_opencv_calibration(write(name, **more))
    assert camera.width_px == 1920


# OpenCV's calibration file as this program writes it: read by OpenCV, and back to the bit.


class WriteCalibration(Protocol):
    def __call__(self, calibration: Calibration, old: str = ..., new: str = ...) -> Path: ...


VALUES = [2300.1, 2305.7, 2005, 1490, -0.05, 0.02, 1e-3, -5e-4, 0.01, 0.1, 0.02, 0.03]
CASES = [(9, "brown"), (12, "brown"), (8, "fisheye")]


def camera(count: int, model: LensModel, name: str = "c") -> Calibration:
    rng = np.random.default_rng(count)
    root = rng.normal(size=(count, count)) * np.array([5, 5, 8, 8, *[1e-3] * 8])[:count, None]
    covariance = root @ root.T
    return Calibration(
        name=name,
        model=model,
        width_px=4000,
        height_px=3000,
        parameters=np.array(VALUES[:count]),
        covariance=(covariance + covariance.T) / 2,
    )


@pytest.fixture
def write_calibration(tmp_path: Path) -> WriteCalibration:
    def _write(calibration: Calibration, old: str = "", new: str = "") -> Path:
        path = tmp_path / "calibration.yml"
        text = opencv_text(calibration, "2026-01-05T10:00:00+00:00")
        path.write_text(text.replace(old, new) if old else text, encoding="utf-8")
        return path

    return _write


@pytest.mark.parametrize(("count", "model"), CASES)
def test_every_digit_comes_back(
    write_calibration: WriteCalibration, count: int, model: LensModel
) -> None:
    written = camera(count, model, name='a "b": é')
    path = write_calibration(written)
    read, messages = read_opencv_calibration(path)

    assert is_opencv_calibration(path)
    np.testing.assert_array_equal(read.parameters, written.parameters)
    np.testing.assert_array_equal(read.covariance, written.covariance)
    assert (read.name, read.model, read.width_px, read.height_px) == ('a "b": é', model, 4000, 3000)
    assert [m.code for m in messages] == ["camera-sigma-from-file"]


@pytest.mark.parametrize(("count", "model"), CASES)
def test_opencv_projects_with_the_file_as_this_program_does(
    write_calibration: WriteCalibration, count: int, model: LensModel
) -> None:
    written = camera(count, model)
    points = np.random.default_rng(0).uniform([-0.5, -0.4, 1], [0.5, 0.4, 2], (30, 1, 3))
    storage = cv2.FileStorage(str(write_calibration(written)), cv2.FILE_STORAGE_READ)
    matrix = storage.getNode("camera_matrix").mat()
    distortion = storage.getNode("distortion_coefficients").mat()
    none = np.zeros(3)
    if model == "fisheye":
        pixel, _ = cv2.fisheye.projectPoints(points, none, none, matrix, distortion)
    else:
        pixel, _ = cv2.projectPoints(points, none, none, matrix, distortion)

    np.testing.assert_allclose(
        pixel[:, 0], project(model, written.parameters, points[:, 0]), atol=1e-9
    )
    np.testing.assert_array_equal(
        storage.getNode("std_deviation_intrinsics").mat()[:, 0],
        np.sqrt(np.diag(written.covariance)),
    )


def test_without_the_covariance_its_sigmas_serve(write_calibration: WriteCalibration) -> None:
    written = camera(9, "brown")
    read, _ = read_opencv_calibration(
        write_calibration(written, "intrinsics_covariance", "someone_elses_key")
    )

    np.testing.assert_allclose(read.covariance, np.diag(np.diag(written.covariance)))


def test_a_covariance_of_another_size_is_refused(tmp_path: Path) -> None:
    nine, eight = (opencv_text(camera(*case), "now") for case in ((9, "brown"), (8, "fisheye")))
    key = "intrinsics_covariance"
    path = tmp_path / "calibration.yml"
    path.write_text(nine[: nine.index(key)] + eight[eight.index(key) :], encoding="utf-8")

    with pytest.raises(InputError, match=r"must be 9 x 9 \(got 64 numbers\)"):
        read_opencv_calibration(path)


@pytest.mark.parametrize(
    ("element", "factor"), [((0, 1), -1.0), (([0, 1], [1, 0]), 50.0)], ids=["lopsided", "too much"]
)
def test_a_matrix_that_is_no_covariance_is_refused(
    write_calibration: WriteCalibration,
    element: tuple[int | list[int], int | list[int]],
    factor: float,
) -> None:
    good = camera(9, "brown")
    bad = good.covariance.copy()
    bad[element] *= factor

    with pytest.raises(InputError, match="is no covariance"):
        read_opencv_calibration(write_calibration(dataclasses.replace(good, covariance=bad)))


# COLMAP's cameras.txt: one point by COLMAP's own formulas, written out.


class WriteColmap(Protocol):
    def __call__(self, *lines: str, name: str = ...) -> Path: ...


X, Y, Z = 0.31, -0.22, 1.1
U, V = X / Z, Y / Z
R2 = U * U + V * V
HEAD = "# Camera list\n#   CAMERA_ID, MODEL, WIDTH, HEIGHT, PARAMS[]\n"


def colmap_pixel(model: str, p: Sequence[float]) -> tuple[float, float]:
    """src/colmap/sensor/models.h: the corner of the top-left pixel is (0, 0)."""
    if model in {"SIMPLE_PINHOLE", "SIMPLE_RADIAL", "RADIAL"}:
        f, cx, cy, *k = p
        k1, k2 = [*k, 0, 0][:2]
        radial = k1 * R2 + k2 * R2 * R2
        return f * (U + U * radial) + cx, f * (V + V * radial) + cy
    if model == "PINHOLE":
        fx, fy, cx, cy = p
        return fx * U + cx, fy * V + cy
    if model in {"OPENCV", "FULL_OPENCV"}:
        fx, fy, cx, cy, k1, k2, p1, p2, *rest = p
        k3, k4, k5, k6 = rest or (0, 0, 0, 0)
        radial = (1 + k1 * R2 + k2 * R2**2 + k3 * R2**3) / (1 + k4 * R2 + k5 * R2**2 + k6 * R2**3)
        u = U * radial + 2 * p1 * U * V + p2 * (R2 + 2 * U * U)
        v = V * radial + 2 * p2 * U * V + p1 * (R2 + 2 * V * V)
        return fx * u + cx, fy * v + cy
    if model == "OPENCV_FISHEYE":
        fx, fy, cx, cy, *k = p
    else:
        fx, cx, cy, *k = p
        fy = fx
    k1, k2, k3, k4 = [*k, 0, 0, 0][:4]
    r = math.sqrt(R2)
    t = math.atan(r)
    scale = t * (1 + k1 * t**2 + k2 * t**4 + k3 * t**6 + k4 * t**8) / r
    return fx * U * scale + cx, fy * V * scale + cy


MODELS = {
    "SIMPLE_PINHOLE": [2300.0, 2000, 1500],
    "PINHOLE": [2300.0, 2310, 2000, 1500],
    "SIMPLE_RADIAL": [2300.0, 2000, 1500, -0.05],
    "RADIAL": [2300.0, 2000, 1500, -0.05, 0.02],
    "OPENCV": [2300.0, 2310, 2000, 1500, -0.05, 0.02, 1e-3, -5e-4],
    "FULL_OPENCV": [2300.0, 2310, 2000, 1500, -0.05, 0.02, 1e-3, -5e-4, 0.01, 0.1, 0.02, 0.03],
    "SIMPLE_RADIAL_FISHEYE": [1200.0, 2000, 1500, 0.02],
    "RADIAL_FISHEYE": [1200.0, 2000, 1500, 0.02, -0.01],
    "OPENCV_FISHEYE": [1200.0, 1210, 2000, 1500, 0.02, -0.01, 3e-3, -1e-3],
}


@pytest.fixture
def write_colmap(tmp_path: Path) -> WriteColmap:
    def _write(*lines: str, name: str = "cameras.txt") -> Path:
        path = tmp_path / name
        path.write_text(HEAD + "\n".join(lines) + "\n")
        return path

    return _write


def line(model: str, number: int = 1, values: Sequence[float] | None = None) -> str:
    return f"{number} {model} 4000 3000 {' '.join(map(repr, values or MODELS[model]))}"


@pytest.mark.parametrize("model", MODELS)
def test_a_point_lands_where_colmap_puts_it_half_a_pixel_aside(
    write_colmap: WriteColmap, model: str
) -> None:
    path = write_colmap(line(model))
    camera, messages = read_colmap_camera(path)
    pixel = project(camera.model, camera.parameters, np.array([X, Y, Z]))

    np.testing.assert_allclose(pixel + 0.5, colmap_pixel(model, MODELS[model]), atol=1e-9)
    assert is_colmap_cameras(path.read_text())
    assert (camera.width_px, camera.height_px) == (4000, 3000)
    assert [m.code for m in messages] == ["camera-sigma-assumed"]


@pytest.mark.parametrize("model", ["OPENCV", "FULL_OPENCV", "OPENCV_FISHEYE"])
def test_what_is_written_is_read_back(
    write_colmap: WriteColmap, tmp_path: Path, model: str
) -> None:
    camera, _ = read_colmap_camera(write_colmap(line(model)))
    path = tmp_path / "again.txt"
    path.write_text(colmap_text(camera))
    again, _ = read_colmap_camera(path)

    np.testing.assert_allclose(again.parameters, camera.parameters, rtol=1e-15)
    np.testing.assert_array_equal(again.parameters[4:], camera.parameters[4:])
    assert path.read_text().splitlines()[-1].split()[1] == model


def test_a_third_radial_coefficient_takes_the_full_model(tmp_path: Path) -> None:
    parameters = np.array([2300.0, 2310, 1999.5, 1499.5, -0.05, 0.02, 1e-3, -5e-4, 0.01])
    camera = Calibration(
        name="c",
        model="brown",
        width_px=4000,
        height_px=3000,
        parameters=parameters,
        covariance=np.eye(9),
    )
    path = tmp_path / "cameras.txt"
    path.write_text(colmap_text(camera))
    _, model, _, _, *fields = path.read_text().splitlines()[-1].split()
    values = [float(field) for field in fields]

    assert model == "FULL_OPENCV"
    np.testing.assert_allclose(
        np.array(colmap_pixel(model, values)) - 0.5,
        project("brown", parameters, np.array([X, Y, Z])),
        atol=1e-9,
    )


def test_one_of_several_cameras_has_to_be_chosen(write_colmap: WriteColmap) -> None:
    path = write_colmap(line("PINHOLE", 1), line("OPENCV", 7))

    with pytest.raises(InputError, match=r"holds 2 cameras \('1', '7'\).*--camera '1'"):
        read_colmap_camera(path)
    assert read_colmap_camera(path, "7")[0].parameters[4] == -0.05
    with pytest.raises(InputError, match="holds no camera '3', but '1', '7'"):
        read_colmap_camera(path, "3")


@pytest.mark.parametrize(
    ("content", "words"),
    [
        ("1 FOV 4000 3000 2300 2300 2000 1500 0.9", ":3: camera 1 has the model FOV"),
        ("1 OPENCV 4000 3000 2300 2300 2000 1500", ":3: camera 1: OPENCV has 8 parameters"),
        ("1 PINHOLE 4000 3000 2300 x 2000 1500", ":3: camera 1: could not convert"),
        ("1 PINHOLE 4000 3000 -1 2300 2000 1500", "greater than 0"),
        ("1 PINHOLE 4000 3000 nan 2300 2000 1500", "not finite"),
        ("1 PINHOLE 4000", ":3: must be CAMERA_ID"),
        ("", "holds no camera"),
    ],
)
def test_a_mistake_is_told(write_colmap: WriteColmap, content: str, words: str) -> None:
    with pytest.raises(InputError, match=words):
        read_colmap_camera(write_colmap(content))


def test_other_text_is_no_camera_list() -> None:
    assert not is_colmap_cameras("name: c\nmodel: brown\nwidth_px: 4000\n")
    assert not is_colmap_cameras("")


# OpenDroneMap's cameras.json: one point by OpenSfM's own formulas, written out.


WriteOdm = Callable[[object], Path]

LANDSCAPE, PORTRAIT = (4000, 2250), (2250, 4000)
CAMERAS = {
    "perspective": {"focal": 0.6, "k1": -0.05, "k2": 0.02},
    "simple_radial": {"focal_x": 0.6, "focal_y": 0.61, "c_x": 0.01, "c_y": -0.02, "k1": -0.05},
    "radial": {"focal_x": 0.6, "focal_y": 0.61, "c_x": 0.01, "c_y": 0.0, "k1": -0.05, "k2": 0.02},
    "brown": {
        "focal_x": 0.6,
        "focal_y": 0.61,
        "c_x": 0.01,
        "c_y": -0.02,
        "k1": -0.05,
        "k2": 0.02,
        "p1": 1e-3,
        "p2": -5e-4,
        "k3": 0.01,
    },
    "fisheye": {"focal": 0.3, "k1": 0.02, "k2": -0.01},
    "fisheye_opencv": {
        "focal_x": 0.3,
        "focal_y": 0.31,
        "c_x": 0.01,
        "c_y": -0.02,
        "k1": 0.02,
        "k2": -0.01,
        "k3": 3e-3,
        "k4": -1e-3,
    },
}


def opensfm_pixel(kind: str, c: dict[str, float], width: int, height: int) -> tuple[float, float]:
    """opensfm/src/geometry/camera_projections_functions.h, then denormalized_image_coordinates."""
    x, y = X / Z, Y / Z
    r2 = x * x + y * y
    k1, k2, k3, k4 = (c.get(key, 0.0) for key in ("k1", "k2", "k3", "k4"))
    p1, p2 = c.get("p1", 0.0), c.get("p2", 0.0)
    if kind.startswith("fisheye"):
        t = math.atan2(math.hypot(X, Y), Z)
        d = t * (1 + k1 * t**2 + k2 * t**4 + k3 * t**6 + k4 * t**8) / math.hypot(x, y)
        x, y = x * d, y * d
    else:
        d = 1 + r2 * (k1 + r2 * (k2 + r2 * k3))
        x, y = (
            x * d + 2 * p1 * x * y + p2 * (r2 + 2 * x * x),
            y * d + 2 * p2 * x * y + p1 * (r2 + 2 * y * y),
        )
    fx = c.get("focal_x", c.get("focal", math.nan))
    fy = c.get("focal_y", c.get("focal", math.nan))
    x, y = fx * x + c.get("c_x", 0.0), fy * y + c.get("c_y", 0.0)
    size = max(width, height)
    return x * size - 0.5 + width / 2.0, y * size - 0.5 + height / 2.0


def entry(kind: str, size: tuple[int, int] = LANDSCAPE, **changes: object) -> dict[str, object]:
    sizes = dict(zip(("width", "height"), size, strict=True))
    return {"projection_type": kind, **sizes, **CAMERAS[kind], **changes}


@pytest.fixture
def write_odm(tmp_path: Path) -> WriteOdm:
    def _write(content: object) -> Path:
        path = tmp_path / "cameras.json"
        path.write_text(content if isinstance(content, str) else json.dumps(content, indent=1))
        return path

    return _write


@pytest.mark.parametrize("size", [LANDSCAPE, PORTRAIT])
@pytest.mark.parametrize("kind", CAMERAS)
def test_a_point_lands_where_opensfm_puts_it(
    write_odm: WriteOdm, kind: str, size: tuple[int, int]
) -> None:
    path = write_odm({"v2 dji fc300x": entry(kind, size)})
    camera, messages = read_odm_camera(path)
    pixel = project(camera.model, camera.parameters, np.array([X, Y, Z]))

    np.testing.assert_allclose(pixel, opensfm_pixel(kind, CAMERAS[kind], *size), atol=1e-9)
    assert is_odm_cameras(path.read_text())
    assert (camera.name, camera.width_px, camera.height_px) == ("v2 dji fc300x", *size)
    assert [m.code for m in messages] == ["camera-sigma-assumed"]


def test_one_of_several_opensfm_cameras_has_to_be_chosen(write_odm: WriteOdm) -> None:
    path = write_odm({"wide": entry("brown"), "tele": entry("perspective")})

    with pytest.raises(InputError, match=r"2 cameras \('wide', 'tele'\).*--camera 'wide'"):
        read_odm_camera(path)
    assert read_odm_camera(path, "tele")[0].parameters[0] == 2400
    with pytest.raises(InputError, match="did you mean 'tele'"):
        read_odm_camera(path, "telly")


@pytest.mark.parametrize(
    ("content", "words"),
    [
        ({"c": entry("brown", projection_type="spherical")}, "the projection 'spherical', which"),
        ({"c": entry("brown", focal_x="0.6")}, "focal_x must be a number"),
        ({"c": entry("brown", k2=None)}, "k2 must be a number"),
        ({"c": entry("brown", width=4000.5)}, "whole pixels"),
        ({"c": entry("brown", focal_x=-1)}, "greater than 0"),
        ({"c": entry("brown", k1=float("nan"))}, "k1 is no finite number"),
        ({}, "holds no camera"),
        ([1], "an object of cameras"),
        ('{"c": {\n "projection_type" 1}}', ":2: is no JSON"),
    ],
)
def test_a_mistake_in_opensfms_file_is_told(
    write_odm: WriteOdm, content: object, words: str
) -> None:
    with pytest.raises(InputError, match=words):
        read_odm_camera(write_odm(content))


def test_a_missing_file_is_told(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="cannot be read"):
        read_odm_camera(tmp_path / "none.json")


# The table of drone cameras that comes with the program.


def test_every_camera_of_the_table_is_read() -> None:
    assert len(read_drone_cameras()) == 106


def test_the_pixels_of_every_camera_are_of_a_size_that_sensors_have() -> None:
    pitch_mm = np.array([camera.pitch_mm for camera in read_drone_cameras()])

    assert (pitch_mm > 0.0005).all()
    assert (pitch_mm < 0.05).all()


def test_a_camera_is_what_the_table_says() -> None:
    mavic = next(c for c in read_drone_cameras() if c.make_model == "djiFC220")

    assert (mavic.width_px, mavic.height_px, mavic.is_thermal) == (4000, 3000, False)
    assert mavic.pitch_mm == (6.32692 / 4000, 4.7452 / 3000)
    # in OpenCV's order k1 k2 p1 p2 k3
    np.testing.assert_array_equal(
        mavic.distortion, [0.032984, -0.0855974, 0.000409773, -0.000806846, 0.0777778]
    )


def test_the_table_comes_with_its_licence() -> None:
    folder = files("uavgram.io").joinpath("drone_cameras")

    assert "Apache License" in folder.joinpath("LICENSE").read_text("utf-8")
    assert "Theta Informatics" in folder.joinpath("README.md").read_text("utf-8")
