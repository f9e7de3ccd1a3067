"""Geodetic, local and projected coordinates."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike
from pyproj import CRS, Proj, Transformer
from pyproj.enums import TransformDirection
from pyproj.exceptions import CRSError

from uavgram.errors import GeometryError
from uavgram.model.arrays import Bools, Floats

Origin = tuple[float, float, float]
Places = tuple[ArrayLike, ArrayLike]

EARTH_RADIUS_M = 6_371_000.0
"""Mean earth radius, for the effect of the curvature over some kilometres."""

SAME_SITE_M = 20_000.0
"""Distance beyond which two places cannot belong to one flight.

At this distance the ground is 31 m below the horizontal plane.
"""

_BESIDE_M, _CLEAR = 2_000.0, 5.0
"""Limits within `SAME_SITE_M` for taking a place as one with x and y exchanged.

Such a place must be farther from the flight than `_BESIDE_M`, and than `_CLEAR` times its distance
after the exchange: eastings and northings of some national grids resemble each other.
"""


def curvature_drop(distance_m: float) -> float:
    """Compute by how much [m] the curved ground drops over a distance: d^2 / 2R."""
    return distance_m**2 / (2.0 * EARTH_RADIUS_M)


def enu_from_geodetic(
    latitude_deg: ArrayLike, longitude_deg: ArrayLike, height_m: ArrayLike, origin: Origin
) -> Floats:
    """Convert geodetic coordinates to local ones.

    Parameters
    ----------
    latitude_deg, longitude_deg, height_m
        (N,) each, WGS 84, heights in the origin's datum (an undulation that scene and origin share
        changes distances by 5 parts per million for each 30 m).
    origin
        Latitude [deg], longitude [deg], height [m] of the local origin.

    Returns
    -------
    (N, 3)
        East, north, up [m] in the tangent plane at the origin: over 1 km the earth falls 8 cm below
        it. NaN where the input is not a place on earth.
    """
    latitude, longitude, height = np.broadcast_arrays(latitude_deg, longitude_deg, height_m)
    east, north, up = _make_enu_transformation(origin).transform(longitude, latitude, height)
    return _finite_or_nan(np.stack([east, north, up], axis=-1))


AXES_EXCHANGED = (
    "is far from where the photos were taken, and near it with latitude and longitude (y and x) "
    "exchanged"
)
"""Text of the message about such a place, to follow its name or line."""


def are_axes_exchanged(stated: Places, turned: Places, site: Origin) -> Bools:
    """Mark the places (N,) that can belong to the flight at `site` only with x and y exchanged.

    Parameters
    ----------
    stated, turned
        Latitudes and longitudes (N,) [deg] as stated, and with x and y exchanged.
    site
        Place of the flight.
    """
    away_m, turned_away_m = (
        np.nan_to_num(np.linalg.norm(enu_from_geodetic(*one, 0.0, site), axis=-1), nan=np.inf)
        for one in (stated, turned)
    )
    far = (away_m > SAME_SITE_M) | (away_m > np.maximum(_CLEAR * turned_away_m, _BESIDE_M))
    return np.asarray(far & (turned_away_m < SAME_SITE_M))


def geodetic_from_enu(enu: Floats, origin: Origin) -> tuple[Floats, Floats, Floats]:
    """Convert local coordinates to geodetic ones.

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
    longitude, latitude, height = _make_enu_transformation(origin).transform(
        east, north, up, direction=TransformDirection.INVERSE
    )
    return _finite_or_nan(latitude), _finite_or_nan(longitude), _finite_or_nan(height)


@lru_cache(maxsize=16)
def _make_enu_transformation(origin: Origin) -> Transformer:
    """Create the transformation from geodetic (lon, lat in degrees, h) to topocentric coordinates.

    Closed formulas: it needs neither grids nor a network.
    """
    latitude, longitude, height = origin
    # .17g: the origin to its last digit
    return Transformer.from_pipeline(
        "+proj=pipeline +step +proj=cart +ellps=WGS84 +step +proj=topocentric +ellps=WGS84 "
        f"+lat_0={latitude:.17g} +lon_0={longitude:.17g} +h_0={height:.17g}"
    )


def _finite_or_nan(values: Floats) -> Floats:
    """Replace infinity, PROJ's mark of a failure, by NaN."""
    values = np.asarray(values, np.float64)
    return np.asarray(np.where(np.isfinite(values), values, np.nan))


# Latitudes covered by UTM; beyond them maps use the polar stereographic projections.
_UTM_SOUTH_DEG, _UTM_NORTH_DEG = -80.0, 84.0
MAX_SCALE_ERROR = 0.01
"""Largest relative scale error of a map; the zones used by surveyors stay below 0.001."""


