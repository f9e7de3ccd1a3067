"""The table of drone cameras that comes with the program (droneModels.json, DroneModels project).

Copyright 2025 Theta Informatics LLC, Apache License 2.0; see the folder `drone_cameras`.
"""

from __future__ import annotations

import json
import math
from functools import cache
from importlib.resources import files
from typing import Any

import numpy as np

from uavgram.model.camera.tags import DroneCamera

_DISTORTION = ("radialR1", "radialR2", "tangentialT1", "tangentialT2", "radialR3")


@cache
def drone_cameras() -> tuple[DroneCamera, ...]:
    """Read every camera of the table."""
    text = files("uavgram.io.cameras").joinpath("drone_cameras/droneModels.json").read_text("utf-8")
    return tuple(_camera(entry) for entry in json.loads(text)["droneCCDParams"])


def _camera(entry: dict[str, Any]) -> DroneCamera:
    pitch = tuple(_quotient(entry[f"ccd{side}MMPerPixel"]) for side in ("Width", "Height"))
    return DroneCamera(
        make_model=entry["makeModel"],
        comment=entry["comment"].split(",")[0],
        is_thermal=entry["isThermal"],
        width_px=entry["widthPixels"],
        height_px=entry["heightPixels"],
        pitch_mm=(pitch[0], pitch[1]),
        focal_mm=float(entry.get("focalLength", math.nan)),
        is_perspective=entry["lensType"] == "perspective",
        distortion=np.array([entry.get(key, 0.0) for key in _DISTORTION]),
    )


def _quotient(text: str) -> float:
    """``6.32692/4000.0``: millimetres over pixels; some carry Java's suffix, ``7.68d``."""
    over, _, under = text.partition("/")
    return float(over.rstrip("d")) / float(under.rstrip("d"))
