"""OpenDroneMap's cameras.json: one point by OpenSfM's own formulas, written out."""

import json
import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from uavgram.errors import InputError
from uavgram.geometry.camera.projection import project
from uavgram.io.cameras.odm import is_odm_cameras, read_odm_camera

Write = Callable[[object], Path]

X, Y, Z = 0.31, -0.22, 1.1
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
def write(tmp_path: Path) -> Write:
    def _write(content: object) -> Path:
        path = tmp_path / "cameras.json"
        path.write_text(content if isinstance(content, str) else json.dumps(content, indent=1))
        return path

    return _write


@pytest.mark.parametrize("size", [LANDSCAPE, PORTRAIT])
@pytest.mark.parametrize("kind", CAMERAS)
def test_a_point_lands_where_opensfm_puts_it(
    write: Write, kind: str, size: tuple[int, int]
) -> None:
    path = write({"v2 dji fc300x": entry(kind, size)})
    camera, messages = read_odm_camera(path)
    pixel = project(camera.model, camera.parameters, np.array([X, Y, Z]))

    np.testing.assert_allclose(pixel, opensfm_pixel(kind, CAMERAS[kind], *size), atol=1e-9)
    assert is_odm_cameras(path.read_text())
    assert (camera.name, camera.width_px, camera.height_px) == ("v2 dji fc300x", *size)
    assert [m.code for m in messages] == ["camera-sigma-assumed"]


def test_one_of_several_cameras_has_to_be_chosen(write: Write) -> None:
    path = write({"wide": entry("brown"), "tele": entry("perspective")})

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
def test_a_mistake_is_told(write: Write, content: object, words: str) -> None:
    with pytest.raises(InputError, match=words):
        read_odm_camera(write(content))


def test_a_missing_file_is_told(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="cannot be read"):
        read_odm_camera(tmp_path / "none.json")
