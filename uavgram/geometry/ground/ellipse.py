"""Error ellipses of 2x2 covariances in the ground plane, and ellipsoids of 3x3 in space."""

from __future__ import annotations

import math

import numpy as np

from uavgram.model.arrays import Floats

#: Half-axes of the ellipse that holds a point with 95 %, in standard deviations: the root of the
#: chi-square quantile with two degrees of freedom, -2 ln(1 - 0.95) in closed form; 2.4477.
ELLIPSE_95 = math.sqrt(-2 * math.log(0.05))

#: The same of the ellipsoid: with three degrees of freedom; 2.7955.
ELLIPSOID_95 = math.sqrt(7.814727903251179)

# A smaller eigenvalue negative by more than this part of the larger one is no rounding error.
_ROUNDING = 1e-9


def error_ellipse(covariance: Floats) -> tuple[Floats, Floats, Floats]:
    """Half-axes and direction of one-sigma error ellipses.

    Parameters
    ----------
    covariance
        (..., 2, 2) of (east, north) [m2]; symmetric.

    Returns
    -------
    semi_major, semi_minor : (...)
        Standard deviations along the axes [m]. NaN where the matrix is no covariance; an
        eigenvalue negative by rounding counts as zero.
    azimuth_rad : (...)
        Of the major axis, clockwise from north, in [0, pi); 0 for a circle.
    """
    covariance = np.asarray(covariance, np.float64)
    east, north = covariance[..., 0, 0], covariance[..., 1, 1]
    both = 0.5 * (covariance[..., 0, 1] + covariance[..., 1, 0])
    mean = 0.5 * (east + north)
    radius = np.hypot(0.5 * (north - east), both)
    major, minor = mean + radius, mean - radius
    valid = (major >= 0) & (minor >= -_ROUNDING * major)
    # tan(2 azimuth) = 2 s_en / (s_nn - s_ee): Mikhail and Gracie (1981), with the angle from north
    azimuth = 0.5 * np.arctan2(2 * both, north - east)
    azimuth = np.where(azimuth < 0, azimuth + np.pi, azimuth)
    azimuth = np.where(azimuth < np.pi, azimuth, 0.0)  # -tiny + pi, and -0 turned by half
    semi_major = np.sqrt(np.where(valid, major, np.nan))
    semi_minor = np.sqrt(np.where(valid, np.maximum(minor, 0.0), np.nan))
    return semi_major, semi_minor, np.asarray(np.where(valid, azimuth, np.nan))


def error_ellipsoid(covariance: Floats) -> tuple[Floats, Floats]:
    """Half-axes and directions of one-sigma error ellipsoids.

    Parameters
    ----------
    covariance
        (..., 3, 3) of (east, north, up) [m2]; symmetric.

    Returns
    -------
    half_axes : (..., 3)
        Standard deviations along the axes, the largest first [m].
    directions : (..., 3, 3)
        Unit vectors along them as columns, a right-handed frame: a rotation.
    """
    variance, axes = np.linalg.eigh(covariance)
    directions = axes[..., ::-1].copy()
    directions[..., 2] *= np.sign(np.linalg.det(directions))[..., None]
    return np.sqrt(np.maximum(variance[..., ::-1], 0.0)), directions
