"""Projection from camera to pixel by OpenCV's models with derivatives, and back to 1e-9 px.

The radial part is interpolated in a table (seven digits), so that Newton's iteration starts on the
right branch and cannot leave it. Two or three Newton steps on the plane z = 1, over whole arrays,
then invert radial and tangential part together. Points that do not converge, or that are at or
beyond the fold of the lens model, are left to the slower bracketed search of `_undistort`.

Pixels are (u right, v down); (0, 0) is the centre of the top-left pixel. Parameters are those of
``uavgram.model.camera.PARAMETER_NAMES``.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Literal, NamedTuple

import numpy as np

from uavgram.geometry.camera.lens import (
    BLOCK,
    Distorted,
    Radial,
    distort,
    fold_argument,
    is_folded,
    largest_radius,
    radial_coefficients,
    split_components,
    write_parameter_derivative,
)
from uavgram.model.arrays import Bools, Floats
from uavgram.model.camera import LensModel

_NODES = 4096
_LARGE_TANGENTIAL = 1e-2
"""Coefficient p1 or p2 above which the start value is so coarse that a third step is needed."""

_LAST_STEP = 1e-7
"""Newton step after which none is needed: the error is its square, 1e-14 away from the fold."""

_LEAST_DETERMINANT = 0.05
"""Determinant of the lens's Jacobian below which the point is too near to the fold."""

_SAFE = 0.95
"""Fraction of the way to the fold that the table covers."""

_WIDEST: dict[LensModel, float] = {"brown": 1.6, "fisheye": 4.0}
"""Undistorted radius that the table covers at most: 58 and 76 degrees from the optical axis.

Farther out a polynomial may grow so fast that the nodes would be too far apart everywhere.
"""


class _Table(NamedTuple):
    """Ratio of undistorted to distorted radius at equal steps of the squared distorted radius."""

    factor: Floats
    slope: Floats
    per_square: float
    end_square: float


class Undistorted(NamedTuple):
    """Undistorted points, with the lens model evaluated at them.

    Attributes
    ----------
    x, y
        (N,).
    lens
        Result of `distort` at the points, to seven digits (from the step before the last).
    found
        (N,) True where the iteration converged on the near side of the fold.
    """

    x: Floats
    y: Floats
    lens: Distorted
    found: Bools


def undistort(
    model: LensModel, parameters: Floats, target_x: Floats, target_y: Floats
) -> Undistorted:
    """Invert the lens at points (N,) of the plane z = 1; `found` is False where this fails.

    Parameters
    ----------
    model, parameters
        Lens model; (P,) its parameters.
    target_x, target_y
        Distorted coordinates.
    """
    table = _table(model, parameters[4:].tobytes())
    x, y = _radial_inverse(table, target_x, target_y)
    if model == "brown" and parameters[6:8].any():
        # Start value: subtract the tangential part at the first guess, then invert again.
        p1, p2 = parameters[6:8].tolist()
        square = x * x + y * y
        common = (2 * p1) * y + (2 * p2) * x
        x, y = _radial_inverse(
            table, target_x - (x * common + p2 * square), target_y - (y * common + p1 * square)
        )
    # Newton's iteration. The number of steps does not depend on the points, so that each result is
    # independent of the others in the array.
    for _ in range(_steps(model, parameters)):
        lens = distort(model, parameters[4:], x, y)
        miss_x, miss_y = lens.x - target_x, lens.y - target_y
        # Solve the symmetric 2x2 system [[a, b], [b, c]] step = miss in closed form.
        determinant = lens.a * lens.c - lens.b * lens.b
        over = 1.0 / determinant
        step_x = (lens.c * miss_x - lens.b * miss_y) * over
        step_y = (lens.a * miss_y - lens.b * miss_x) * over
        x -= step_x
        y -= step_y
    found: Bools = np.maximum(np.abs(step_x), np.abs(step_y)) <= _LAST_STEP
    found &= determinant > _LEAST_DETERMINANT
    return Undistorted(x, y, lens, found)


