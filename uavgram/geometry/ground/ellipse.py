"""Error ellipses of 2x2 covariances in the ground plane."""

from __future__ import annotations

import math

import numpy as np

from uavgram.model.arrays import Floats

#: Half-axes of the ellipse that holds a point with 95 %, in standard deviations: the root of the
#: chi-square quantile with two degrees of freedom, -2 ln(1 - 0.95) in closed form; 2.4477.
ELLIPSE_95 = math.sqrt(-2 * math.log(0.05))

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
