"""Lens models on the plane z = 1: OpenCV's Brown and fisheye distortion, with derivatives.

Both have symmetric 2x2 Jacobians by the undistorted point, given as (a, b, c) for [[a, b], [b, c]].
Coefficients are the camera parameters that follow fx fy cx cy.
"""

from __future__ import annotations

import math
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np

from uavgram.model.arrays import Bools, Floats
from uavgram.model.camera import LensModel

# Points per block: the temporaries of one block fit into the processor's cache.
BLOCK = 8192

# Squared radius below which OpenCV's fisheye is the identity to the last digit.
_TINY_RADIUS_SQUARED = 1e-20

# Fraction of the radius at which a rational lens sends points to infinity, up to which points count
# as in view. Closer to the pole, rounding alone exceeds 1e-9 px.
_BEFORE_POLE = 0.99

# Indices of the radial coefficients among the camera's parameters.
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
        Factors of the radial coefficients: d(x, y)/dk_i = (x, y)_undistorted * powers[i]. Brown: k1
        k2 k3, and k4 k5 k6 where the camera has them.
    """

    x: Floats
    y: Floats
    a: Floats
    b: Floats
    c: Floats
    powers: tuple[Floats, ...]


def distort(model: LensModel, coefficients: Floats, x: Floats, y: Floats) -> Distorted:
    """Distort points of the plane z = 1 by the plain formula, also beyond the fold.

    Parameters
    ----------
    model, coefficients
        ``brown``: k1 k2 p1 p2 k3 [k4 k5 k6]; ``fisheye``: k1 k2 k3 k4. Along the first axis;
        further axes (many cameras) broadcast against the points.
    x, y
        (N,) undistorted coordinates, or of any shape.
    """
    if model == "brown":
        return _distort_brown(coefficients, x, y)
    return _distort_fisheye(coefficients, x, y)


def split_components(values: Floats) -> list[Any]:
    """Split values along the first axis: numbers for a vector, arrays where there are more axes."""
    return values.tolist() if values.ndim == 1 else list(values)


def _distort_brown(coefficients: Floats, x: Floats, y: Floats) -> Distorted:
    # OpenCV 4 documentation, calib3d, "Detailed Description"
    k1, k2, p1, p2, k3, *rational = split_components(coefficients)
    xx, yy = x * x, y * y
    r2 = xx + yy
    r4 = r2 * r2
    # Horner's scheme of the polynomial; the derivative reuses its partial sums.
    third = k3 * r2
    second = k2 + third
    first = k1 + r2 * second
    radial = 1 + r2 * first
    slope = first + r2 * (second + third)  # of radial by r2
    powers: tuple[Floats, ...] = (r2, r4, r2 * r4)
    if rational:
        radial, slope, powers = _divide(rational, radial, slope, powers)
    # Tangential part: p1 2xy + p2 (r^2 + 2x^2) = x 2 (p1 y + p2 x) + p2 r^2; both axes share the
    # first factor.
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
    """Divide radial factor, its slope by r^2 and its powers by 1 + k4 r^2 + k5 r^4 + k6 r^6."""
    k4, k5, k6 = rational
    r2 = powers[0]
    inverse = 1 / (1 + r2 * (k4 + r2 * (k5 + r2 * k6)))
    quotient = radial * inverse
    slope = (slope - quotient * (k4 + r2 * (2 * k5 + r2 * (3 * k6)))) * inverse
    above = tuple(power * inverse for power in powers)
    return quotient, slope, (*above, *(-quotient * power for power in above))


def _distort_fisheye(coefficients: Floats, x: Floats, y: Floats) -> Distorted:
    # OpenCV 4 documentation, calib3d, "Fisheye camera model" (Kannala and Brandt 2006)
    k1, k2, k3, k4 = split_components(coefficients)
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

    t is the radius (brown) or the angle from the optical axis [rad] (fisheye); d is empty for a
    polynomial.
    """

    numerator: Floats
    denominator: Floats


def radial_coefficients(model: LensModel, coefficients: Floats) -> Radial:
    """Return the radial part of a lens as a function of one variable."""
    if model == "brown":
        return Radial(coefficients[[0, 1, 4]], coefficients[5:])
    return Radial(coefficients, coefficients[:0])


def fold_argument(model: LensModel, coefficients: Floats) -> float:
    """Find the smallest t at which the function of `radial_coefficients` stops growing.

    t is the undistorted radius (brown) or the angle from the optical axis [rad] (fisheye); inf if
    it grows everywhere. Where the denominator of a rational lens reaches zero before, the result is
    one hundredth short of that pole.
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
    """Find the smallest t > 0 at which 1 + c1 t^2 + c2 t^4 + ... is zero; inf if there is none."""
    # As a polynomial in 1 / t^2 the leading coefficient is 1, so coefficients near zero do no harm,
    # and the nearest zero is the largest root.
    roots = np.roots(ascending)
    crossings = roots[(roots.imag == 0) & (roots.real > 0)].real
    return 1.0 / math.sqrt(crossings.max()) if len(crossings) else math.inf


def largest_radius(model: LensModel, parameters: Floats) -> float:
    """Compute the undistorted radius at which the lens model folds back; inf if nowhere.

    The radius is on the plane z = 1. There the radial polynomial stops growing: farther out, two
    directions share a pixel. The tangential terms are neglected.
    """
    return _largest_radius(model, tuple(np.asarray(parameters, np.float64)[4:].tolist()))


@lru_cache(maxsize=16)  # one lens projects for many frames
def _largest_radius(model: LensModel, coefficients: tuple[float, ...]) -> float:
    argument = fold_argument(model, np.array(coefficients))
    if model == "brown":
        return argument
    return math.tan(argument) if argument < math.pi / 2 else math.inf


def is_folded(lens: Distorted, x: Floats, y: Floats, largest: float) -> Bools:
    """Mark the undistorted points (x, y) at which the lens model folds back; (N,).

    The model folds back beyond the largest radius, and a little before it where the tangential
    terms reverse the orientation.

    Parameters
    ----------
    lens
        Result of `distort` at the points.
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
        Lens model; its parameters (P,), or with more axes that broadcast against the points.
    lens, undistorted
        Result of `distort` at the undistorted points, and their (x, y), each (...).
    """
    fx, fy = split_components(parameters[:2])
    x, y = undistorted
    out[..., :4] = 0
    out[..., 0, 0] = lens.x
    out[..., 1, 1] = lens.y
    out[..., 0, 2] = 1
    out[..., 1, 3] = 1
    # Radial coefficients: d(u, v)/dk_i = (fx x, fy y) powers[i].
    u, v = fx * x, fy * y
    columns = _RADIAL_COLUMNS[model][: len(lens.powers)]
    for column, power in zip(columns, lens.powers, strict=True):
        np.multiply(u, power, out=out[..., 0, column])
        np.multiply(v, power, out=out[..., 1, column])
    if model == "brown":
        # Tangential coefficients: columns 6 (p1) and 7 (p2).
        r2 = x * x + y * y
        twice_u, twice_v = 2 * u, 2 * v
        np.multiply(twice_u, y, out=out[..., 0, 6])
        np.multiply(twice_v, x, out=out[..., 1, 7])
        out[..., 0, 7] = fx * r2 + twice_u * x
        out[..., 1, 6] = fy * r2 + twice_v * y
