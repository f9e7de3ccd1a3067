"""Single estimates of a result as rows of tables: parameters shared by all photos, and noise."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from uavgram.model.result.result import Result
from uavgram.model.result.shared import POSE_NAMES, Estimate

Row = dict[str, object]

_AXES = {
    "boresight_deg": ("x", "y", "z"),
    "lever_arm_m": ("forward", "right", "down"),
    "position_bias_m": ("east", "north", "up"),
}
_PIXELS = ("fx", "fy", "cx", "cy")


def shared_rows(result: Result) -> list[Row]:
    """List the parameters shared by all photos: name, adjusted value, sigma, unit."""
    shared = result.shared
    single = ("heading_bias_deg", "clock_offset_s", "clock_drift_ppm", "readout_s")
    rows: list[Row] = []
    for field in (*_AXES, *single):
        name, unit = field.rsplit("_", 1)
        rows += _rows(getattr(shared, field), name, _AXES.get(field, ("",)), unit)
    for tape, scale in shared.tape_scale.items():
        rows += _rows(scale, "tape_scale", (tape,), "")
    return rows


def _rows(found: Estimate | None, name: str, axes: tuple[str, ...], unit: str) -> Iterator[Row]:
    if found is None:
        return
    for axis, value, sigma in zip(axes, found.value, found.sigma, strict=True):
        whole = " ".join(filter(None, (name.replace("_", " "), axis)))
        yield {"name": whole, "value": float(value), "sigma": float(sigma), "unit": unit}


def camera_rows(result: Result) -> list[Row]:
    """List the parameters of the lens model as stated and as adjusted, with sigmas."""
    camera, adjusted = result.camera, result.shared.intrinsics
    stated = np.sqrt(np.diag(camera.covariance))
    return [
        {
            "name": name,
            "stated": float(camera.parameters[k]),
            "stated_sigma": float(stated[k]),
            "adjusted": float(adjusted.value[k]),
            "adjusted_sigma": float(adjusted.sigma[k]),
            "unit": "px" if name in _PIXELS else "",
        }
        for k, name in enumerate(camera.parameter_names)
    ]


def orientation_rows(result: Result) -> list[Row]:
    """List the correlations among the shared parameters, and of each pose with them."""
    found = result.orientation
    if found is None:
        return []
    sources = [("", name, row) for name, row in zip(found.parameters, found.shared, strict=True)]
    for frame, rows in zip(found.frame_id, found.with_pose, strict=True):
        sources += [(frame, name, row) for name, row in zip(POSE_NAMES, rows, strict=True)]
    return [
        {"frame": frame, "unknown": name, **dict(zip(found.parameters, row.tolist(), strict=True))}
        for frame, name, row in sources
    ]
