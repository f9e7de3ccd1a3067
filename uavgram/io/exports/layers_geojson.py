"""Writer of layers as GeoJSON: one collection, each feature with its layer's name (RFC 7946)."""

from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np

from uavgram.geometry.earth.geodesy import Origin, geodetic_from_enu
from uavgram.io.outputs import replace_text
from uavgram.io.results.codec import Record
from uavgram.model.arrays import Floats
from uavgram.model.maps import Features, Layer, placed

DECIMALS = 9
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
        for one in _features(layer, features.origin)
    ]
    body = ",\n".join(lines)
    replace_text(path, f'{head[:-1]}, "features": [\n{body}\n]}}\n')


def _features(layer: Layer, origin: Origin) -> list[Record]:
    def on_earth(enu: Floats) -> Floats:
        latitude, longitude, _ = geodetic_from_enu(enu, origin)
        return np.asarray(np.round(np.column_stack([longitude, latitude]), DECIMALS), np.float64)

    made = []
    for row, vertices in enumerate(placed(layer.vertices_m, on_earth)):
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
