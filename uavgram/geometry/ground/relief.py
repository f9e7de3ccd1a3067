"""How ground departs from a plane, smoothly: functions of the place, and their derivatives."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import scipy.linalg

from uavgram.model.arrays import Floats

JITTER = 1e-9
"""Added to the knots' covariance, so that knots close together do no harm."""


class Basis(NamedTuple):
    """B functions at n places: (n, B) values and (n, B, 2) derivatives to east and north [1/m].

    A function's coefficient is a height in metres.
    """

    value: Floats
    gradient: Floats


def quadratic_basis(east_north_m: Floats, middle_m: Floats, scale_m: float) -> Basis:
    """Squares and product of the distances east and north: a crown, a hollow, a saddle.

    Parameters
    ----------
    east_north_m
        (n, 2) places.
    middle_m
        (2,) where all three are zero, and level.
    scale_m
        Distance from the middle at which the squares are one.
    """
    east, north = ((east_north_m - middle_m) / scale_m).T
    none = np.zeros(len(east))
    value = np.stack([east**2, 2.0 * east * north, north**2], axis=1)
    by_east = np.stack([2.0 * east, 2.0 * north, none], axis=1)
    by_north = np.stack([none, 2.0 * east, 2.0 * north], axis=1)
    return Basis(value, np.stack([by_east, by_north], axis=2) / scale_m)


def correlated_basis(east_north_m: Floats, knots_m: Floats, range_m: float) -> Basis:
    """Functions whose independent coefficients make heights that go together within a range.

    With coefficients of unit variance the heights at the knots have the covariance
    exp(-d^2 / (2 range^2)) of their distances d; between knots, its interpolation.

    Parameters
    ----------
    east_north_m
        (n, 2) places.
    knots_m
        (B, 2) places of the knots.
    range_m
        Distance over which heights go together.

    References
    ----------
    Quinonero-Candela and Rasmussen 2005, "A unifying view of sparse approximate Gaussian process
    regression", eq. 17: the subset of regressors k(x, Z) k(Z, Z)^-1 k(Z, x).
    """
    lower = np.linalg.cholesky(_kernel(knots_m, knots_m, range_m) + JITTER * np.eye(len(knots_m)))
    kernel = _kernel(east_north_m, knots_m, range_m)
    apart = (knots_m[None] - east_north_m[:, None]) / range_m**2
    stacked = np.concatenate([kernel[..., None], kernel[..., None] * apart], axis=2)
    flat = np.moveaxis(stacked, 1, 0).reshape(len(knots_m), -1)
    solved = scipy.linalg.solve_triangular(lower, flat, lower=True, check_finite=False)
    basis = np.moveaxis(solved.reshape(len(knots_m), len(east_north_m), 3), 0, 1)
    return Basis(basis[..., 0], basis[..., 1:])


def spread_knots(east_north_m: Floats, most: int) -> Floats:
    """(B, 2) of the places, at most `most`, each as far as can be from those before it.

    Parameters
    ----------
    east_north_m
        (n, 2) places.
    most
        Number of knots.

    References
    ----------
    Gonzalez 1985, "Clustering to minimize the maximum intercluster distance": the farthest next.
    """
    middle = east_north_m.mean(axis=0)
    first = int(np.argmin(np.sum((east_north_m - middle) ** 2, axis=1)))
    chosen = [first]
    distance = np.linalg.norm(east_north_m - east_north_m[first], axis=1)
    while len(chosen) < min(most, len(east_north_m)) and distance.max() > 0:
        chosen.append(int(distance.argmax()))
        new = np.linalg.norm(east_north_m - east_north_m[chosen[-1]], axis=1)
        distance = np.minimum(distance, new)
    return np.asarray(east_north_m[chosen])


def _kernel(a: Floats, b: Floats, range_m: float) -> Floats:
    square = np.sum((a[:, None] - b[None]) ** 2, axis=2)
    return np.asarray(np.exp(-0.5 * square / range_m**2))