def _steps(model: LensModel, parameters: Floats) -> int:
    return 3 if model == "brown" and np.abs(parameters[6:8]).max() > _LARGE_TANGENTIAL else 2


def _radial_inverse(table: _Table, x: Floats, y: Floats) -> tuple[Floats, Floats]:
    """Undistort points by the radial part alone; NaN beyond the end of the table."""
    square = x * x
    square += y * y
    inside = square < table.end_square  # False for NaN
    place = np.where(inside, square * table.per_square, 0.0)
    node = place.astype(np.intp)
    place -= node
    factor = table.slope[node]
    factor *= place
    factor += table.factor[node]
    factor[~inside] = np.nan
    return x * factor, y * factor


@lru_cache(maxsize=64)
def _table(model: LensModel, coefficients: bytes) -> _Table:
    """Tabulate the inverse of the radial part alone, up to a little before its fold."""
    values = np.frombuffer(coefficients)
    argument = np.linspace(0.0, _reach(model, values), 4 * _NODES)
    distorted = _radial(model, values, argument)
    radius = argument if model == "brown" else np.tan(argument)
    end = float(distorted[-1] ** 2)
    square = np.linspace(0.0, end, _NODES + 1)
    factor = np.ones(_NODES + 1)
    # Linear interpolation on the fine grid is exact to eight digits.
    factor[1:] = np.interp(np.sqrt(square[1:]), distorted, radius) / np.sqrt(square[1:])
    return _Table(factor[:-1].copy(), np.diff(factor), _NODES / end, end * (1 - 1e-12))


def _reach(model: LensModel, coefficients: Floats) -> float:
    fold = fold_argument(model, coefficients)
    if model == "brown":
        return min(_SAFE * fold, _WIDEST[model])
    return float(min(_SAFE * fold, np.arctan(_WIDEST[model])))


def _radial(model: LensModel, coefficients: Floats, argument: Floats) -> Floats:
    above, below = radial_coefficients(model, coefficients)
    square = argument * argument

    def polynomial(values: Floats) -> Floats:
        return np.asarray(np.polynomial.polynomial.polyval(square, np.append(1.0, values)))

    return argument * polynomial(above) / polynomial(below)


# Tighter than the documented 1e-9 px: Newton's last step meets both at once.
_TOLERANCE_PX = 1e-10
_START_PX = 0.01  # start value of Newton's iteration in the plane
_ROUNDING = 8 * float(np.finfo(float).eps)  # relative, for very large pixel values
_SMALLEST_SLOPE = 1e-30
_TABLE_NODES = 1024
_RADIAL_STEPS = 60  # at the fold itself a step only halves the distance
_NEWTON_STEPS = 40
_HALVINGS = 6


def back_project(model: LensModel, parameters: Floats, pixel: Floats) -> Floats:
    """Compute the rays of pixels.

    Parameters
    ----------
    model, parameters
        Lens model; (P,) its parameters in the order of ``PARAMETER_NAMES[model]``.
    pixel
        (..., 2) in the original, distorted image.

    Returns
    -------
    (..., 3)
        Rays in the camera frame with z = 1. Projecting them gives the pixel back to 1e-9 px. NaN
        where the lens model has no inverse (outside its fold), and for a fisheye at 90 degrees from
        the optical axis and beyond.
    """
    parameters = np.asarray(parameters, np.float64)
    pixel = np.asarray(pixel, np.float64)
    flat = pixel.reshape(-1, 2)
    ray = np.ones((len(flat), 3))
    for start in range(0, len(flat), BLOCK):
        block = slice(start, start + BLOCK)
        x, y, _ = rays_and_lens(model, parameters, flat[block])
        ray[block, 0], ray[block, 1] = x, y
        ray[block, 2][np.isnan(x)] = np.nan
    return ray.reshape(*pixel.shape[:-1], 3)


