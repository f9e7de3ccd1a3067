"""Reader and writer of camera.yaml, with every digit and readable."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from uavgram.config.strict_yaml import (
    Document,
    Plain,
    plain_settings,
    read_yaml,
    yaml_text,
)
from uavgram.config.validation import validate
from uavgram.errors import InputError
from uavgram.model.arrays import Floats
from uavgram.model.camera import (
    PARAMETER_NAMES,
    TABLE_SIGMA_S,
    Calibration,
    CameraProvenance,
    LensModel,
    Readout,
    correlation_of,
    parameter_counts,
    parameter_names,
)
from uavgram.model.limits import LARGEST_SIGMA, number_text

LONGEST_READOUT_MS = 1000.0
RELATIVE_TOLERANCE = 1e-6  # of symmetry and definiteness, as numbers in files are rounded


@dataclass(frozen=True, kw_only=True)
class _CameraFile:
    """Keys of camera.yaml."""

    model: LensModel
    width_px: int
    height_px: int
    parameters: tuple[float, ...]
    name: str = ""
    sigma: tuple[float, ...] | None = None
    covariance: tuple[tuple[float, ...], ...] | None = None
    provenance: CameraProvenance | None = None
    readout_ms: float | None = None
    readout_sigma_ms: float | None = None


def load_camera(path: str | Path) -> Calibration:
    """Read the calibration in a camera file of this program; see `load_camera_file`."""
    return load_camera_file(path)[0]


def load_camera_file(path: str | Path) -> tuple[Calibration, CameraProvenance | None]:
    """Read the calibration and its provenance (None where missing) from a camera file.

    Raises
    ------
    InputError
        Names file, line and key of every mistake: those of the YAML, a wrong number of parameters,
        a parameter out of range, an invalid covariance.
    """
    path = Path(path).absolute()
    document = read_yaml(path)
    camera = validate(_CameraFile, document)
    faults = _faults(camera)
    if faults:
        placed = [(document.line_of((key,)), f"{key}: {text}") for key, text in faults]
        raise InputError.of_all(path, placed)
    covariance = _covariance(camera, document)
    calibration = Calibration(
        name=camera.name or path.stem,
        model=camera.model,
        width_px=camera.width_px,
        height_px=camera.height_px,
        parameters=np.array(camera.parameters),
        covariance=covariance,
        readout=_readout(camera),
    )
    return calibration, camera.provenance


def _readout(camera: _CameraFile) -> Readout | None:
    """Return the stated readout time; 0 without a sigma means all rows are exposed at once."""
    if camera.readout_ms is None:
        return None
    usual_ms = 1e3 * TABLE_SIGMA_S if camera.readout_ms else 0.0
    sigma_ms = usual_ms if camera.readout_sigma_ms is None else camera.readout_sigma_ms
    return Readout(value_s=camera.readout_ms / 1e3, sigma_s=sigma_ms / 1e3)


def _faults(camera: _CameraFile) -> list[tuple[str, str]]:
    """List faults of sizes, counts and ranges, as pairs of key and message."""
    faults = [
        (key, f"must be greater than 0 (got {getattr(camera, key)})")
        for key in ("width_px", "height_px")
        if getattr(camera, key) <= 0
    ]
    fits = len(camera.parameters) in parameter_counts(camera.model)
    names = _names(camera) if fits else PARAMETER_NAMES[camera.model]
    n = len(names)
    order = f"{n} numbers in the order {' '.join(names)}"
    if not fits:
        count = len(camera.parameters)
        faults.append(("parameters", f"the {camera.model} model needs {order} (got {count})"))
    elif not faults:
        faults += _parameter_faults(camera)
    if camera.sigma is None and camera.covariance is None:
        faults.append(("parameters", f"have no uncertainty: add 'sigma: [...]', {order}"))
    if camera.sigma is not None and camera.covariance is not None:
        faults.append(("sigma", "cannot be given with covariance: keep one of the two"))
    if camera.sigma is not None:
        faults += _sigma_faults(camera.sigma, order, n)
    if camera.covariance is not None:
        sizes = {len(row) for row in camera.covariance}
        if len(camera.covariance) != n or sizes != {n}:
            rows, columns = len(camera.covariance), "/".join(map(str, sorted(sizes)))
            text = f"must have {n} rows of {order} (got {rows} rows of {columns})"
            faults.append(("covariance", text))
    return [*faults, *_readout_faults(camera)]


def _readout_faults(camera: _CameraFile) -> list[tuple[str, str]]:
    faults = []
    value, sigma = camera.readout_ms, camera.readout_sigma_ms
    if value is not None and abs(value) > LONGEST_READOUT_MS:
        text = f"is far too long (got {value:g} ms): most cameras read a photo in 10 to 100 ms"
        faults.append(("readout_ms", text))
    if sigma is not None and value is None:
        text = "needs a readout time: add 'readout_ms', in which the camera reads a photo"
        faults.append(("readout_sigma_ms", text))
    if sigma is not None and not 0 <= sigma <= LONGEST_READOUT_MS:
        text = f"must be from 0 to {LONGEST_READOUT_MS:g} ms (got {sigma:g})"
        faults.append(("readout_sigma_ms", text))
    return faults


def _sigma_faults(sigma: tuple[float, ...], order: str, count: int) -> list[tuple[str, str]]:
    if len(sigma) != count:
        return [("sigma", f"must be {order} (got {len(sigma)})")]
    if min(sigma) < 0:
        return [("sigma", f"must not be negative (got {min(sigma)})")]
    if max(sigma) > LARGEST_SIGMA:
        return [("sigma", f"is far too large (got {max(sigma):g})")]
    return []


def _names(camera: _CameraFile) -> tuple[str, ...]:
    return parameter_names(camera.model, len(camera.parameters))


def _parameter_faults(camera: _CameraFile) -> list[tuple[str, str]]:
    """Check that focal length and principal point are pixels of this image."""
    fx, fy, cx, cy = camera.parameters[:4]
    faults = [
        ("parameters", f"{name} is far too large (got {value:g})")
        for name, value in zip(_names(camera)[4:], camera.parameters[4:], strict=True)
        if abs(value) > LARGEST_SIGMA
    ]
    for name, focal_px in (("fx", fx), ("fy", fy)):
        if focal_px <= 0:
            faults.append(("parameters", f"{name} must be greater than 0 (got {focal_px})"))
        elif not 0.1 < focal_px / camera.width_px < 100:
            faults.append(
                (
                    "parameters",
                    f"{name} must be in pixels (got {focal_px}, at a width of "
                    f"{camera.width_px} px): millimetres times width_px over the sensor's width",
                )
            )
    for name, centre_px, size in (("cx", cx, camera.width_px), ("cy", cy, camera.height_px)):
        if not -size <= centre_px <= 2 * size:  # it may be outside a crop
            text = f"{name} must be in pixels, inside the image (got {centre_px}, size {size})"
            faults.append(("parameters", text))
    if _is_exchanged(camera):
        middle = f"{(camera.width_px - 1) / 2:g} and {(camera.height_px - 1) / 2:g}"
        text = (
            f"cx and cy seem to be exchanged (got {cx:g} and {cy:g}, the middle of the image is at "
            f"{middle}): write {cy:g}, {cx:g}"
        )
        faults.append(("parameters", text))
    return faults


def _is_exchanged(camera: _CameraFile) -> bool:
    """Return whether the principal point is near the middle only with its axes exchanged."""
    size = np.array([camera.width_px, camera.height_px])
    centre = np.array(camera.parameters[2:4])
    stated, exchanged = (np.abs(one / size - 0.5).max() for one in (centre, centre[::-1]))
    return bool(exchanged < NEAR_MIDDLE and stated > FAR_FROM_MIDDLE)


NEAR_MIDDLE, FAR_FROM_MIDDLE = 0.04, 0.08
"""Distances of the principal point from the middle of the image, as shares of its sides: usual for
a whole photo, and unusual."""


def _covariance(camera: _CameraFile, document: Document) -> Floats:
    """Return the (P, P) covariance from either key, or raise if it is not positive semidefinite."""
    if camera.covariance is None:
        return np.diag(np.square(np.array(camera.sigma, dtype=np.float64)))
    names = _names(camera)
    matrix = np.array(camera.covariance, dtype=np.float64)
    variance = np.diag(matrix)
    for i in np.flatnonzero(variance < 0):
        raise InputError(
            document.path,
            f"covariance: the variance of {names[i]} is negative ({variance[i]})",
            document.line_of(("covariance", int(i))),
        )
    correlation = correlation_of(matrix)
    _check_symmetric(correlation, matrix, names, document)
    # test the correlation matrix, whose eigenvalues do not depend on units
    lowest = float(np.linalg.eigvalsh((correlation + correlation.T) / 2)[0])
    if lowest < -RELATIVE_TOLERANCE:
        raise InputError(
            document.path,
            "covariance: is not positive semidefinite (as a correlation matrix its lowest "
            f"eigenvalue is {lowest:.3g}), so it is no covariance: copy all of it from the "
            "calibration, or give 'sigma' instead",
            document.line_of(("covariance",)),
        )
    return (matrix + matrix.T) / 2


def _check_symmetric(
    correlation: Floats, matrix: Floats, names: tuple[str, ...], document: Document
) -> None:
    i, j = np.unravel_index(np.argmax(np.abs(correlation - correlation.T)), matrix.shape)
    if abs(correlation[i, j] - correlation[j, i]) > RELATIVE_TOLERANCE:
        raise InputError(
            document.path,
            f"covariance: is not symmetric: {names[i]} with {names[j]} is {matrix[i, j]}, but "
            f"{names[j]} with {names[i]} is {matrix[j, i]}",
            document.line_of(("covariance", int(i))),
        )


_SIGMA_DIGITS = 3


def camera_text(calibration: Calibration, provenance: CameraProvenance | None = None) -> str:
    """Return the text of a camera.yaml with the full covariance, for an exact round trip."""
    names, readout = calibration.parameter_names, calibration.readout
    sigma = calibration.covariance.diagonal() ** 0.5
    head = {key: getattr(calibration, key) for key in ("name", "model", "width_px", "height_px")}
    lines = [
        "# Interior orientation. Pixels: (0, 0) is the centre of the top-left pixel.",
        *yaml_text(head, in_blocks=True).splitlines(),
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
    ]
    if readout is not None:
        lines += [
            "# In which time a photo is read, from the first row to the last.",
            f"readout_ms: {number_text(1e3 * readout.value_s)}",
            f"readout_sigma_ms: {number_text(1e3 * readout.sigma_s)}",
        ]
    if provenance is not None:
        made: Plain = {"provenance": plain_settings(provenance)}
        lines += yaml_text(made, in_blocks=True).splitlines()
    return "\n".join(lines) + "\n"


def _row(values: Floats) -> str:
    return f"[{', '.join(map(number_text, values.tolist()))}]"
