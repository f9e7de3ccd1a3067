"""survey.gpkg: every layer for a GIS, with attributes, in one file (OGC GeoPackage)."""

from __future__ import annotations

import sqlite3
import struct
from collections.abc import Callable, Iterator, Mapping
from contextlib import closing, contextmanager
from pathlib import Path
from types import MappingProxyType
from xml.etree.ElementTree import tostring

import numpy as np
from pyogrio import get_gdal_config_option, set_gdal_config_options
from pyogrio.raw import write

from uavgram.geometry.earth.map_projection import projected_from_enu
from uavgram.io.exports.qgis_styles import Look, style_of
from uavgram.model.arrays import Floats
from uavgram.model.maps.layers import Attribute, Features, Layer, placed

_SYNCHRONOUS = "OGR_SQLITE_SYNCHRONOUS"
_TYPES = {"point": "Point Z", "line": "LineString Z", "polygon": "Polygon Z"}
_LOCAL = 'LOCAL_CS["local metres: x east, y north",UNIT["metre",1]]'
# GDAL before 3.7, which long-lived systems have, warns of newer versions.
_VERSION = {"VERSION": "1.3"}
_NUMBERS = ("value", "sigma", "lower_95", "upper_95", "w")
_UNITS = ("_m", "_m2", "_deg", "_s")
"""Columns of numbers: by their names, and by their units."""
# As QGIS makes it (QgsOgrProvider, "saveStyle").
_STYLES = """
CREATE TABLE layer_styles (
    id INTEGER PRIMARY KEY AUTOINCREMENT NOT NULL,
    f_table_catalog TEXT(256), f_table_schema TEXT(256), f_table_name TEXT(256),
    f_geometry_column TEXT(256), styleName TEXT(30), styleQML TEXT, styleSLD TEXT,
    useAsDefault BOOLEAN, description TEXT, owner TEXT(30), ui TEXT(30),
    update_time DATETIME DEFAULT (strftime('%Y-%m-%dT%H:%M:%fZ','now'))
)
"""
# ISO WKB codes of geometries with height (OGC 06-103r4, table 7).
_WKB_TYPES = {"point": 1001, "line": 1002, "polygon": 1003}


Quantity = Callable[[float, float, str], str]


def write_geopackage(
    features: Features,
    path: Path,
    looks: Mapping[str, Look] = MappingProxyType({}),
    words: Quantity | None = None,
) -> None:
    """Write all layers, in the projected coordinate system; in local metres where there is none.

    Heights are those of the local origin's datum; without an origin they are above the plane.

    Parameters
    ----------
    features
        What is written.
    path
        The file.
    looks
        How QGIS shows layers when someone adds them to a map, by their names.
    words
        By which the column ``text`` of measured layers and known lengths says its numbers; left
        out, there is none.
    """
    with _without_waiting():
        for index, layer in enumerate(features.layers):
            attributes = layer.attributes | _texts(layer, words)
            columns = list(attributes)
            write(
                path,
                geometry=np.array([_wkb(layer, v) for v in _on_map(features, layer)], dtype=object),
                field_data=[_field(key, attributes[key]) for key in columns],
                fields=columns,
                layer=layer.name,
                driver="GPKG",
                geometry_type=_TYPES[layer.kind],
                crs=_LOCAL if features.crs is None else features.crs,
                append=index > 0,
                dataset_options=_VERSION,
                layer_options={"DESCRIPTION": _heights(features)},
            )
    _write_styles(features, looks, path)


def _heights(features: Features) -> str:
    """What a coordinate system of maps does not say."""
    if features.origin is None:
        return "metres; heights above the plane of the ground"
    above = "mean sea level" if features.height_datum == "msl" else "the WGS 84 ellipsoid"
    return f"heights in metres above {above}"


def _texts(layer: Layer, words: Quantity | None) -> dict[str, Attribute]:
    """What stands beside a line or an area: its name, and its value as people read it."""
    of = layer.attributes
    value, sigma = ("length_m", "sigma_m") if "length_m" in of else ("value", "sigma")
    if words is None or value not in of:
        return {}
    unit = of.get("unit", ("m",) * len(layer))
    rows = zip(of["name"], of[value], of[sigma], unit, strict=True)
    told = (
        f"{name}: {words(float(str(number)), float(str(spread)), str(one))}"
        for name, number, spread, one in rows
    )
    return {"text": tuple(told)}


def _write_styles(features: Features, looks: Mapping[str, Look], path: Path) -> None:
    """The table in which QGIS looks for styles, and takes the default one of a layer."""
    styles = [
        (layer.name, "geom", layer.name, tostring(style_of(look, layer.kind), "unicode"))
        for layer in features.layers
        if (look := looks.get(layer.name)) is not None
    ]
    if not styles:
        return
    with closing(sqlite3.connect(path)) as file, file:
        file.execute("PRAGMA synchronous = OFF")
        file.execute(_STYLES)
        file.executemany(
            "INSERT INTO layer_styles (f_table_catalog, f_table_schema, f_table_name, "
            "f_geometry_column, styleName, styleQML, styleSLD, useAsDefault, description, owner, "
            "update_time) VALUES ('', '', ?, ?, ?, ?, '', 1, '', '', '1970-01-01T00:00:00.000Z')",
            styles,
        )
        file.execute(
            "INSERT INTO gpkg_contents (table_name, data_type, identifier, description, "
            "last_change) VALUES ('layer_styles', 'attributes', 'layer_styles', '', "
            "'1970-01-01T00:00:00.000Z')"
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


def _field(
    name: str, values: Attribute
) -> np.ndarray[tuple[int], np.dtype[np.object_ | np.float64]]:
    """A column; of a layer without shapes too, a program that fills it finds text or numbers."""
    if values:
        return np.array(values, dtype=object if isinstance(values[0], str) else np.float64)
    is_number = name in _NUMBERS or name.endswith(_UNITS)
    return np.zeros(0, dtype=np.float64 if is_number else object)


def _wkb(layer: Layer, vertices: Floats) -> bytes | None:
    """Well-known binary of one shape, little-endian; None where it has no place."""
    if not len(vertices):
        return None
    if layer.kind == "polygon":
        vertices = np.concatenate([vertices, vertices[:1]])
    counts = {"point": (), "line": (len(vertices),), "polygon": (1, len(vertices))}[layer.kind]
    head = struct.pack(f"<B{1 + len(counts)}I", 1, _WKB_TYPES[layer.kind], *counts)
    return head + vertices.astype("<f8").tobytes()