def back_project_with_jacobian(
    model: LensModel, parameters: Floats, pixel: Floats
) -> tuple[Floats, Floats, Floats]:
    """Compute the rays of pixels and their derivatives (implicit function theorem).

    Parameters
    ----------
    model, parameters, pixel
        As for `back_project`.

    Returns
    -------
    ray : (..., 3)
        With z = 1.
    d_pixel : (..., 3, 2)
        Derivative with respect to the pixel.
    d_parameters : (..., 3, P)
        Derivative with respect to the camera's parameters. All NaN where the ray is.
    """
    parameters = np.asarray(parameters, np.float64)
    pixel = np.asarray(pixel, np.float64)
    shape, p = pixel.shape[:-1], len(parameters)
    flat = pixel.reshape(-1, 2)
    n = len(flat)
    ray = np.ones((n, 3))
    d_pixel, d_parameters = np.zeros((n, 3, 2)), np.zeros((n, 3, p))
    for start in range(0, n, BLOCK):
        block = slice(start, start + BLOCK)
        x, y, _ = rays_and_lens(model, parameters, flat[block])
        ray[block, 0], ray[block, 1] = x, y
        lens = distort(model, parameters[4:], x, y)
        determinant = lens.a * lens.c - lens.b * lens.b
        fx, fy = parameters[:2].tolist()
        # d ray / d pixel: inverse of the symmetric 2x2 derivative of the projection.
        inverse = d_pixel[block]
        inverse[:, 0, 0] = lens.c / (determinant * fx)
        inverse[:, 0, 1] = -lens.b / (determinant * fy)
        inverse[:, 1, 0] = -lens.b / (determinant * fx)
        inverse[:, 1, 1] = lens.a / (determinant * fy)
        forward = np.empty((len(x), 2, p))
        write_parameter_derivative(forward, model, parameters, lens, (x, y))
        # pixel(ray, parameters) = constant: d_ray = -(d pixel / d ray)^-1 (d pixel / d parameters)
        np.matmul(-inverse[:, :2], forward, out=d_parameters[block, :2])
    bad = np.isnan(ray[:, 0])
    for array in (ray, d_pixel, d_parameters):
        array[bad] = np.nan
    return ray.reshape(*shape, 3), d_pixel.reshape(*shape, 3, 2), d_parameters.reshape(*shape, 3, p)


def rays_and_lens(
    model: LensModel, parameters: Floats, pixel: Floats
) -> tuple[Floats, Floats, Distorted]:
    """Compute undistorted x and y (...) of pixels (..., 2), and the lens model at them.

    Undistorted coordinates are NaN where a pixel has no ray. The derivatives of the lens are good
    to six digits, enough for a covariance.

    Parameters
    ----------
    model, parameters
        Lens model; (P,) its parameters.
    pixel
        (..., 2) in the original, distorted image.
    """
    fx, fy, cx, cy = parameters[:4].tolist()
    with np.errstate(over="ignore", invalid="ignore"):
        target_x, target_y = (pixel[..., 0] - cx) / fx, (pixel[..., 1] - cy) / fy
        x, y, lens, found = undistort(model, parameters, target_x, target_y)
    if found.all():
        return x, y, lens
    missed = ~found
    target = np.stack([target_x[missed], target_y[missed]], axis=-1)
    target[~np.isfinite(target).all(axis=1)] = np.nan
    x[missed], y[missed] = _undistort(model, parameters, target).T
    return x, y, distort(model, parameters[4:], x, y)


