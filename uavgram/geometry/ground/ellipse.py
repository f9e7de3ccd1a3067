"""Error ellipses of 2x2 covariances in the ground plane, and ellipsoids of 3x3 in space."""

from __future__ import annotations

import math

import numpy as np

from uavgram.model.arrays import Floats

#: Half-axes of the 95 % error ellipse in standard deviations: the root of the chi-square quantile
#: with two degrees of freedom, -2 ln(1 - 0.95) in closed form; 2.4477.
ELLIPSE_95 = math.sqrt(-2 * math.log(0.05))

#: Half-axes of the 95 % error ellipsoid in standard deviations: the same with three degrees of
#: freedom; 2.7955.
ELLIPSOID_95 = math.sqrt(7.814727903251179)

# Part of the larger eigenvalue by which the smaller one may be negative through rounding.
_ROUNDING = 1e-9


def error_ellipse(covariance: Floats) -> tuple[Floats, Floats, Floats]:
    """Compute half-axes and direction of one-sigma error ellipses.

    Parameters
    ----------
    covariance
        (..., 2, 2) of (east, north) [m2]; symmetric.

    Returns
    -------
    semi_major, semi_minor : (...)
        Standard deviations along the axes [m]. NaN where the matrix is not a covariance; an
        eigenvalue that is negative by rounding counts as zero.
    azimuth_rad : (...)
        Direction of the major axis, clockwise from north, in [0, pi); 0 for a circle.
    """
    covariance = np.asarray(covariance, np.float64)
    east, north = covariance[..., 0, 0], covariance[..., 1, 1]
    both = 0.5 * (covariance[..., 0, 1] + covariance[..., 1, 0])
    # Eigenvalues of the symmetric 2x2 matrix in closed form: mean +- radius.
    mean = 0.5 * (east + north)
    radius = np.hypot(0.5 * (north - east), both)
    major, minor = mean + radius, mean - radius
    valid = (major >= 0) & (minor >= -_ROUNDING * major)
    # tan(2 azimuth) = 2 s_en / (s_nn - s_ee): Mikhail and Gracie (1981), with the angle from north
    azimuth = 0.5 * np.arctan2(2 * both, north - east)
    azimuth = np.where(azimuth < 0, azimuth + np.pi, azimuth)
    azimuth = np.where(azimuth < np.pi, azimuth, 0.0)  # -tiny + pi rounds to pi
    semi_major = np.sqrt(np.where(valid, major, np.nan))
    semi_minor = np.sqrt(np.where(valid, np.maximum(minor, 0.0), np.nan))
    return semi_major, semi_minor, np.asarray(np.where(valid, azimuth, np.nan))


def error_ellipsoid(covariance: Floats) -> tuple[Floats, Floats]:
    """Compute half-axes and directions of one-sigma error ellipsoids.

    Parameters
    ----------
    covariance
        (..., 3, 3) of (east, north, up) [m2]; symmetric.

    Returns
    -------
    half_axes : (..., 3)
        Standard deviations along the axes, the largest first [m].
    directions : (..., 3, 3)
        Unit vectors along the axes as columns, a right-handed frame: a rotation.
    """
    variance, axes = np.linalg.eigh(covariance)
    directions = axes[..., ::-1].copy()
    directions[..., 2] *= np.sign(np.linalg.det(directions))[..., None]
    return np.sqrt(np.maximum(variance[..., ::-1], 0.0)), directions
