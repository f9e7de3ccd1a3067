"""Writers of maps in degrees: points.geojson and GeoJSON (RFC 7946), survey.kml (OGC KML 2.3)."""

from __future__ import annotations

import json
from collections.abc import Iterable, Sequence
from pathlib import Path
from types import MappingProxyType
from xml.etree.ElementTree import Element, ElementTree, SubElement

import numpy as np

from uavgram.geometry.geodesy import Origin, geodetic_from_enu
from uavgram.io.json_codec import Record, records
from uavgram.io.outputs import replace_text
from uavgram.model.arrays import Floats
from uavgram.model.maps import Features, Layer, LayerStyle, Looks, ShapeKind, look_of
from uavgram.model.result.result import Result
from uavgram.stages.products.columns import MEASUREMENTS, POINTS, make_geojson_columns
from uavgram.stages.products.map_layers import make_located_layers

_NO_GEOJSON_PLACE = (
    "The result has no geographic position (nothing ties its world to the earth, such as a flight "
    "log), so it cannot be drawn on a map. The local coordinates are in results.json."
)

_NO_ELLIPSOID = (
    "Heights are known above mean sea level only, and positions in GeoJSON take heights above the "
    "WGS 84 ellipsoid (RFC 7946): so they have none here. height_m of each point is its height "
    "above mean sea level; survey.gpkg has it as the third coordinate."
)
_KINDS: dict[ShapeKind, str] = {"point": "Point", "line": "LineString", "polygon": "Polygon"}


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
    world = result.world
    if world.gauge == "plane" or world.origin is None:
        return _collection({"name": result.name, "message": _NO_GEOJSON_PLACE}, [])
    members = {"name": result.name}
    if world.ellipsoid_shift_m is None:
        members["message"] = _NO_ELLIPSOID
    points, ellipses, *measured = make_located_layers(result)
    rows = records(**make_geojson_columns(POINTS, result)), ellipses.records()
    pairs = [*zip((points, ellipses), rows, strict=True)]
    measurements = records(**make_geojson_columns(MEASUREMENTS, result))
    pairs += [(layer, [row]) for layer, row in zip(measured, measurements, strict=True)]
    return _collection(
        members,
        (
            one
            for layer, own in pairs
            for one in _features(layer, own, "type", world.origin, world.ellipsoid_shift_m)
        ),
    )


def write_layers_geojson(features: Features, path: Path) -> None:
    """Write all layers of georeferenced features, one feature a line.

    Raises
    ------
    ValueError
        The features are not georeferenced.
    OutputError
        The file cannot be written.
    """
    origin, shift = features.origin, features.ellipsoid_shift_m
    if origin is None:
        raise ValueError(f"{features.name}: no place on earth")
    every = (
        one
        for layer in features.layers
        for one in _features(layer, layer.records(), "layer", origin, shift)
    )
    replace_text(path, _collection({"name": features.name}, every))


def _collection(members: Record, features: Iterable[Record]) -> str:
    head = json.dumps({"type": "FeatureCollection", **members}, ensure_ascii=False)
    lines = [json.dumps(one, ensure_ascii=False, allow_nan=False) for one in features]
    body = "\n" + ",\n".join(lines) + "\n" if lines else ""
    return f'{head[:-1]}, "features": [{body}]}}\n'


def _features(
    layer: Layer, rows: Sequence[Record], key: str, origin: Origin, shift_m: float | None
) -> list[Record]:
    """Return the shapes of a layer with their properties, and its name under a key."""

    def on_earth(enu: Floats) -> Floats:
        latitude, longitude, height_m = geodetic_from_enu(enu, origin)
        heights = [] if shift_m is None else [height_m + shift_m]
        return np.stack([longitude, latitude, *heights], axis=1)

    return [
        {
            "type": "Feature",
            "geometry": _geometry(layer.kind, shape),
            "properties": {key: layer.name, **row},
        }
        for shape, row in zip(layer.transform(on_earth), rows, strict=True)
    ]


