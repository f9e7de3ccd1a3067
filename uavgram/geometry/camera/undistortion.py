"""Undistorted points of distorted ones, fast: the case of nearly every pixel of a real camera.

A table gives the radial factor to seven digits, two or three Newton steps over whole arrays the
rest. What does not come to rest, or lies at or beyond the fold, is left to the careful search in
`back_projection`.
"""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import numpy as np

from uavgram.geometry.camera.lens import Distorted, distort, fold_argument, radial_coefficients
from uavgram.model.arrays import Bools, Floats
from uavgram.model.camera.calibration import LensModel

_NODES = 4096
_LARGE_TANGENTIAL = 1e-2
"""p1 or p2 from which the start is so much coarser that a third step is due."""

_LAST_STEP = 1e-7
"""Newton step after which none is due: the error goes with its square, 1e-14 away from the fold."""

_LEAST_DETERMINANT = 0.05
"""Of the lens's Jacobian: below, the fold is too near for that."""

_SAFE = 0.95
"""Share of the way to the fold up to which the table reaches."""

_WIDEST: dict[LensModel, float] = {"brown": 1.6, "fisheye": 4.0}
"""Undistorted radius up to which it does: 58 and 76 degrees from the optical axis. Farther out a
polynomial may grow so fast that the nodes would lie too far apart everywhere."""


class _Table(NamedTuple):
    """Factors undistorted / distorted radius over equal steps of the distorted radius squared."""

    factor: Floats
    slope: Floats
    per_square: float
    end_square: float


class Undistorted(NamedTuple):
    """Undistorted points, and the lens at them.

    Attributes
    ----------
    x, y
        (N,).
    lens
        What `distort` makes of them, to seven digits (it belongs to the step before the last).
    found
        (N,) whether they are, on the near side of the fold.
    """

    x: Floats
    y: Floats
    lens: Distorted
    found: Bools


def undistort(
    model: LensModel, parameters: Floats, target_x: Floats, target_y: Floats
) -> Undistorted:
    """Invert the lens at points (N,) of the plane z = 1; where it fails, `found` is False.

    Parameters
    ----------
    model, parameters
        The lens; (P,).
    target_x, target_y
        Distorted coordinates.
    """
    table = _table(model, parameters[4:].tobytes())
    x, y = _radial_inverse(table, target_x, target_y)
    if model == "brown" and parameters[6:8].any():
        # What the tangential part adds at that first guess is taken off beforehand.
        p1, p2 = parameters[6:8].tolist()
        square = x * x + y * y
        common = (2 * p1) * y + (2 * p2) * x
        x, y = _radial_inverse(
            table, target_x - (x * common + p2 * square), target_y - (y * common + p1 * square)
        )
    # As many steps for every point, whatever else is asked for along with it.
    for _ in range(_steps(model, parameters)):
        lens = distort(model, parameters[4:], x, y)
        miss_x, miss_y = lens.x - target_x, lens.y - target_y
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
    """Points undistorted by the radial part alone; NaN where the table does not reach."""
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
    """Table of the radial part alone, up to a little before its fold."""
    values = np.frombuffer(coefficients)
    argument = np.linspace(0.0, _reach(model, values), 4 * _NODES)
    distorted = _radial(model, values, argument)
    radius = argument if model == "brown" else np.tan(argument)
    end = float(distorted[-1] ** 2)
    square = np.linspace(0.0, end, _NODES + 1)
    factor = np.ones(_NODES + 1)
    # Between the nodes of a fine grid the inverse is straight to eight digits.
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
