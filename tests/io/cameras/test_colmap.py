"""COLMAP's cameras.txt: one point by COLMAP's own formulas, written out."""

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Protocol

import numpy as np
import pytest

from uavgram.errors import InputError
from uavgram.geometry.camera.projection import project
from uavgram.io.cameras.colmap import colmap_text, is_colmap_cameras, read_colmap_camera
from uavgram.model.camera.calibration import Calibration


class Write(Protocol):
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
def write(tmp_path: Path) -> Write:
    def _write(*lines: str, name: str = "cameras.txt") -> Path:
        path = tmp_path / name
        path.write_text(HEAD + "\n".join(lines) + "\n")
        return path

    return _write


def line(model: str, number: int = 1, values: Sequence[float] | None = None) -> str:
    return f"{number} {model} 4000 3000 {' '.join(map(repr, values or MODELS[model]))}"


@pytest.mark.parametrize("model", MODELS)
def test_a_point_lands_where_colmap_puts_it_half_a_pixel_aside(write: Write, model: str) -> None:
    path = write(line(model))
    camera, messages = read_colmap_camera(path)
    pixel = project(camera.model, camera.parameters, np.array([X, Y, Z]))

    np.testing.assert_allclose(pixel + 0.5, colmap_pixel(model, MODELS[model]), atol=1e-9)
    assert is_colmap_cameras(path.read_text())
    assert (camera.width_px, camera.height_px) == (4000, 3000)
    assert [m.code for m in messages] == ["camera-sigma-assumed"]


@pytest.mark.parametrize("model", ["OPENCV", "FULL_OPENCV", "OPENCV_FISHEYE"])
def test_what_is_written_is_read_back(write: Write, tmp_path: Path, model: str) -> None:
    camera, _ = read_colmap_camera(write(line(model)))
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


def test_one_of_several_cameras_has_to_be_chosen(write: Write) -> None:
    path = write(line("PINHOLE", 1), line("OPENCV", 7))

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
def test_a_mistake_is_told(write: Write, content: str, words: str) -> None:
    with pytest.raises(InputError, match=words):
        read_colmap_camera(write(content))


def test_other_text_is_no_camera_list() -> None:
    assert not is_colmap_cameras("name: c\nmodel: brown\nwidth_px: 4000\n")
    assert not is_colmap_cameras("")