def _geometry(kind: ShapeKind, shape: Floats) -> Record | None:
    """Return a geometry; None ("unlocated") for a shape without vertices."""
    if not len(shape):
        return None
    vertices = shape.tolist()
    coordinates = {"point": vertices[0], "line": vertices, "polygon": [vertices]}[kind]
    return {"type": _KINDS[kind], "coordinates": coordinates}


_NAMESPACE = "http://www.opengis.net/kml/2.2"
_UNSEEN = ("verticals", "planned_accuracy")
"""Layers left out: points have their own lines to the ground; map cells would hide the globe."""
_NO_KML_PLACE = "Nothing ties this survey to the earth, so nothing of it can be drawn on a globe."


def write_kml(features: Features, path: Path, looks: Looks = MappingProxyType({})) -> None:
    """Write all layers as folders.

    Shapes on the ground are on the globe's terrain; shapes off it are drawn at their height above
    the ground over that terrain, points with a line down to it, and cameras at their height.

    Parameters
    ----------
    features
        Survey to write.
    path
        The file.
    looks
        Titles and colours by layer name; by default the name, in white.
    """
    root = Element("kml", xmlns=_NAMESPACE)
    document = SubElement(root, "Document")
    SubElement(document, "name").text = features.name
    if features.origin is None:
        SubElement(document, "description").text = _NO_KML_PLACE
    else:
        shown = [layer for layer in features.layers if layer.name not in _UNSEEN]
        for layer in shown:
            _style(document, layer, look_of(looks, layer.name).globe)
        for layer in shown:
            _folder(document, layer, look_of(looks, layer.name), features.origin)
    ElementTree(root).write(path, encoding="utf-8", xml_declaration=True)


def _style(document: Element, layer: Layer, colour: str) -> None:
    style = SubElement(document, "Style", id=layer.name)
    if layer.kind == "point":
        SubElement(SubElement(style, "IconStyle"), "color").text = colour
    line = SubElement(style, "LineStyle")
    SubElement(line, "color").text = colour
    SubElement(line, "width").text = "2"
    if layer.kind == "polygon":
        SubElement(SubElement(style, "PolyStyle"), "color").text = "1a" + colour[2:]


def _folder(document: Element, layer: Layer, look: LayerStyle, origin: Origin) -> None:
    folder = SubElement(document, "Folder")
    SubElement(folder, "name").text = f"{look.title[:1].upper()}{look.title[1:]}"
    visibility = "1" if look.shown else "0"
    SubElement(folder, "visibility").text = visibility
    folder.tail = "\n"
    for row, places in zip(layer.records(), _places(layer, origin), strict=True):
        if not len(places):
            continue
        mark = SubElement(folder, "Placemark")
        mark.tail = "\n"
        SubElement(mark, "name").text = str(next(iter(row.values())))  # label, name or frame
        SubElement(mark, "visibility").text = visibility
        SubElement(mark, "styleUrl").text = f"#{layer.name}"
        data = SubElement(mark, "ExtendedData")
        for key, value in row.items():
            if value not in ("", None):
                SubElement(SubElement(data, "Data", name=key), "value").text = str(value)
        _add_geometry(mark, layer, places)


def _places(layer: Layer, origin: Origin) -> tuple[Floats, ...]:
    """Return (v, 3) longitude, latitude, height above ground of each shape, rings closed."""
    above = layer.above_ground_m
    if layer.name == "camera_poses":
        above = tuple(center[:, 2] for center in layer.vertices_m)
    shapes = layer.transform(lambda enu: _on_globe(enu, origin))
    if not above:
        return shapes
    # The last vertex of a ring is its first.
    return tuple(
        np.column_stack([shape[:, :2], np.resize(heights, len(shape))])
        for shape, heights in zip(shapes, above, strict=True)
    )


def _on_globe(enu: Floats, origin: Origin) -> Floats:
    latitude, longitude, _ = geodetic_from_enu(enu, origin)
    return np.stack([longitude, latitude, np.zeros(len(enu))], axis=1)


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
