"""Writers of maps in degrees: points.geojson and GeoJSON (RFC 7946), survey.kml (OGC KML 2.3)."""

from __future__ import annotations

import json
import math
from collections.abc import Iterable
from pathlib import Path
from xml.etree.ElementTree import Element, ElementTree, SubElement

import numpy as np
from pyproj import Geod

from uavgram.geometry.geodesy import EARTH_RADIUS_M, Origin, geodetic_from_enu
from uavgram.io.json_codec import Record, records
from uavgram.io.outputs import replace_text
from uavgram.model.arrays import Floats
from uavgram.model.maps import HIDDEN, Features, Layer, transform_vertices
from uavgram.model.result.result import Result
from uavgram.model.result.tables import PointResults
from uavgram.stages.products.columns import (
    MEASUREMENTS,
    POINTS,
    heights_above_datum,
    listed_columns,
)

Geometry = Record | None

ELLIPSE_VERTICES = 36  # of an ellipse: its area is 0.5 % too small

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
_NO_GEOJSON_PLACE = (
    "The result has no geographic position (nothing ties its world to the earth, such as a flight "
    "log), so it cannot be drawn on a map. The local coordinates are in results.json."
)

_NO_ELLIPSOID = (
    "Heights are known above mean sea level only, and positions in GeoJSON take heights above the "
    "WGS 84 ellipsoid (RFC 7946): so they have none here. height_m of each point is its height "
    "above mean sea level; survey.gpkg has it as the third coordinate."
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
    """Return points, ellipses and measurements as a FeatureCollection, one feature a line.

    Positions are longitude and latitude [deg], and the height above the WGS 84 ellipsoid [m] as the
    third number (RFC 7946, 3.1.1). If only heights above sea level are known, a third number would
    be wrong by up to a hundred metres: positions are then two-dimensional, with the reason in
    ``message``. `height_m` and `height_datum` are properties of each point in any case.
    """
    members: Record = {"type": "FeatureCollection", "name": result.name}
    features: list[Record] = []
    if result.world.gauge == "plane" or result.world.origin is None:
        members["message"] = _NO_GEOJSON_PLACE
    else:
        place = _convert_points(result)
        if place.shape[1] < 3:
            members["message"] = _NO_ELLIPSOID
        features = _points(result, place) + _ellipses(result.points, place)
        features += _measurements(result, place)
    head = json.dumps(members, ensure_ascii=False, allow_nan=False)[:-1]
    lines = (json.dumps(f, ensure_ascii=False, allow_nan=False) for f in features)
    body = "\n" + ",\n".join(lines) + "\n" if features else ""
    return f'{head}, "features": [{body}]}}\n'


def _features(what: str, geometries: Iterable[Geometry], /, **columns: object) -> list[Record]:
    """Return shapes with their properties: columns of N values by name."""
    return [
        {"type": "Feature", "geometry": geometry, "properties": {"type": what, **row}}
        for geometry, row in zip(geometries, records(**columns), strict=True)
    ]


def _points(result: Result, place: Floats) -> list[Record]:
    return _features(
        "point",
        ({"type": "Point", "coordinates": each} for each in place.tolist()),
        **listed_columns(POINTS, result),
    )


def _ellipses(points: PointResults, place: Floats) -> list[Record]:
    """Return level ellipses, at the heights of their points."""
    rings = _ellipse_rings(points)
    heights = np.broadcast_to(place[:, None, 2:], (*rings.shape[:2], place.shape[1] - 2))
    placed = np.concatenate([rings, heights], axis=2)
    return _features(
        "ellipse_95",
        ({"type": "Polygon", "coordinates": [ring]} for ring in placed.tolist()),
        label=points.label,
        semi_major_m=points.ellipse_95_m[:, 0],
        semi_minor_m=points.ellipse_95_m[:, 1],
    )


def _ellipse_rings(points: PointResults) -> Floats:
    """Return (K, VERTICES + 1, 2) closed rings of [longitude, latitude], counterclockwise."""
    angle = np.linspace(0.0, 2.0 * np.pi, ELLIPSE_VERTICES + 1)
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


def _measurements(result: Result, place: Floats) -> list[Record]:
    measurements = result.measurements
    place_of = dict(zip(result.points.label, place.tolist(), strict=True))
    shapes = zip(measurements.kind, measurements.outlines, strict=True)
    return _features(
        "measurement",
        (_geometry(kind, [place_of.get(label) for label in labels]) for kind, labels in shapes),
        **listed_columns(MEASUREMENTS, result),
    )


def _geometry(kind: str, places: list[list[float] | None]) -> Geometry:
    """Return the shape of a measurement; None ("unlocated") where a point has no position."""
    known = [position for position in places if position is not None]
    if len(known) < len(places):
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
    x, y = (np.array(ring) - ring[0]).T[:2]
    is_clockwise = float(np.sum(x[:-1] * y[1:] - x[1:] * y[:-1])) < 0
    return ring[::-1] if is_clockwise else ring


def _foot(places: list[list[float]]) -> list[float]:
    """Return the foot of the perpendicular from the first position to the line of the next two."""
    point, start, end = np.array(places[:3])
    # in metres: a degree of longitude is shorter by the cosine of the latitude
    degree_m = np.deg2rad(EARTH_RADIUS_M)
    scale = np.array([np.cos(np.deg2rad(point[1])) * degree_m, degree_m, 1.0])[: len(point)]
    along, to_point = (end - start) * scale, (point - start) * scale
    fraction = float(along @ to_point / (along @ along)) if along.any() else 0.0
    foot: list[float] = (start + fraction * (end - start)).tolist()
    return foot


def _lonlat(points: PointResults) -> Floats:
    return np.stack([points.longitude_deg, points.latitude_deg], axis=1)


def _convert_points(result: Result) -> Floats:
    """Return (K, 3) longitude, latitude, height above the ellipsoid; (K, 2) if that is unknown."""
    shift, lonlat = result.world.ellipsoid_shift_m, _lonlat(result.points)
    if shift is None:
        return lonlat
    return np.column_stack([lonlat, heights_above_datum(result) + shift])


LAYER_DECIMALS = 9
"""Decimals of degrees: a tenth of a millimetre."""

_KINDS = {"point": "Point", "line": "LineString", "polygon": "Polygon"}


def write_layers_geojson(features: Features, path: Path) -> None:
    """Write all layers of georeferenced features, one feature a line, without heights.

    Heights of positions would have to be above the ellipsoid (RFC 7946, 3.1.1), which are unknown
    when a plan is laid out; relevant heights are properties.

    Raises
    ------
    ValueError
        The features are not georeferenced.
    OutputError
        The file cannot be written.
    """
    if features.origin is None:
        raise ValueError(f"{features.name}: no place on earth")
    head = json.dumps({"type": "FeatureCollection", "name": features.name}, ensure_ascii=False)
    lines = [
        json.dumps(one, ensure_ascii=False, allow_nan=False)
        for layer in features.layers
        for one in _layer_features(layer, features.origin)
    ]
    body = ",\n".join(lines)
    replace_text(path, f'{head[:-1]}, "features": [\n{body}\n]}}\n')


def _layer_features(layer: Layer, origin: Origin) -> list[Record]:
    def on_earth(enu: Floats) -> Floats:
        latitude, longitude, _ = geodetic_from_enu(enu, origin)
        return np.asarray(
            np.round(np.column_stack([longitude, latitude]), LAYER_DECIMALS), np.float64
        )

    made = []
    for row, vertices in enumerate(transform_vertices(layer.vertices_m, on_earth)):
        properties = {key: _json(values[row]) for key, values in layer.attributes.items()}
        geometry = {"type": _KINDS[layer.kind], "coordinates": _coordinates(layer, vertices)}
        made.append(
            {
                "type": "Feature",
                "geometry": geometry,
                "properties": {"layer": layer.name, **properties},
            }
        )
    return made


def _coordinates(layer: Layer, vertices: Floats) -> object:
    if layer.kind == "point":
        return vertices[0].tolist()
    if layer.kind == "line":
        return vertices.tolist()
    return [[*vertices.tolist(), vertices[0].tolist()]]


def _json(value: str | float) -> str | float | None:
    return None if isinstance(value, float) and math.isnan(value) else value


_NAMESPACE = "http://www.opengis.net/kml/2.2"
# title, and colour as aabbggrr, the order of KML; polygons are filled with a tenth of it
_LAYERS = {
    "footprints": ("Photo footprints", "99ffffff"),
    "camera_poses": ("Cameras", "ffffaa55"),
    "ellipses_95": ("95 % ellipses", "ff007be0"),
    "ellipses_95_within_survey": ("95 % ellipses within the survey", "ff00c8ff"),
    "known_lengths": ("Known lengths", "ff7a12b0"),
    "control_lines": ("Lines of known position", "ff9c27b0"),
    "measured_areas": ("Measured areas", "ff6b7900"),
    "measured_lines": ("Measured lines", "ff6b7900"),
    "points": ("Points", "ff00ffff"),
    "planned_footprints": ("What photos will show", "99ffffff"),
    "planned_area": ("Area", "ffffffff"),
    "planned_no_go": ("Keep out", "ff0000ff"),
    "planned_corners": ("Corners of the area", "ffffffff"),
    "planned_flight": ("Flight", "ffffaa55"),
    "planned_photos": ("Photos to take", "ffffaa55"),
    "planned_measurements": ("Planned measurements", "ff6b7900"),
    "planned_points": ("Points to measure", "ff6b7900"),
    "planned_lines": ("Lines to lay and tape", "ff7a12b0"),
    "planned_plates": ("Plates to lay", "ff7a12b0"),
    "planned_line_ends": ("Ends of lines", "ff7a12b0"),
}
_UNSEEN = ("verticals", "planned_accuracy")
"""Layers left out: points have their own lines to the ground; map cells would hide the globe."""
_HIDDEN = (*HIDDEN, "planned_footprints")
_NO_KML_PLACE = "Nothing ties this survey to the earth, so nothing of it can be drawn on a globe."


def write_kml(features: Features, path: Path) -> None:
    """Write all layers as folders.

    Shapes on the ground are on the globe's terrain; shapes off it are drawn at their height above
    the ground over that terrain, points with a line down to it, and cameras at their height.
    """
    root = Element("kml", xmlns=_NAMESPACE)
    document = SubElement(root, "Document")
    SubElement(document, "name").text = features.name
    if features.origin is None:
        SubElement(document, "description").text = _NO_KML_PLACE
    else:
        shown = [layer for layer in features.layers if layer.name not in _UNSEEN]
        for layer in shown:
            _style(document, layer)
        for layer in shown:
            _folder(document, layer, features.origin)
    ElementTree(root).write(path, encoding="utf-8", xml_declaration=True)


def _style(document: Element, layer: Layer) -> None:
    style = SubElement(document, "Style", id=layer.name)
    colour = _title_and_colour(layer)[1]
    if layer.kind == "point":
        SubElement(SubElement(style, "IconStyle"), "color").text = colour
    line = SubElement(style, "LineStyle")
    SubElement(line, "color").text = colour
    SubElement(line, "width").text = "2"
    if layer.kind == "polygon":
        SubElement(SubElement(style, "PolyStyle"), "color").text = "1a" + colour[2:]


def _title_and_colour(layer: Layer) -> tuple[str, str]:
    """Return title and colour of a layer, by default its own name, and white."""
    return _LAYERS.get(layer.name, (layer.name.replace("_", " ").capitalize(), "ffffffff"))


def _folder(document: Element, layer: Layer, origin: Origin) -> None:
    folder = SubElement(document, "Folder")
    SubElement(folder, "name").text = _title_and_colour(layer)[0]
    visibility = "0" if layer.name in _HIDDEN else "1"
    SubElement(folder, "visibility").text = visibility
    folder.tail = "\n"
    names = next(iter(layer.attributes.values()))  # label, name or frame comes first
    for row, places in enumerate(_convert_layer(layer, origin)):
        if not len(places):
            continue
        mark = SubElement(folder, "Placemark")
        mark.tail = "\n"
        SubElement(mark, "name").text = str(names[row])
        SubElement(mark, "visibility").text = visibility
        SubElement(mark, "styleUrl").text = f"#{layer.name}"
        data = SubElement(mark, "ExtendedData")
        for key, values in layer.attributes.items():
            value = values[row]
            if value == "" or (isinstance(value, float) and not math.isfinite(value)):
                continue
            SubElement(SubElement(data, "Data", name=key), "value").text = str(value)
        _add_geometry(mark, layer, places)


def _convert_layer(layer: Layer, origin: Origin) -> tuple[Floats, ...]:
    """Return (v, 3) longitude, latitude, height above ground of each shape, rings closed."""

    def on_globe(enu: Floats) -> Floats:
        latitude, longitude, _ = geodetic_from_enu(enu, origin)
        return np.stack([longitude, latitude, np.zeros(len(enu))], axis=1)

    shapes = transform_vertices(layer.vertices_m, on_globe)
    above = layer.above_ground_m
    if layer.name == "camera_poses":
        above = tuple(center[:, 2] for center in layer.vertices_m)
    if above:
        shapes = tuple(
            np.column_stack([shape[:, :2], height])
            for shape, height in zip(shapes, above, strict=True)
        )
    if layer.kind == "polygon":
        shapes = tuple(np.concatenate([ring, ring[:1]]) for ring in shapes)
    return shapes


def _add_geometry(mark: Element, layer: Layer, places: Floats) -> None:
    text = " ".join(["%.11f,%.11f,%.4f"] * len(places)) % tuple(places.ravel().tolist())
    shape = SubElement(mark, {"point": "Point", "line": "LineString"}.get(layer.kind, "Polygon"))
    if bool(places[:, 2].any()) or layer.name == "camera_poses":
        if layer.name == "points":  # a line down to the ground
            SubElement(shape, "extrude").text = "1"
        SubElement(shape, "altitudeMode").text = "relativeToGround"
    elif layer.kind == "line":
        SubElement(shape, "tessellate").text = "1"
    if layer.kind == "polygon":
        shape = SubElement(SubElement(shape, "outerBoundaryIs"), "LinearRing")
    SubElement(shape, "coordinates").text = text
