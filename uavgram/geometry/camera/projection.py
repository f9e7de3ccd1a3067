"""Projection from camera to pixel by OpenCV's models with analytic derivatives, and back.

Pixels are (u right, v down); (0, 0) is the centre of the top-left pixel. Parameters are those of
``uavgram.model.camera.PARAMETER_NAMES``.
"""

from __future__ import annotations

from typing import Literal

import numpy as np

from uavgram.geometry.camera.back_projection import back_project, back_project_with_jacobian
from uavgram.geometry.camera.lens import (
    BLOCK,
    Distorted,
    distort,
    is_folded,
    largest_radius,
    split_components,
    write_parameter_derivative,
)
from uavgram.model.arrays import Floats
from uavgram.model.camera import LensModel

__all__ = [
    "BeyondFold",
    "back_project",
    "back_project_with_jacobian",
    "largest_radius",
    "project",
    "project_with_jacobian",
]

BeyondFold = Literal["nan", "extend"]


# Points at the camera or at infinity overflow before they become NaN or infinity: no warning.
@np.errstate(over="ignore", invalid="ignore")
def project(
    model: LensModel,
    parameters: Floats,
    point_camera: Floats,
    *,
    beyond_fold: BeyondFold = "nan",
) -> Floats:
    """Project points of the camera frame to pixels.

    Parameters
    ----------
    model, parameters
        Lens model; (P,) its parameters in the order of ``PARAMETER_NAMES[model]``.
    point_camera
        (..., 3) [m, or any unit].
    beyond_fold
        Result where the lens model folds back: ``nan``, or ``extend`` for the plain formula.

    Returns
    -------
    (..., 2)
        Pixels; NaN behind the camera (z <= 0).
    """
    parameters, flat, shape = _flatten(parameters, point_camera)
    fold = _fold(model, parameters, beyond_fold)
    pixel = np.empty((len(flat), 2))
    for start in range(0, len(flat), BLOCK):
        block = slice(start, start + BLOCK)
        x, y, _ = _normalise(flat[block])
        lens = distort(model, parameters[4:], x, y)
        _write_pixel(pixel[block], parameters, lens)
        if fold is not None:
            pixel[block][is_folded(lens, x, y, fold)] = np.nan
    return pixel.reshape(*shape, 2)


@np.errstate(over="ignore", invalid="ignore")
def project_with_jacobian(
    model: LensModel,
    parameters: Floats,
    point_camera: Floats,
    *,
    beyond_fold: BeyondFold = "nan",
) -> tuple[Floats, Floats, Floats]:
    """Project points of the camera frame to pixels, with derivatives.

    Parameters
    ----------
    model, point_camera, beyond_fold
        As for `project`.
    parameters
        As for `project`; or (m, P) of m lenses, for points (m, n, 3), with ``extend``.

    Returns
    -------
    pixel : (..., 2)
    d_point : (..., 2, 3)
        Derivative with respect to the point.
    d_parameters : (..., 2, P)
        Derivative with respect to the camera's parameters. All NaN where the pixel is.
    """
    parameters, flat, shape = _flatten(parameters, point_camera)
    fold = _fold(model, parameters, beyond_fold)
    if parameters.ndim > 1:  # one lens for each point
        parameters = np.repeat(parameters.T, shape[-1], axis=1)
    n, p = len(flat), len(parameters)
    pixel, d_point, d_parameters = np.empty((n, 2)), np.empty((n, 2, 3)), np.empty((n, 2, p))
    for start in range(0, n, BLOCK):
        block = slice(start, start + BLOCK)
        own = parameters if parameters.ndim == 1 else parameters[:, block]
        x, y, inverse_depth = _normalise(flat[block])
        lens = distort(model, own[4:], x, y)
        bad = np.isnan(inverse_depth)
        if fold is not None:
            bad |= is_folded(lens, x, y, fold)
        _write_pixel(pixel[block], own, lens)
        _write_point_derivative(d_point[block], own, lens, (x, y, inverse_depth))
        write_parameter_derivative(d_parameters[block], model, own, lens, (x, y))
        if bad.any():
            for out in (pixel, d_point, d_parameters):
                out[block][bad] = np.nan
    return (
        pixel.reshape(*shape, 2),
        d_point.reshape(*shape, 2, 3),
        d_parameters.reshape(*shape, 2, p),
    )


def _write_pixel(out: Floats, parameters: Floats, lens: Distorted) -> None:
    fx, fy, cx, cy = split_components(parameters[:4])
    np.add(fx * lens.x, cx, out=out[:, 0])
    np.add(fy * lens.y, cy, out=out[:, 1])


def _write_point_derivative(
    out: Floats, parameters: Floats, lens: Distorted, normalised: tuple[Floats, ...]
) -> None:
    x, y, inverse_depth = normalised
    for row, (focal, by_x, by_y) in enumerate(
        ((parameters[0], lens.a, lens.b), (parameters[1], lens.b, lens.c))
    ):
        scale = focal * inverse_depth
        first, second = scale * by_x, scale * by_y
        out[:, row, 0] = first
        out[:, row, 1] = second
        out[:, row, 2] = -(first * x + second * y)


def _normalise(point: Floats) -> tuple[Floats, Floats, Floats]:
    """Compute (x / z, y / z, 1 / z) of (N, 3) points; NaN behind the camera."""
    z = point[:, 2]
    # Contiguous copies, because all later steps read them many times.
    inverse_depth = 1.0 / np.where(z > 0, z, np.nan)
    return point[:, 0] * inverse_depth, point[:, 1] * inverse_depth, inverse_depth


def _flatten(parameters: Floats, array: Floats) -> tuple[Floats, Floats, tuple[int, ...]]:
    array = np.asarray(array, np.float64)
    return (
        np.asarray(parameters, np.float64),
        array.reshape(-1, array.shape[-1]),
        array.shape[:-1],
    )


def _fold(model: LensModel, parameters: Floats, beyond_fold: BeyondFold) -> float | None:
    """Return the largest radius to accept; None where the plain formula is wanted everywhere."""
    return largest_radius(model, parameters) if beyond_fold == "nan" else None
