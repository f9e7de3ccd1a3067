"""OpenCV's calibration files: its own data, files that it writes here, and broken ones."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Protocol

import cv2
import numpy as np
import pytest

from uavgram.errors import InputError
from uavgram.io.cameras.opencv import is_opencv_calibration, read_opencv_calibration
from uavgram.model.arrays import Floats


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
