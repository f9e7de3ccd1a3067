"""Lens models on the plane z = 1: OpenCV's Brown and fisheye distortion, with derivatives.

Both have symmetric 2x2 Jacobians by the undistorted point, given here as (a, b, c) for
[[a, b], [b, c]]. Coefficients are those that follow fx fy cx cy in the camera's parameters.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from uavgram.model.arrays import Bools, Floats
from uavgram.model.camera import LensModel

# Points at a time: the temporaries of one block stay in the processor's cache.
BLOCK = 8192

# A radius below which OpenCV's fisheye is the identity to the last digit.
_TINY_RADIUS_SQUARED = 1e-20


class Distorted(NamedTuple):
    """Distorted coordinates of N points, and their derivatives by the undistorted ones.

    Attributes
    ----------
    x, y
        (N,) distorted, on the plane z = 1.
    a, b, c
        (N,) dx/dx, dx/dy = dy/dx, dy/dy.
    powers
        The factors of the radial coefficients: d(x, y)/dk_i = (x, y)_undistorted * powers[i].
    """

    x: Floats
    y: Floats
    a: Floats
    b: Floats
    c: Floats
    powers: tuple[Floats, ...]


def distort(model: LensModel, coefficients: Floats, x: Floats, y: Floats) -> Distorted:
    """Distort points of the plane z = 1; plain formula, also where it folds back.

    Parameters
    ----------
    model, coefficients
        ``brown``: k1 k2 p1 p2 k3; ``fisheye``: k1 k2 k3 k4.
    x, y
        (N,) undistorted coordinates.
    """
    if model == "brown":
        return _distort_brown(coefficients, x, y)
    return _distort_fisheye(coefficients, x, y)


def _distort_brown(coefficients: Floats, x: Floats, y: Floats) -> Distorted:
    # OpenCV 4 documentation, calib3d, "Detailed Description"
    k1, k2, p1, p2, k3 = coefficients.tolist()
    xx, yy, xy2 = x * x, y * y, 2 * x * y
    r2 = xx + yy
    r4 = r2 * r2
    radial = 1 + r2 * (k1 + r2 * (k2 + r2 * k3))
    slope = k1 + r2 * (2 * k2 + r2 * (3 * k3))  # of radial by r2
    tangential = 2 * (p1 * y + p2 * x)
    radial_t = radial + tangential
    return Distorted(
        x=x * radial + p1 * xy2 + p2 * (r2 + 2 * xx),
        y=y * radial + p2 * xy2 + p1 * (r2 + 2 * yy),
        a=radial_t + 2 * xx * slope + (4 * p2) * x,
        b=xy2 * slope + 2 * (p1 * x + p2 * y),
        c=radial_t + 2 * yy * slope + (4 * p1) * y,
        powers=(r2, r4, r2 * r4),
    )


def _distort_fisheye(coefficients: Floats, x: Floats, y: Floats) -> Distorted:
    # OpenCV 4 documentation, calib3d, "Fisheye camera model" (Kannala and Brandt 2006)
    k1, k2, k3, k4 = coefficients.tolist()
    r2 = x * x + y * y
    safe = np.maximum(r2, _TINY_RADIUS_SQUARED)
    r = np.sqrt(safe)
    theta = np.arctan(r)
    t2 = theta * theta
    ratio = theta / r
    scale = ratio * (1 + t2 * (k1 + t2 * (k2 + t2 * (k3 + t2 * k4))))
    growth = 1 + t2 * (3 * k1 + t2 * (5 * k2 + t2 * (7 * k3 + t2 * (9 * k4))))  # dtheta_d/dtheta
    slope = (growth / (1 + r2) - scale) / safe  # twice the slope of scale by r2
    power1 = ratio * t2
    power2 = power1 * t2
    power3 = power2 * t2
    return Distorted(
        x=x * scale,
        y=y * scale,
        a=scale + x * x * slope,
        b=x * y * slope,
        c=scale + y * y * slope,
        powers=(power1, power2, power3, power3 * t2),
    )


def radial_coefficients(model: LensModel, coefficients: Floats) -> Floats:
    """Coefficients c of the odd polynomial t (1 + c1 t^2 + c2 t^4 + ...), t the radius or theta."""
    return coefficients[[0, 1, 4]] if model == "brown" else coefficients


def fold_argument(model: LensModel, coefficients: Floats) -> float:
    """Smallest t at which the odd polynomial of `radial_coefficients` stops growing; inf if none.

    t is the undistorted radius (brown) or the angle from the optical axis [rad] (fisheye).
    """
    odd = radial_coefficients(model, coefficients)
    # The slope is 1 + 3 c1 t^2 + 5 c2 t^4 + ...; as a polynomial in 1 / t^2 it starts with 1, so
    # coefficients near zero do no harm, and the nearest fold is its largest root.
    roots = np.roots(np.concatenate([[1.0], odd * (2 * np.arange(len(odd)) + 3)]))
    crossings = roots[(roots.imag == 0) & (roots.real > 0)].real
    return 1.0 / math.sqrt(crossings.max()) if len(crossings) else math.inf


def largest_radius(model: LensModel, parameters: Floats) -> float:
    """Undistorted radius on the plane z = 1 at which the lens model folds back; inf if nowhere.

    There the radial polynomial stops growing: farther out, two directions share a pixel. The
    tangential terms are left out.
    """
    argument = fold_argument(model, np.asarray(parameters, np.float64)[4:])
    if model == "brown":
        return argument
    return math.tan(argument) if argument < math.pi / 2 else math.inf


def folded(lens: Distorted, x: Floats, y: Floats, largest: float) -> Bools:
    """(N,) whether the lens model folds back at undistorted points (x, y).

    Beyond the largest radius, and where the tangential terms turn it over a little before that.
    """
    result: Bools = ~(lens.a * lens.c > lens.b * lens.b)
    if math.isfinite(largest):
        result |= x * x + y * y >= largest * largest
    return result


def write_parameter_derivative(
    out: Floats,
    model: LensModel,
    parameters: Floats,
    lens: Distorted,
    undistorted: tuple[Floats, ...],
) -> None:
    """Fill (N, 2, P) with the derivatives of pixels by the parameters.

    Parameters
    ----------
    out
        (N, 2, P).
    model, parameters
        The lens.
    lens, undistorted
        What `distort` makes of the points (x, y), each (N,).
    """
    fx, fy = parameters[:2].tolist()
    x, y = undistorted
    out[:, :, :4] = 0
    out[:, 0, 0] = lens.x
    out[:, 1, 1] = lens.y
    out[:, 0, 2] = 1
    out[:, 1, 3] = 1
    u, v = fx * x, fy * y
    columns = (4, 5, 8) if model == "brown" else (4, 5, 6, 7)
    for column, power in zip(columns, lens.powers, strict=True):
        np.multiply(u, power, out=out[:, 0, column])
        np.multiply(v, power, out=out[:, 1, column])
    if model == "brown":
        r2 = lens.powers[0]
        np.multiply(2 * u, y, out=out[:, 0, 6])
        np.multiply(2 * v, x, out=out[:, 1, 7])
        out[:, 0, 7] = fx * r2 + 2 * u * x
        out[:, 1, 6] = fy * r2 + 2 * v * y
