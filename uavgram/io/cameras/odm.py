"""Conversion of OpenDroneMap's and OpenSfM's cameras to `Calibration`.

The files are cameras.json and camera_models.json. Lengths are over max(width, height), from the
centre of the image, which is at ((width - 1) / 2, (height - 1) / 2) when pixels are counted from
the centre of the top-left one (OpenSfM, opensfm/features.py, normalized_image_coordinates; the
models: OpenSfM documentation, "Camera Models").
"""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

from uavgram.errors import InputError
from uavgram.input_files import read_text
from uavgram.io.cameras.choice import assume_errors, choose_camera
from uavgram.io.json_text import parse_json
from uavgram.model.camera.calibration import Calibration, LensModel
from uavgram.model.message import Message

_BROWN = ("k1", "k2", "p1", "p2", "k3")
_FISHEYE = ("k1", "k2", "k3", "k4")
# Lens model and coefficients of each of OpenSfM's models.
_MODELS: dict[str, tuple[LensModel, tuple[str, ...]]] = {
    "perspective": ("brown", ("k1", "k2")),
    "simple_radial": ("brown", ("k1",)),
    "radial": ("brown", ("k1", "k2")),
    "brown": ("brown", _BROWN),
    "fisheye": ("fisheye", ("k1", "k2")),
    "fisheye_opencv": ("fisheye", _FISHEYE),
}


def is_odm_cameras(text: str) -> bool:
    """Return whether a text is such a file and not OpenCV's JSON: every camera has a projection."""
    return text.lstrip().startswith("{") and '"projection_type"' in text


def read_odm_camera(
    path: str | Path, wanted: str | None = None
) -> tuple[Calibration, tuple[Message, ...]]:
    """Read one camera of a cameras.json.

    Parameters
    ----------
    path
        The file.
    wanted
        The camera's name there; not needed where there is only one.

    Raises
    ------
    InputError
        Describes a missing or unknown entry, or names the cameras to choose from.
    """
    path = Path(path)
    try:
        cameras = parse_json(path, read_text(path, "name a cameras.json of OpenDroneMap"))
    except json.JSONDecodeError as fault:
        raise InputError(path, f"is no JSON: {fault.msg}", fault.lineno) from fault
    if not isinstance(cameras, dict) or not all(isinstance(c, dict) for c in cameras.values()):
        raise InputError(path, "must be an object of cameras by name")
    name, camera = choose_camera(path, cameras, wanted)
    return assume_errors(path, name=name, **_camera(path, name, camera))


def _camera(path: Path, name: str, camera: dict[str, Any]) -> dict[str, Any]:
    """Parse lens model, size and parameters into this program's convention."""
    kind = camera.get("projection_type")
    if kind not in _MODELS:
        raise InputError(
            path,
            f"camera {name!r} has the projection {kind!r}, which is none of {', '.join(_MODELS)}: "
            "run OpenDroneMap with --camera-lens brown",
        )
    model, coefficients = _MODELS[kind]

    def number(*keys: str, otherwise: float | None = None) -> float:
        value = next((camera[key] for key in keys if key in camera), otherwise)
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise InputError(path, f"camera {name!r}: {keys[0]} must be a number (got {value!r})")
        if not math.isfinite(value):
            raise InputError(path, f"camera {name!r}: {keys[0]} is no finite number")
        return float(value)

    width, height = number("width"), number("height")
    if width % 1 or height % 1:
        raise InputError(path, f"camera {name!r}: its size must be whole pixels")
    # Lengths are in units of the longer side, from the centre of the image.
    size = max(width, height)
    focal = number("focal_x", "focal")
    focal_y = number("focal_y", "focal", otherwise=focal)
    parameters = [
        size * focal,
        size * focal_y,
        (width - 1) / 2 + size * number("c_x", otherwise=0.0),
        (height - 1) / 2 + size * number("c_y", otherwise=0.0),
        *(
            number(key) if key in coefficients else 0.0
            for key in (_BROWN if model == "brown" else _FISHEYE)
        ),
    ]
    return {"model": model, "size_px": (int(width), int(height)), "parameters": parameters}