def _undistort(model: LensModel, parameters: Floats, target: Floats) -> Floats:
    """Undistort points (N, 2) of the plane z = 1; NaN where there is no inverse."""
    coefficients = parameters[4:]
    distorted = np.hypot(target[:, 0], target[:, 1])
    fold = fold_argument(model, coefficients)
    limit = fold if model == "brown" else min(fold, np.pi / 2)
    radial_only = model == "fisheye" or not coefficients[2:4].any()
    tolerance = (_TOLERANCE_PX if radial_only else _START_PX) / float(parameters[:2].max())
    # Invert the radial part as a function of one variable: radius or angle.
    odd = radial_coefficients(model, coefficients)
    argument, found = _invert_odd(odd, distorted, limit, tolerance)
    radius = argument if model == "brown" else np.tan(argument)
    # At the principal point the limit of the factor is 1, and the result is zero for any factor.
    factor = np.divide(radius, distorted, out=np.ones_like(radius), where=distorted > 0)
    point = target * factor[:, None]
    if radial_only:
        point[~found] = np.nan
        return point
    return _newton(parameters, target, point)


def _invert_odd(odd: Radial, value: Floats, limit: float, tolerance: float) -> tuple[Floats, Bools]:
    """Solve t (1 + n1 t^2 + ...) / (1 + d1 t^2 + ...) = value for t < `limit`, where it grows.

    Returns
    -------
    argument : (N,)
        Solution, or the nearest t where there is none.
    found : (N,)
        True where the argument is a solution within `tolerance`.
    """
    finite = np.isfinite(value)
    value = np.where(finite, value, 0.0)
    # Bracket and start value from a table; then Newton's steps within the bracket.
    node = np.linspace(0.0, _table_end(odd, value.max(initial=0.0), limit), _TABLE_NODES)
    height = _odd(odd, node)[0]
    above = np.clip(np.searchsorted(height, value), 1, _TABLE_NODES - 1)
    low, high = node[above - 1], node[above]
    argument = np.interp(value, height, node)
    found = np.zeros(len(value), bool)
    active = np.flatnonzero(finite & (value < height[-1]))
    for _ in range(_RADIAL_STEPS):  # pragma: no branch (a limit, not a plan)
        t = argument[active]
        have, slope = _odd(odd, t)
        residual = have - value[active]
        done = np.abs(residual) <= tolerance + _ROUNDING * value[active]
        found[active[done]] = True
        low[active] = np.where(residual < 0, t, low[active])
        high[active] = np.where(residual > 0, t, high[active])
        # The slope is zero only at the fold. Bisect where Newton's step leaves the bracket.
        improved = t - residual / np.maximum(slope, _SMALLEST_SLOPE)
        outside = (improved < low[active]) | (improved > high[active])
        improved[outside] = 0.5 * (low[active] + high[active])[outside]
        argument[active] = np.where(done, t, improved)
        active = active[~done]
        if not len(active):
            break
    return argument, found


def _table_end(odd: Radial, largest_value: float, limit: float) -> float:
    """Find the smallest power of two (at most `limit`) where the odd function reaches the value."""
    end = min(1.0, limit)
    while end < limit and _odd(odd, np.array([end]))[0][0] < largest_value:
        end = min(2 * end, limit)
    return end


def _odd(odd: Radial, t: Floats) -> tuple[Floats, Floats]:
    """Evaluate t (1 + n1 t^2 + ...) / (1 + d1 t^2 + ...) and its slope."""
    factor, slope = _factor_and_slope(odd.numerator, t)
    if len(odd.denominator):
        divisor, divisor_slope = _factor_and_slope(odd.denominator, t)
        factor = factor / divisor
        # (t N / D)' = ((t N)' - (N / D) t D') / D, and t D' = (t D)' - D
        slope = (slope - factor * (divisor_slope - divisor)) / divisor
    return t * factor, slope


def _factor_and_slope(coefficients: Floats, t: Floats) -> tuple[Floats, Floats]:
    """Evaluate 1 + c1 t^2 + c2 t^4 + ..., and the slope of t times this polynomial."""
    t2 = t * t
    factor, slope = np.zeros_like(t), np.zeros_like(t)
    for power, coefficient in reversed(list(enumerate(coefficients.tolist(), 1))):
        factor = (factor + coefficient) * t2
        slope = (slope + (2 * power + 1) * coefficient) * t2
    return 1 + factor, 1 + slope


