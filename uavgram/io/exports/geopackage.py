"""survey.gpkg: every layer for a GIS, with attributes, in one file (OGC GeoPackage)."""

from __future__ import annotations

import struct
from pathlib import Path

import numpy as np
from pyogrio.raw import write

from uavgram.geometry.earth.geodesy import Origin
from uavgram.geometry.earth.map_projection import projected_from_enu
from uavgram.model.arrays import Floats
from uavgram.model.maps.layers import Attribute, Features, Layer

_TYPES = {"point": "Point Z", "line": "LineString Z", "polygon": "Polygon Z"}
_LOCAL = 'LOCAL_CS["local metres: x east, y north",UNIT["metre",1]]'
# ISO WKB codes of geometries with height (OGC 06-103r4, table 7).
_POINT_Z, _LINE_Z, _POLYGON_Z = 1001, 1002, 1003


def write_geopackage(features: Features, path: Path) -> None:
    """Write all layers, in the projected coordinate system; in local metres where there is none.

    Heights are those of the local origin's datum; without an origin they are above the plane.
    """
    for index, layer in enumerate(features.layers):
        columns = list(layer.attributes)
        write(
            path,
            geometry=np.array([_wkb(layer, v) for v in _placed(features, layer)], dtype=object),
            field_data=[_field(layer.attributes[key]) for key in columns],
            fields=columns,
            layer=layer.name,
            driver="GPKG",
            geometry_type=_TYPES[layer.kind],
            crs=_LOCAL if features.crs is None else features.crs,
            append=index > 0,
        )


def _placed(features: Features, layer: Layer) -> list[Floats]:
    """Vertices of each shape on the map."""
    if features.origin is None or features.crs is None:
        return list(layer.vertices_m)
    return _on_map(layer.vertices_m, features.origin, features.crs)


def _on_map(vertices_m: tuple[Floats, ...], origin: Origin, crs: str) -> list[Floats]:
    counts = [len(v) for v in vertices_m]
    if not sum(counts):
        return list(vertices_m)
    together = projected_from_enu(np.concatenate(vertices_m), origin, crs)
    return np.split(together, np.cumsum(counts)[:-1])


def _field(values: Attribute) -> np.ndarray[tuple[int], np.dtype[np.object_ | np.float64]]:
    if values and isinstance(values[0], str):
        return np.array(values, dtype=object)
    return np.array(values, dtype=np.float64)


def _wkb(layer: Layer, vertices: Floats) -> bytes | None:
    """Well-known binary of one shape, little-endian; None where it has no place."""
    if not len(vertices):
        return None
    if layer.kind == "point":
        return struct.pack("<BI", 1, _POINT_Z) + vertices.astype("<f8").tobytes()
    if layer.kind == "line":
        head = struct.pack("<BII", 1, _LINE_Z, len(vertices))
        return head + vertices.astype("<f8").tobytes()
    ring = np.concatenate([vertices, vertices[:1]])
    head = struct.pack("<BIII", 1, _POLYGON_Z, 1, len(ring))
    return head + ring.astype("<f8").tobytes()
