"""WGS 84 latitude, longitude and ellipsoidal height to local east-north-up, and back (PROJ)."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike
from pyproj import Transformer
from pyproj.enums import TransformDirection

from uavgram.model.arrays import Bools, Floats

Origin = tuple[float, float, float]
Places = tuple[ArrayLike, ArrayLike]

EARTH_RADIUS_M = 6_371_000.0
"""Mean radius: for what the earth's curvature does over some kilometres."""

SAME_SITE_M = 20_000.0
"""Farther apart, two places are not of one flight: over this the ground falls 31 m below the
horizontal plane."""

_BESIDE_M, _CLEAR = 2_000.0, 5.0
"""Nearer, a place is exchanged only if it is beside the flight, and so many times nearer with x
and y exchanged: eastings and northings of some national grids resemble each other."""


def curvature_drop(distance_m: float) -> float:
    """How far the ground at a distance lies below the horizontal plane here [m]: d^2 / 2R."""
    return distance_m**2 / (2.0 * EARTH_RADIUS_M)


def enu_from_geodetic(
    latitude_deg: ArrayLike, longitude_deg: ArrayLike, height_m: ArrayLike, origin: Origin
) -> Floats:
    """Turn geodetic coordinates into local ones.

    Parameters
    ----------
    latitude_deg, longitude_deg, height_m
        (N,) each, WGS 84, heights in the origin's datum (of an undulation that scene
        and origin share, 5 parts per million of the distances remain for each 30 m).
    origin
        Latitude [deg], longitude [deg], height [m] of the local origin.

    Returns
    -------
    (N, 3)
        East, north, up [m] in the tangent plane at the origin: over 1 km the earth falls 8 cm
        below it. NaN where the input is no place on earth.
    """
    latitude, longitude, height = np.broadcast_arrays(latitude_deg, longitude_deg, height_m)
    east, north, up = _to_enu(origin).transform(longitude, latitude, height)
    return _finite_or_nan(np.stack([east, north, up], axis=-1))


EXCHANGED = (
    "is far from where the photos were taken, and near it with latitude and longitude (y and x) "
    "exchanged"
)
"""What is wrong with such a place, after its name or line."""


def are_exchanged(stated: Places, turned: Places, site: Origin) -> Bools:
    """Tell which places (N,) cannot be of the flight at `site`, but could with x and y exchanged.

    Parameters
    ----------
    stated, turned
        Latitudes and longitudes (N,) [deg] as they are stated, and with x and y exchanged.
    site
        Where the flight was.
    """
    away_m, turned_away_m = (
        np.nan_to_num(np.linalg.norm(enu_from_geodetic(*one, 0.0, site), axis=-1), nan=np.inf)
        for one in (stated, turned)
    )
    far = (away_m > SAME_SITE_M) | (away_m > np.maximum(_CLEAR * turned_away_m, _BESIDE_M))
    return np.asarray(far & (turned_away_m < SAME_SITE_M))


def geodetic_from_enu(enu: Floats, origin: Origin) -> tuple[Floats, Floats, Floats]:
    """Turn local coordinates into geodetic ones.

    Parameters
    ----------
    enu
        (N, 3) east, north, up [m].
    origin
        Latitude [deg], longitude [deg], height [m] of the local origin.

    Returns
    -------
    latitude_deg, longitude_deg, height_m : (N,)
        WGS 84, height in the origin's datum; NaN where the input is.
    """
    east, north, up = np.asarray(enu, np.float64).T
    longitude, latitude, height = _to_enu(origin).transform(
        east, north, up, direction=TransformDirection.INVERSE
    )
    return _finite_or_nan(latitude), _finite_or_nan(longitude), _finite_or_nan(height)


@lru_cache(maxsize=16)
def _to_enu(origin: Origin) -> Transformer:
    """Geodetic (lon, lat in degrees, h) to topocentric: closed formulas, no grids, no network."""
    latitude, longitude, height = origin
    # .17g: the origin to its last digit
    return Transformer.from_pipeline(
        "+proj=pipeline +step +proj=cart +ellps=WGS84 +step +proj=topocentric +ellps=WGS84 "
        f"+lat_0={latitude:.17g} +lon_0={longitude:.17g} +h_0={height:.17g}"
    )


def _finite_or_nan(values: Floats) -> Floats:
    """PROJ marks a failure by infinity."""
    values = np.asarray(values, np.float64)
    return np.asarray(np.where(np.isfinite(values), values, np.nan))