def _newton(parameters: Floats, target: Floats, start: Floats) -> Floats:
    """Invert the Brown model with tangential terms by damped Newton steps; NaN on failure.

    Parameters
    ----------
    parameters
        (9,) or (12,).
    target, start
        (N, 2) distorted points and start values of the undistorted ones, on the plane z = 1.
    """
    largest = largest_radius("brown", parameters)
    point = np.full_like(start, np.nan)
    index = np.flatnonzero(np.isfinite(target).all(axis=1))
    # On the fold the derivative is singular: start inside it.
    now = _inside(start[index], 0.99 * largest)
    wanted = target[index]
    for _ in range(_NEWTON_STEPS):  # pragma: no branch (a limit, not a plan)
        lens = distort("brown", parameters[4:], now[:, 0], now[:, 1])
        miss = np.stack([lens.x, lens.y], axis=-1) - wanted
        allowed = _TOLERANCE_PX + _ROUNDING * np.abs(wanted * parameters[:2])
        done = (np.abs(miss) * parameters[:2] <= allowed).all(axis=1)
        good = done & ~is_folded(lens, now[:, 0], now[:, 1], largest)
        point[index[good]] = now[good]
        # Newton step by the symmetric 2x2 Jacobian, where its determinant is positive.
        determinant = lens.a * lens.c - lens.b * lens.b
        going = ~done & (determinant > 0)
        if not going.any():
            break
        step = np.stack(
            [
                lens.c * miss[:, 0] - lens.b * miss[:, 1],
                lens.a * miss[:, 1] - lens.b * miss[:, 0],
            ],
            axis=-1,
        )
        step = step[going] / determinant[going, None]
        index, wanted, miss, now = index[going], wanted[going], miss[going], now[going]
        now, improved = _damped_step(parameters, wanted, now, (step, miss), largest)
        index, wanted, now = index[improved], wanted[improved], now[improved]
    return point


def _damped_step(
    parameters: Floats,
    wanted: Floats,
    now: Floats,
    step_and_miss: tuple[Floats, Floats],
    largest: float,
) -> tuple[Floats, Bools]:
    """Take Newton's step, halved until the misfit shrinks; return points and success flags."""
    step, miss = step_and_miss
    before = np.sum(miss * miss, axis=1)
    size = np.ones(len(now))
    improved = np.zeros(len(now), bool)
    trial = now.copy()
    for _ in range(_HALVINGS):
        left = np.flatnonzero(~improved)
        if not len(left):
            break
        trial[left] = _inside(now[left] - size[left, None] * step[left], largest)
        lens = distort("brown", parameters[4:], trial[left, 0], trial[left, 1])
        after = (lens.x - wanted[left, 0]) ** 2 + (lens.y - wanted[left, 1]) ** 2
        improved[left] = after < before[left]
        size[left] *= 0.5
    return trial, improved


def _inside(point: Floats, largest: float) -> Floats:
    """Move points that are farther than `largest` from the axis back to that radius."""
    if not np.isfinite(largest):
        return point
    radius = np.hypot(point[:, 0], point[:, 1])
    return np.asarray(point * (largest / np.maximum(radius, largest))[:, None])


def share_without_rays(
    model: LensModel, parameters: Floats, width_px: int, height_px: int
) -> float:
    """Compute the share of an image (0 to 1) whose pixels have no ray.

    There the lens model folds back: two directions share a pixel, or none reaches it. The share is
    counted on a grid of about 40,000 cells.

    Parameters
    ----------
    model, parameters
        Lens model; (P,) its parameters.
    width_px, height_px
        Size of the image.
    """
    ratio = (width_px / height_px) ** 0.5
    columns, rows = max(1, round(200 * ratio)), max(1, round(200 / ratio))
    u = (np.arange(columns) + 0.5) * width_px / columns - 0.5
    v = (np.arange(rows) + 0.5) * height_px / rows - 0.5
    ray = back_project(model, parameters, np.stack(np.meshgrid(u, v), axis=-1))
    return float(np.isnan(ray[..., 0]).mean())


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
