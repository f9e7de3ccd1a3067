"""points.geojson: ground points, their 95 % ellipses and measured lines (RFC 7946)."""

from __future__ import annotations

import json
from collections.abc import Iterable
from pathlib import Path

import numpy as np
from pyproj import Geod

from uavgram.io.outputs import replace_text
from uavgram.io.results.codec import Record, records
from uavgram.model.arrays import Floats
from uavgram.model.result.result import Result
from uavgram.model.result.tables import MeasurementResults, PointResults

Geometry = Record | None

VERTICES = 36  # of an ellipse: its area is short of the curve's by 0.5 %

_OPEN = {
    "distance",
    "polyline",
    "skid_speed",
    "speed",
    "angle",
    "horizontal_distance",
    "vertical_distance",
    "slope",
    "profile",
    "height",
}
_NO_PLACE = (
    "The result has no geographic position (nothing ties its world to the earth, such as a flight "
    "log), so it cannot be drawn on a map. The local coordinates are in results.json."
)


def write_geojson(result: Result, path: str | Path) -> None:
    """Write points.geojson.

    Raises
    ------
    OutputError
        The file cannot be written.
    """
    replace_text(Path(path), dump_geojson(result))


def dump_geojson(result: Result) -> str:
    """Write ground points, ellipses and measurements as a FeatureCollection, one feature a line.

    Positions are [longitude, latitude] in degrees. They have no third number, because RFC 7946
    wants a height above the ellipsoid there; `up_m` is a property.
    """
    members: Record = {"type": "FeatureCollection", "name": result.name}
    features: list[Record] = []
    if result.world.gauge == "plane" or result.world.origin is None:
        members["message"] = _NO_PLACE
    else:
        features = _points(result.points) + _ellipses(result.points)
        features += _measurements(result.measurements, result.points)
    head = json.dumps(members, ensure_ascii=False, allow_nan=False)[:-1]
    lines = (json.dumps(f, ensure_ascii=False, allow_nan=False) for f in features)
    body = "\n" + ",\n".join(lines) + "\n" if features else ""
    return f'{head}, "features": [{body}]}}\n'


def _features(what: str, geometries: Iterable[Geometry], /, **columns: object) -> list[Record]:
    """Shapes with their properties: columns of N values by name."""
    return [
        {"type": "Feature", "geometry": geometry, "properties": {"type": what, **row}}
        for geometry, row in zip(geometries, records(**columns), strict=True)
    ]


def _points(points: PointResults) -> list[Record]:
    east_m, north_m, up_m = points.position_world_m.T
    sigma_east_m, sigma_north_m = np.sqrt(np.diagonal(points.covariance_m2, axis1=1, axis2=2)).T
    return _features(
        "point",
        ({"type": "Point", "coordinates": place} for place in _lonlat(points).tolist()),
        label=points.label,
        east_m=east_m,
        north_m=north_m,
        up_m=up_m,
        sigma_east_m=sigma_east_m,
        sigma_north_m=sigma_north_m,
        covariance_m2=points.covariance_m2,
        semi_major_95_m=points.ellipse_95_m[:, 0],
        semi_minor_95_m=points.ellipse_95_m[:, 1],
        azimuth_deg=np.rad2deg(points.ellipse_azimuth_rad),
        frames=points.frames,
    )


def _ellipses(points: PointResults) -> list[Record]:
    return _features(
        "ellipse_95",
        ({"type": "Polygon", "coordinates": [ring]} for ring in _ellipse_rings(points).tolist()),
        label=points.label,
        semi_major_m=points.ellipse_95_m[:, 0],
        semi_minor_m=points.ellipse_95_m[:, 1],
    )


def _ellipse_rings(points: PointResults) -> Floats:
    """(K, VERTICES + 1, 2) closed rings of [longitude, latitude], counterclockwise."""
    angle = np.linspace(0.0, 2.0 * np.pi, VERTICES + 1)
    major = points.ellipse_95_m[:, :1] * np.cos(angle)
    minor = points.ellipse_95_m[:, 1:] * np.sin(angle)  # to the left of the major axis
    distance_m = np.hypot(major, minor)
    azimuth_rad = points.ellipse_azimuth_rad[:, None] - np.arctan2(minor, major)
    start = np.broadcast_to(_lonlat(points)[:, None, :], (*distance_m.shape, 2))
    longitude, latitude, _ = Geod(ellps="WGS84").fwd(
        start[..., 0].ravel(),
        start[..., 1].ravel(),
        np.rad2deg(azimuth_rad).ravel(),
        distance_m.ravel(),
    )
    rings = np.stack([longitude, latitude], axis=-1).reshape(*distance_m.shape, 2)
    rings[:, -1] = rings[:, 0]  # exactly closed
    return rings


def _measurements(measurements: MeasurementResults, points: PointResults) -> list[Record]:
    place = dict(zip(points.label, _lonlat(points).tolist(), strict=True))
    shapes = zip(measurements.kind, measurements.outlines, strict=True)
    return _features(
        "measurement",
        (_geometry(kind, [place.get(label) for label in labels]) for kind, labels in shapes),
        name=measurements.name,
        kind=measurements.kind,
        points=measurements.points,
        value=measurements.value,
        sigma=measurements.sigma,
        unit=measurements.unit,
        lower_95=measurements.interval_95[:, 0],
        upper_95=measurements.interval_95[:, 1],
        alternative_values=measurements.alternative_values,
    )


def _geometry(kind: str, lonlat: list[list[float] | None]) -> Geometry:
    """Shape of a measurement; None where a point has no position (an "unlocated" feature)."""
    known = [position for position in lonlat if position is not None]
    if len(known) < len(lonlat):
        return None
    if kind in {"coordinate", "plane_distance"} or len(known) == 1:
        return {"type": "Point", "coordinates": known[0]}
    if kind in {"area", "volume"}:
        return {"type": "Polygon", "coordinates": [_counterclockwise([*known, known[0]])]}
    if kind == "line_distance":  # from the first point to its foot on the line of the others
        return {"type": "LineString", "coordinates": [known[0], _foot(known)]}
    if kind in _OPEN:
        return {"type": "LineString", "coordinates": known}
    raise ValueError(f"no shape for a measurement of kind {kind!r}")


def _counterclockwise(ring: list[list[float]]) -> list[list[float]]:
    x, y = np.array(ring).T - np.array(ring[0])[:, None]
    is_clockwise = float(np.sum(x[:-1] * y[1:] - x[1:] * y[:-1])) < 0
    return ring[::-1] if is_clockwise else ring


def _foot(lonlat: list[list[float]]) -> list[float]:
    """Foot of the perpendicular from the first position on the line through the next two."""
    point, start, end = np.array(lonlat[:3])
    # Degrees of longitude are shorter than those of latitude by the cosine of the latitude.
    scale = np.array([np.cos(np.deg2rad(point[1])), 1.0])
    along, to_point = (end - start) * scale, (point - start) * scale
    fraction = float(along @ to_point / (along @ along)) if along.any() else 0.0
    foot: list[float] = (start + fraction * (end - start)).tolist()
    return foot


def _lonlat(points: PointResults) -> Floats:
    return np.stack([points.longitude_deg, points.latitude_deg], axis=1)
