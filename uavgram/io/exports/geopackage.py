"""survey.gpkg: every layer for a GIS, with attributes, in one file (OGC GeoPackage)."""

from __future__ import annotations

import struct
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
from pyogrio import get_gdal_config_option, set_gdal_config_options
from pyogrio.raw import write

from uavgram.geometry.earth.map_projection import projected_from_enu
from uavgram.model.arrays import Floats
from uavgram.model.maps.layers import Attribute, Features, Layer, placed

_SYNCHRONOUS = "OGR_SQLITE_SYNCHRONOUS"
_TYPES = {"point": "Point Z", "line": "LineString Z", "polygon": "Polygon Z"}
_LOCAL = 'LOCAL_CS["local metres: x east, y north",UNIT["metre",1]]'
# ISO WKB codes of geometries with height (OGC 06-103r4, table 7).
_WKB_TYPES = {"point": 1001, "line": 1002, "polygon": 1003}


def write_geopackage(features: Features, path: Path) -> None:
    """Write all layers, in the projected coordinate system; in local metres where there is none.

    Heights are those of the local origin's datum; without an origin they are above the plane.
    """
    with _without_waiting():
        for index, layer in enumerate(features.layers):
            columns = list(layer.attributes)
            write(
                path,
                geometry=np.array([_wkb(layer, v) for v in _on_map(features, layer)], dtype=object),
                field_data=[_field(layer.attributes[key]) for key in columns],
                fields=columns,
                layer=layer.name,
                driver="GPKG",
                geometry_type=_TYPES[layer.kind],
                crs=_LOCAL if features.crs is None else features.crs,
                append=index > 0,
            )


@contextmanager
def _without_waiting() -> Iterator[None]:
    """SQLite waits for the disk after every layer; one wait for the finished file is enough.

    Who hands the file on does that (`staged_output`).
    """
    before = get_gdal_config_option(_SYNCHRONOUS)
    set_gdal_config_options({_SYNCHRONOUS: "OFF"})
    try:
        yield
    finally:
        set_gdal_config_options({_SYNCHRONOUS: before})


def _on_map(features: Features, layer: Layer) -> tuple[Floats, ...]:
    """Vertices of each shape on the map."""
    origin, crs = features.origin, features.crs
    if origin is None or crs is None:
        return layer.vertices_m
    return placed(layer.vertices_m, lambda enu: projected_from_enu(enu, origin, crs))


def _field(values: Attribute) -> np.ndarray[tuple[int], np.dtype[np.object_ | np.float64]]:
    if values and isinstance(values[0], str):
        return np.array(values, dtype=object)
    return np.array(values, dtype=np.float64)


def _wkb(layer: Layer, vertices: Floats) -> bytes | None:
    """Well-known binary of one shape, little-endian; None where it has no place."""
    if not len(vertices):
        return None
    if layer.kind == "polygon":
        vertices = np.concatenate([vertices, vertices[:1]])
    counts = {"point": (), "line": (len(vertices),), "polygon": (1, len(vertices))}[layer.kind]
    head = struct.pack(f"<B{1 + len(counts)}I", 1, _WKB_TYPES[layer.kind], *counts)
    return head + vertices.astype("<f8").tobytes()
