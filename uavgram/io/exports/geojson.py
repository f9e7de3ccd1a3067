"""Writers of GeoJSON (RFC 7946): points.geojson, and all layers of a plan in one collection."""

from __future__ import annotations

import json
from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np

from uavgram.geometry.earth.geodesy import Origin, geodetic_from_enu
from uavgram.io.outputs import replace_text
from uavgram.io.results.codec import Record, records
from uavgram.model.arrays import Floats
from uavgram.model.maps import Features, Layer, ShapeKind
from uavgram.model.result.result import Result
from uavgram.stages.products.columns import MEASUREMENTS, POINTS, listed_columns
from uavgram.stages.products.map_layers import located_layers

_NO_PLACE = (
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
        return _collection({"name": result.name, "message": _NO_PLACE}, [])
    members = {"name": result.name}
    if world.ellipsoid_shift_m is None:
        members["message"] = _NO_ELLIPSOID
    points, ellipses, *measured = located_layers(result)
    rows = records(**listed_columns(POINTS, result)), ellipses.records()
    pairs = [*zip((points, ellipses), rows, strict=True)]
    measurements = records(**listed_columns(MEASUREMENTS, result))
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
        for shape, row in zip(layer.placed(on_earth), rows, strict=True)
    ]


def _geometry(kind: ShapeKind, shape: Floats) -> Record | None:
    """Return a geometry; None ("unlocated") for a shape without vertices."""
    if not len(shape):
        return None
    vertices = shape.tolist()
    coordinates = {"point": vertices[0], "line": vertices, "polygon": [vertices]}[kind]
    return {"type": _KINDS[kind], "coordinates": coordinates}