def utm_crs(latitude_deg: float, longitude_deg: float) -> str:
    """Return the EPSG code of the UTM zone (WGS 84) of a place; UPS near the poles.

    UPS is the polar stereographic projection. The zones of Norway and Svalbard are the widened ones
    of the UTM standard (DMA TM 8358.2, 1989, section 2-3).
    """
    longitude = (longitude_deg + 180.0) % 360.0 - 180.0
    if latitude_deg >= _UTM_NORTH_DEG:
        return "EPSG:32661"
    if latitude_deg < _UTM_SOUTH_DEG:
        return "EPSG:32761"
    zone = int((longitude + 180.0) // 6.0) + 1
    if 56.0 <= latitude_deg < 64.0 and 3.0 <= longitude < 12.0:
        zone = 32
    elif latitude_deg >= 72.0 and 0.0 <= longitude < 42.0:
        zone = 31 + 2 * int((longitude + 3.0) // 12.0)
    return f"EPSG:{32600 + zone if latitude_deg >= 0 else 32700 + zone}"


def normalise_crs(text: str) -> str:
    """Return the coordinate system's name in PROJ's form, if it suits maps in metres.

    Raises
    ------
    GeometryError
        PROJ does not know it, or it is not a projected one in metres.
    """
    try:
        crs = CRS.from_user_input(text)
    except CRSError as fault:
        raise GeometryError(f"unknown coordinate system {text!r}: {fault}") from fault
    if not crs.is_projected or any(axis.unit_name != "metre" for axis in crs.axis_info[:2]):
        raise GeometryError(
            f"{text!r} ({crs.name}) is no projected coordinate system in metres; take such as "
            "EPSG:25832, or auto for the UTM zone"
        )
    return str(crs.to_string())


def explain_unsuitable_crs(text: str, latitude_deg: float, longitude_deg: float) -> str:
    """Explain why a coordinate system does not suit maps of a place; empty where it does.

    Parameters
    ----------
    text
        A coordinate system that `normalise_crs` accepts.
    latitude_deg, longitude_deg
        Place, on WGS 84.

    Returns
    -------
    str
        Message that the place is outside the system's area of use, or that the map scale there
        differs from 1 by more than `MAX_SCALE_ERROR`; and a system that fits.
    """
    crs, fitting = CRS.from_user_input(text), utm_crs(latitude_deg, longitude_deg)
    area = crs.area_of_use
    found = Proj(crs).get_factors(longitude_deg, latitude_deg)
    scale = max(found.tissot_semimajor, found.tissot_semiminor, key=lambda axis: abs(axis - 1.0))
    if area is not None and not _is_within(area.bounds, latitude_deg, longitude_deg):
        why = (
            f"is made for latitude {area.south:.2f} to {area.north:.2f}, longitude {area.west:.2f} "
            f"to {area.east:.2f} (where your agency uses it beyond, give its definition, such as "
            '"+proj=utm +zone=32 +ellps=GRS80")'
        )
    elif not abs(scale - 1.0) <= MAX_SCALE_ERROR:  # infinite where the projection ends
        why = f"shows a metre on the ground as {scale:.3f} m at the site"
    else:
        return ""
    return (
        f"{text!r} ({crs.name}) {why}; the site is at {latitude_deg:.2f}, "
        f"{longitude_deg:.2f}. Take {fitting} ({CRS.from_user_input(fitting).name}), or "
        "`crs: auto`, which finds it"
    )


def _is_within(bounds: tuple[float, ...], latitude_deg: float, longitude_deg: float) -> bool:
    """Return whether a place is in an area, which may cross the 180th meridian.

    An area may also go round the earth.
    """
    west, south, east, north = bounds
    width = (east - west) % 360.0 or 360.0
    return south <= latitude_deg <= north and (longitude_deg - west) % 360.0 <= width


def mark_within_area(crs: CRS, latitude_deg: Floats, longitude_deg: Floats) -> Bools:
    """Mark the places that are in a coordinate system's area of use.

    Parameters
    ----------
    crs
        Coordinate system; if it has no area of use, all places are in it.
    latitude_deg, longitude_deg
        (N,) places, on WGS 84 [deg].
    """
    area = crs.area_of_use
    places = zip(latitude_deg.tolist(), longitude_deg.tolist(), strict=True)
    return np.array([area is None or _is_within(area.bounds, *place) for place in places])


def exchange_axes(latitude_deg: Floats, longitude_deg: Floats, crs: str) -> tuple[Floats, Floats]:
    """Compute the places (N,) [deg] that result when easting and northing are exchanged.

    Parameters
    ----------
    latitude_deg, longitude_deg
        (N,) places before the exchange, on WGS 84.
    crs
        A projected coordinate system.
    """
    easting, northing = _make_map_transformation(crs).transform(longitude_deg, latitude_deg)
    longitude, latitude = geographic_from_projected(np.stack([northing, easting], axis=-1), crs)
    return latitude, longitude


def projected_from_enu(enu_m: Floats, origin: Origin, crs: str) -> Floats:
    """Project local coordinates to a map.

    Parameters
    ----------
    enu_m
        (N, 3) east, north, up [m] about `origin`.
    origin
        Latitude [deg], longitude [deg], height [m] of the local zero.
    crs
        A projected coordinate system.

    Returns
    -------
    (N, 3)
        Easting, northing [m] in this order for any axis order of `crs`, height in the origin's
        datum. Distances on the map are ground distances times the scale of the projection (in UTM
        0.9996 at the central meridian).
    """
    latitude, longitude, height = geodetic_from_enu(enu_m, origin)
    easting, northing = _make_map_transformation(crs).transform(longitude, latitude)
    return np.stack([easting, northing, height], axis=-1).reshape(-1, 3)


def geographic_from_projected(projected_m: Floats, crs: str) -> tuple[Floats, Floats]:
    """Compute longitudes and latitudes (N,) [deg] of places on the map (N, 2) [m]."""
    east, north = projected_m.T
    longitude, latitude = _make_map_transformation(crs).transform(east, north, direction="INVERSE")
    return longitude, latitude


def map_scale(origin: Origin, crs: str) -> float:
    """Compute the map scale at the origin: map distance over ground distance."""
    step = 1.0
    around = np.array([[0.0, 0.0, 0.0], [step, 0.0, 0.0], [0.0, step, 0.0]])
    placed = projected_from_enu(around, origin, crs)[:, :2]
    lengths = np.linalg.norm(placed[1:] - placed[0], axis=1)
    return float(np.sqrt(lengths[0] * lengths[1])) / step


@lru_cache(maxsize=16)
def _make_map_transformation(crs: str) -> Transformer:
    """Create the transformation from longitude and latitude on WGS 84 to easting and northing."""
    return Transformer.from_crs("EPSG:4326", crs, always_xy=True)
