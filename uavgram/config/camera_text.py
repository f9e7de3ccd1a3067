"""`Calibration` -> the text of a camera.yaml: every digit, and readable."""

from __future__ import annotations

import math
from collections.abc import Iterable

import yaml

from uavgram.model.arrays import Floats
from uavgram.model.camera.calibration import Calibration
from uavgram.model.camera.provenance import CameraProvenance
from uavgram.model.camera.readout import Readout
from uavgram.model.typed_numbers import number_text

_SIGMA_DIGITS = 3


def camera_text(calibration: Calibration, provenance: CameraProvenance) -> str:
    """Text of a camera.yaml with the full covariance; `load_camera` gives both back to the bit."""
    names = calibration.parameter_names
    sigma = calibration.covariance.diagonal() ** 0.5
    lines = [
        "# Interior orientation. Pixels: (0, 0) is the centre of the top-left pixel.",
        f"name: {_quoted(calibration.name)}",
        f"model: {calibration.model}",
        f"width_px: {calibration.width_px}",
        f"height_px: {calibration.height_px}",
        "parameters:",
        *(
            f"  - {number_text(value)}  # {name} ± {error:.{_SIGMA_DIGITS}g}"
            + (" px" if name in {"fx", "fy", "cx", "cy"} else "")
            for name, value, error in zip(
                names, calibration.parameters.tolist(), sigma.tolist(), strict=True
            )
        ),
        f"covariance:  # {' '.join(names)}",
        *(f"  - {_row(row)}" for row in calibration.covariance),
        *_readout_lines(calibration.readout),
        "provenance:",
        *(f"  {line}" for line in _provenance_lines(provenance)),
    ]
    return "\n".join(lines) + "\n"


def _readout_lines(readout: Readout | None) -> Iterable[str]:
    if readout is not None:
        yield "# In which time a photo is read, from the first row to the last."
        yield f"readout_ms: {number_text(1e3 * readout.value_s)}"
        yield f"readout_sigma_ms: {number_text(1e3 * readout.sigma_s)}"


def _row(values: Floats) -> str:
    return f"[{', '.join(map(number_text, values.tolist()))}]"


def _quoted(text: str) -> str:
    """Text in double quotes, whatever is in it."""
    dumped: str = yaml.safe_dump(text, default_style='"', allow_unicode=True, width=math.inf)
    return dumped.strip()


def _provenance_lines(provenance: CameraProvenance) -> Iterable[str]:
    for key in ("program", "version", "created_utc", "source"):
        yield f"{key}: {_quoted(getattr(provenance, key))}"
    for key in ("board", "make", "camera_model"):
        if text := getattr(provenance, key):
            yield f"{key}: {_quoted(text)}"
    for key in ("focal_mm", "focus_m", "variance_factor"):
        if (value := getattr(provenance, key)) is not None:
            yield f"{key}: {number_text(float(value))}"
    if provenance.options:
        yield "options:"
        yield from (
            f"  {_quoted(name)}: {_plain(value)}" for name, value in provenance.options.items()
        )
    if provenance.inputs:
        yield "inputs:"
        for one in provenance.inputs:
            yield f"  - path: {_quoted(one.path)}"
            yield f"    sha256: {_quoted(one.sha256)}"
            yield f"    size_bytes: {one.size_bytes}"


def _plain(value: bool | int | float | str) -> str:  # noqa: FBT001 (data, no switch)
    if isinstance(value, str):
        return _quoted(value)
    return str(value).lower() if isinstance(value, bool) else number_text(value)
