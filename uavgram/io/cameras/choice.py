"""Choice of one camera in another program's file, and the table of drone cameras.

Copyright 2025 Theta Informatics LLC, Apache License 2.0; see the folder `read_drone_cameras`.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from functools import cache
from importlib.resources import files
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from uavgram.errors import InputError, near_miss
from uavgram.model.camera.calibration import (
    CALIBRATION_FILE,
    Calibration,
    LensModel,
    assumed_covariance,
)
from uavgram.model.camera.tags import DroneCamera
from uavgram.model.message import Message

Entry = TypeVar("Entry")


def choose_camera(
    path: Path, cameras: Mapping[str, Entry], wanted: str | None
) -> tuple[str, Entry]:
    """Choose the named camera, or the only one.

    Parameters
    ----------
    path
        File that holds them, for messages.
    cameras
        Entries of the file by camera name.
    wanted
        Name of the camera to choose; None where there is only one.

    Raises
    ------
    InputError
        There are none, or several and none was named, or none of that name.
    """
    names = ", ".join(map(repr, cameras))
    if not cameras:
        raise InputError(path, "holds no camera")
    if wanted is None and len(cameras) == 1:
        return next(iter(cameras.items()))
    if wanted is None:
        first = next(iter(cameras))
        raise InputError(
            path,
            f"holds {len(cameras)} cameras ({names}): make a file of the one you mean, with "
            f"uavgram camera {path.name} --camera {first!r} --to uavgram --output camera.yaml",
        )
    if wanted not in cameras:
        hint = near_miss(wanted, cameras)
        raise InputError(
            path, f"holds no camera {wanted!r}, but {names}" + (f" ({hint})" if hint else "")
        )
    return wanted, cameras[wanted]


def assume_errors(
    path: Path,
    *,
    name: str,
    model: LensModel,
    size_px: tuple[int, int],
    parameters: Sequence[float],
) -> tuple[Calibration, tuple[Message, ...]]:
    """Make a calibration from a file without sigmas: assume wide ones, and add a message.

    Parameters
    ----------
    path
        The file, for messages.
    name
        Name of the camera.
    model
        Lens model, which defines the parameters.
    size_px
        Width and height of the photos.
    parameters
        (P,) fx, fy, cx, cy [px], then the distortion's coefficients.

    Raises
    ------
    InputError
        A number of the file is impossible for a camera.
    """
    if not all(map(math.isfinite, parameters)):
        raise InputError(path, f"camera {name!r}: holds a value that is not finite")
    if min(parameters[:2]) <= 0 or min(size_px) <= 0:
        raise InputError(path, f"camera {name!r}: focal length and size must be greater than 0")
    calibration = Calibration(
        name=name,
        model=model,
        width_px=size_px[0],
        height_px=size_px[1],
        parameters=np.array(parameters),
        covariance=assumed_covariance(model, np.array(parameters), size_px[0], CALIBRATION_FILE),
    )
    return calibration, (create_assumed_errors_message(path),)


def create_assumed_errors_message(path: Path) -> Message:
    """Create the message that a file states no sigmas, with the assumed ones."""
    text = (
        f"{path.name} states no errors of the calibration, so wide ones are assumed: "
        f"{100 * CALIBRATION_FILE.focal:g} % of the focal length, "
        f"{100 * CALIBRATION_FILE.centre:g} % of the width for the principal point. Write a "
        "camera.yaml with 'sigma' if you know better."
    )
    return Message("warning", "camera-sigma-assumed", text)


_DISTORTION = ("radialR1", "radialR2", "tangentialT1", "tangentialT2", "radialR3")


@cache
def read_drone_cameras() -> tuple[DroneCamera, ...]:
    """Read all cameras of the table."""
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
    """Parse ``6.32692/4000.0``, millimetres over pixels; some have Java's suffix, ``7.68d``."""
    over, _, under = text.partition("/")
    return float(over.rstrip("d")) / float(under.rstrip("d"))
