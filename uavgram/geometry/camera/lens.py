"""Lens models on the plane z = 1: OpenCV's Brown and fisheye distortion, with derivatives.

Both have symmetric 2x2 Jacobians by the undistorted point, given here as (a, b, c) for
[[a, b], [b, c]]. Coefficients are those that follow fx fy cx cy in the camera's parameters.
"""

from __future__ import annotations

import math
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np

from uavgram.model.arrays import Bools, Floats
from uavgram.model.camera.calibration import LensModel

# Points at a time: the temporaries of one block stay in the processor's cache.
BLOCK = 8192

# A radius below which OpenCV's fisheye is the identity to the last digit.
_TINY_RADIUS_SQUARED = 1e-20

# Of the radius at which a rational lens sends points to infinity: what still counts as in view.
# Nearer than that, rounding alone is more than 1e-9 px.
_BEFORE_POLE = 0.99

# Where the radial coefficients stand among the camera's parameters.
_RADIAL_COLUMNS: dict[LensModel, tuple[int, ...]] = {
    "brown": (4, 5, 8, 9, 10, 11),
    "fisheye": (4, 5, 6, 7),
}


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
        Brown: k1 k2 k3, and k4 k5 k6 where the camera has them.
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
        ``brown``: k1 k2 p1 p2 k3 [k4 k5 k6]; ``fisheye``: k1 k2 k3 k4. Along the first axis; where
        there are more axes (many cameras), they broadcast against the points.
    x, y
        (N,) undistorted coordinates, or of any shape.
    """
    if model == "brown":
        return _distort_brown(coefficients, x, y)
    return _distort_fisheye(coefficients, x, y)


def each(values: Floats) -> list[Any]:
    """Entries along the first axis: plain numbers, or arrays where there are more axes."""
    return values.tolist() if values.ndim == 1 else list(values)


def _distort_brown(coefficients: Floats, x: Floats, y: Floats) -> Distorted:
    # OpenCV 4 documentation, calib3d, "Detailed Description"
    k1, k2, p1, p2, k3, *rational = each(coefficients)
    xx, yy = x * x, y * y
    r2 = xx + yy
    r4 = r2 * r2
    # Horner's scheme, and that of the derivative on top of its partial sums.
    third = k3 * r2
    second = k2 + third
    first = k1 + r2 * second
    radial = 1 + r2 * first
    slope = first + r2 * (second + third)  # of radial by r2
    powers: tuple[Floats, ...] = (r2, r4, r2 * r4)
    if rational:
        radial, slope, powers = _divide(rational, radial, slope, powers)
    # p1 2xy + p2 (r^2 + 2x^2) = x 2 (p1 y + p2 x) + p2 r^2: both axes share the first factor.
    radial_t = radial + ((2 * p1) * y + (2 * p2) * x)
    twice = 2 * slope
    twice_x = twice * x
    return Distorted(
        x=x * radial_t + p2 * r2,
        y=y * radial_t + p1 * r2,
        a=radial_t + x * (twice_x + 4 * p2),
        b=twice_x * y + ((2 * p1) * x + (2 * p2) * y),
        c=radial_t + y * (twice * y + 4 * p1),
        powers=powers,
    )


def _divide(
    rational: list[Any], radial: Floats, slope: Floats, powers: tuple[Floats, ...]
) -> tuple[Floats, Floats, tuple[Floats, ...]]:
    """Radial factor, its slope by r^2 and its powers, over 1 + k4 r^2 + k5 r^4 + k6 r^6."""
    k4, k5, k6 = rational
    r2 = powers[0]
    inverse = 1 / (1 + r2 * (k4 + r2 * (k5 + r2 * k6)))
    quotient = radial * inverse
    slope = (slope - quotient * (k4 + r2 * (2 * k5 + r2 * (3 * k6)))) * inverse
    above = tuple(power * inverse for power in powers)
    return quotient, slope, (*above, *(-quotient * power for power in above))


def _distort_fisheye(coefficients: Floats, x: Floats, y: Floats) -> Distorted:
    # OpenCV 4 documentation, calib3d, "Fisheye camera model" (Kannala and Brandt 2006)
    k1, k2, k3, k4 = each(coefficients)
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


class Radial(NamedTuple):
    """Coefficients n, d of t (1 + n1 t^2 + n2 t^4 + ...) / (1 + d1 t^2 + ...).

    t is the radius (brown) or the angle from the optical axis [rad] (fisheye); d is empty where
    nothing is divided.
    """

    numerator: Floats
    denominator: Floats


def radial_coefficients(model: LensModel, coefficients: Floats) -> Radial:
    """Radial part of a lens as a function of one variable."""
    if model == "brown":
        return Radial(coefficients[[0, 1, 4]], coefficients[5:])
    return Radial(coefficients, coefficients[:0])


def fold_argument(model: LensModel, coefficients: Floats) -> float:
    """Smallest t at which the function of `radial_coefficients` stops growing; inf if none.

    t is the undistorted radius (brown) or the angle from the optical axis [rad] (fisheye). Where
    the denominator of a rational lens comes to zero before, a hundredth short of that.
    """
    above, below = radial_coefficients(model, coefficients)
    # The slope is 1 + 3 n1 t^2 + 5 n2 t^4 + ...
    slope = np.concatenate([[1.0], above * (2 * np.arange(len(above)) + 3)])
    if not below.any():
        return _smallest_root(slope)
    # ... and of a quotient t N / D it is ((t N)' D - t N D') / D^2; all in powers of t^2.
    denominator = np.concatenate([[1.0], below])
    d_denominator = 2 * np.arange(len(denominator)) * denominator  # t D'
    numerator = np.concatenate([[1.0], above])
    growth = np.convolve(slope, denominator) - np.convolve(numerator, d_denominator)
    return min(_smallest_root(growth), _BEFORE_POLE * _smallest_root(denominator))


def _smallest_root(ascending: Floats) -> float:
    """Smallest t > 0 at which 1 + c1 t^2 + c2 t^4 + ... is zero; inf if there is none."""
    # As a polynomial in 1 / t^2 it starts with 1, so coefficients near zero do no harm, and the
    # nearest zero is its largest root.
    roots = np.roots(ascending)
    crossings = roots[(roots.imag == 0) & (roots.real > 0)].real
    return 1.0 / math.sqrt(crossings.max()) if len(crossings) else math.inf


def largest_radius(model: LensModel, parameters: Floats) -> float:
    """Undistorted radius on the plane z = 1 at which the lens model folds back; inf if nowhere.

    There the radial polynomial stops growing: farther out, two directions share a pixel. The
    tangential terms are left out.
    """
    return _largest_radius(model, tuple(np.asarray(parameters, np.float64)[4:].tolist()))


@lru_cache(maxsize=16)  # one lens projects for many frames
def _largest_radius(model: LensModel, coefficients: tuple[float, ...]) -> float:
    argument = fold_argument(model, np.array(coefficients))
    if model == "brown":
        return argument
    return math.tan(argument) if argument < math.pi / 2 else math.inf


def folded(lens: Distorted, x: Floats, y: Floats, largest: float) -> Bools:
    """(N,) whether the lens model folds back at undistorted points (x, y).

    Beyond the largest radius, and where the tangential terms turn it over a little before that.

    Parameters
    ----------
    lens
        What `distort` makes of the points.
    x, y
        (N,) undistorted, on the plane z = 1.
    largest
        Radius at which the radial part folds back.
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
    """Fill (..., 2, P) with the derivatives of pixels by the parameters.

    Parameters
    ----------
    out
        (..., 2, P) for points (...).
    model, parameters
        The lens; (P,), or with more axes that broadcast against the points.
    lens, undistorted
        What `distort` makes of the points (x, y), each (...).
    """
    fx, fy = each(parameters[:2])
    x, y = undistorted
    out[..., :4] = 0
    out[..., 0, 0] = lens.x
    out[..., 1, 1] = lens.y
    out[..., 0, 2] = 1
    out[..., 1, 3] = 1
    u, v = fx * x, fy * y
    columns = _RADIAL_COLUMNS[model][: len(lens.powers)]
    for column, power in zip(columns, lens.powers, strict=True):
        np.multiply(u, power, out=out[..., 0, column])
        np.multiply(v, power, out=out[..., 1, column])
    if model == "brown":
        r2 = x * x + y * y
        twice_u, twice_v = 2 * u, 2 * v
        np.multiply(twice_u, y, out=out[..., 0, 6])
        np.multiply(twice_v, x, out=out[..., 1, 7])
        out[..., 0, 7] = fx * r2 + twice_u * x
        out[..., 1, 6] = fy * r2 + twice_v * y
