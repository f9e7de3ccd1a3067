"""Writers for a GIS: layers in survey.gpkg with their styles (QML), and the QGIS project of them.

The layers are drawn as in the report, in the same style in GeoPackage and project.

The format is OGC GeoPackage 1.3 (12-128r18).
"""

from __future__ import annotations

import sqlite3
import struct
from collections.abc import Callable, Mapping
from contextlib import closing
from dataclasses import replace
from pathlib import Path
from types import MappingProxyType
from typing import NamedTuple
from xml.etree.ElementTree import Element, ElementTree, SubElement, indent, tostring

import numpy as np
from pyproj import CRS
from pyproj.exceptions import CRSError

from uavgram.geometry.geodesy import projected_from_enu
from uavgram.model.arrays import Floats
from uavgram.model.maps import Attribute, Features, Layer, LayerStyle, Looks, ShapeKind

_DASHES_MM = "3;2"
_LABEL_PT = "8"
_STYLE_GEOMETRY: dict[ShapeKind, str] = {"point": "0", "line": "1", "polygon": "2"}
# QgsPalLayerSettings.Placement: around a point, along a line, horizontal in an area
_PLACEMENT: dict[ShapeKind, str] = {"point": "0", "line": "2", "polygon": "4"}

# QgsLabeling.LinePlacementFlag: above, below, map orientation; and the distance by which texts may
# extend beyond the ends of lines: otherwise short or crowded lines have none
_BESIDE_LINE, _BEYOND_MM = str(2 + 4 + 8), "40"


def create_style(look: LayerStyle, kind: ShapeKind) -> Element:
    """Return the style as the content of its own file.

    Parameters
    ----------
    look
        Style of the layer.
    kind
        Kind of its shapes.
    """
    root = Element("qgis", version="3.22.0", styleCategories="Symbology|Labeling")
    add_style(root, look, kind)
    SubElement(root, "layerGeometryType").text = _STYLE_GEOMETRY[kind]
    return root


def add_style(parent: Element, look: LayerStyle, kind: ShapeKind) -> None:
    """Add symbols and labels to an element that describes a layer.

    Parameters
    ----------
    parent
        Such as a project's ``maplayer``.
    look, kind
        See `create_style`.
    """
    parent.set("labelsEnabled", "1" if look.label else "0")
    colours = [*look.by_status.values(), look.colour]
    if look.by_status:
        renderer = SubElement(parent, "renderer-v2", type="categorizedSymbol", attr="status")
        categories = SubElement(renderer, "categories")
        for number, status in enumerate([*look.by_status, ""]):
            SubElement(
                categories, "category", value=status, symbol=str(number), render="true",
                label=status or "other",
            )  # fmt: skip
    else:
        renderer = SubElement(parent, "renderer-v2", type="singleSymbol")
    symbols = SubElement(renderer, "symbols")
    for number, colour in enumerate(colours):
        _symbol(symbols, str(number), kind, look, colour)
    if look.label:
        _labels(parent, look, kind)


def _symbol(symbols: Element, name: str, kind: ShapeKind, look: LayerStyle, colour: str) -> None:
    symbol = SubElement(
        symbols, "symbol", type={"point": "marker", "line": "line", "polygon": "fill"}[kind],
        name=name, alpha="1",
    )  # fmt: skip
    dashes = {"use_custom_dash": "1", "customdash": _DASHES_MM, "customdash_unit": "MM"}
    casing = {"line_color": "255,255,255,220", "line_width": f"{look.width_mm * 2.2:.2f}"}
    if kind == "point":
        _layer(
            symbol, "SimpleMarker",
            {"name": "circle", "color": _rgba(colour), "size": f"{look.width_mm}",
             "outline_color": "255,255,255,255", "outline_width": "0.2"},
        )  # fmt: skip
    elif kind == "line":
        line = {"line_color": _rgba(colour), "line_width": f"{look.width_mm}"}
        _layer(symbol, "SimpleLine", casing)
        _layer(symbol, "SimpleLine", line | (dashes if look.dashed else {}))
    else:
        _layer(
            symbol, "SimpleFill",
            {"color": _rgba(colour, look.filled), "style": "solid" if look.filled else "no",
             "outline_color": _rgba(colour), "outline_width": f"{look.width_mm}"},
        )  # fmt: skip


def _layer(symbol: Element, kind: str, properties: dict[str, str]) -> None:
    layer = SubElement(symbol, "layer", {"class": kind, "enabled": "1", "pass": "0", "locked": "0"})
    for key, value in properties.items():
        SubElement(layer, "prop", k=key, v=value)


def _labels(parent: Element, look: LayerStyle, kind: ShapeKind) -> None:
    settings = SubElement(SubElement(parent, "labeling", type="simple"), "settings")
    text = SubElement(
        settings, "text-style", fieldName=look.label, isExpression="0", fontSize=_LABEL_PT,
        fontSizeUnit="Point", textOpacity="1",
        namedStyle="Bold", fontWeight="75", fontFamily="Sans Serif",
        textColor=_rgba(look.colour),
    )  # fmt: skip
    SubElement(
        text, "text-buffer", bufferDraw="1", bufferSize="0.8", bufferSizeUnits="MM",
        bufferColor="255,255,255,230", bufferOpacity="1",
    )  # fmt: skip
    SubElement(
        settings, "placement", placement=_PLACEMENT[kind], dist="1", distUnits="MM",
        placementFlags=_BESIDE_LINE, overrunDistance=_BEYOND_MM, overrunDistanceUnit="MM",
        geometryGeneratorType="PointGeometry",
    )  # fmt: skip
    SubElement(settings, "rendering", obstacle="1", drawLabels="1", scaleVisibility="0")


def _rgba(colour: str, opacity: float = 1.0) -> str:
    """Convert a colour: ``0,121,107,255`` for ``#00796b``."""
    parts = [str(int(colour[k : k + 2], 16)) for k in (1, 3, 5)]
    return ",".join([*parts, str(round(255 * opacity))])


GEOPACKAGE, GROUND = "survey.gpkg", "ground.tif"
ROOM_SHARE, LEAST_ROOM_M = 0.1, 1.0
_LAYER_GEOMETRY = {"point": "Point", "line": "Line", "polygon": "Polygon"}
_GROUND_NAME = "ground"


def write_qgis_project(features: Features, looks: Looks, path: Path, *, has_ground: bool) -> None:
    """Write the project; its file names are relative, so the folder can be moved.

    Parameters
    ----------
    features
        Content of survey.gpkg in the same folder.
    looks
        Styles of its layers, by their names; others are left out. The first is on top.
    path
        The file.
    has_ground
        Whether ground.tif is in the same folder.
    """
    root = Element("qgis", version="3.22.0", projectname=features.name)
    SubElement(root, "title").text = features.name
    _crs(SubElement(root, "projectCrs"), features.crs)
    tree = SubElement(root, "layer-tree-group")
    _canvas(root, features)
    layers = SubElement(root, "projectlayers")
    for name, look in looks.items():
        layer = next((one for one in features.layers if one.name == name), None)
        if layer is None or not len(layer):
            continue
        source = f"./{GEOPACKAGE}|layername={name}"
        _in_tree(tree, name, look.title, source, "ogr", shown=look.shown)
        _vector(layers, layer, look, source, features.crs)
    if has_ground:
        title = "ground, as the photos show it"
        _in_tree(tree, _GROUND_NAME, title, f"./{GROUND}", "gdal", shown=True)
        _raster(layers, title, features.crs)
    properties = SubElement(root, "properties")
    SubElement(SubElement(properties, "Paths"), "Absolute", type="bool").text = "false"
    system = SubElement(properties, "SpatialRefSys")  # without it, QGIS forgets its own
    SubElement(system, "ProjectionsEnabled", type="int").text = str(int(features.crs is not None))
    indent(root)
    ElementTree(root).write(path, encoding="utf-8", xml_declaration=True)


def _in_tree(
    tree: Element, name: str, title: str, source: str, provider: str, *, shown: bool
) -> None:
    SubElement(
        tree, "layer-tree-layer", id=_id(name), name=title, source=source, providerKey=provider,
        checked="Qt::Checked" if shown else "Qt::Unchecked", expanded="0",
    )  # fmt: skip


def _id(name: str) -> str:
    """Return a layer's id; QGIS replaces ids of less than eleven letters."""
    return f"uavgram_{name}_layer"


def _vector(layers: Element, layer: Layer, look: LayerStyle, source: str, crs: str | None) -> None:
    one = SubElement(layers, "maplayer", type="vector", geometry=_LAYER_GEOMETRY[layer.kind])
    _common(one, layer.name, look.title, source, crs)
    SubElement(one, "provider", encoding="UTF-8").text = "ogr"
    add_style(one, look, layer.kind)


def _raster(layers: Element, title: str, crs: str | None) -> None:
    one = SubElement(layers, "maplayer", type="raster")
    _common(one, _GROUND_NAME, title, f"./{GROUND}", crs)
    SubElement(one, "provider").text = "gdal"
    SubElement(
        SubElement(one, "pipe"), "rasterrenderer", type="multibandcolor", redBand="1",
        greenBand="2", blueBand="3", alphaBand="4", opacity="1",
    )  # fmt: skip


def _common(one: Element, name: str, title: str, source: str, crs: str | None) -> None:
    SubElement(one, "id").text = _id(name)
    SubElement(one, "datasource").text = source
    SubElement(one, "layername").text = title
    _crs(SubElement(one, "srs"), crs)


def _crs(parent: Element, crs: str | None) -> None:
    """Write the coordinate system, none for local metres, which QGIS then shows unchanged."""
    system = SubElement(parent, "spatialrefsys", nativeFormat="Wkt")
    if crs is None:
        return
    known = CRS.from_user_input(crs)
    SubElement(system, "wkt").text = known.to_wkt()
    if (authority := known.to_authority()) is not None:
        SubElement(system, "authid").text = ":".join(authority)


def _canvas(root: Element, features: Features) -> None:
    """Set the initial view: all points."""
    canvas = SubElement(root, "mapcanvas", name="theMapCanvas", annotationsVisible="1")
    SubElement(canvas, "units").text = "meters"
    extent = SubElement(canvas, "extent")
    vertices = features.layer("points").vertices_m
    places = np.concatenate(vertices) if vertices else np.zeros((1, 3))
    if features.origin is not None and features.crs is not None:
        places = projected_from_enu(places, features.origin, features.crs)
    low, high = places[:, :2].min(axis=0), places[:, :2].max(axis=0)
    room = max(ROOM_SHARE * float((high - low).max()), LEAST_ROOM_M)
    for name, value in zip(
        ("xmin", "ymin", "xmax", "ymax"), (*(low - room), *(high + room)), strict=True
    ):
        SubElement(extent, name).text = f"{value:.3f}"
    _crs(SubElement(canvas, "destinationsrs"), features.crs)


def quote_name(name: str) -> str:
    """Quote the name of a table or a column for SQL."""
    return '"' + name.replace('"', '""') + '"'


# OGC 12-128r18 (GeoPackage 1.3), annex C; only its core and the tables for feature layers. GDAL
# before 3.7, still in use on long-lived systems, warns of newer versions.
_APPLICATION_ID, _USER_VERSION = 0x47504B47, 10300  # "GPKG", 1.3.0
_CORE = f"""
PRAGMA synchronous = OFF;  -- who hands the file on waits for the disk, once (`stage_output`)
PRAGMA application_id = {_APPLICATION_ID};
PRAGMA user_version = {_USER_VERSION};
CREATE TABLE gpkg_spatial_ref_sys (
    srs_name TEXT NOT NULL, srs_id INTEGER PRIMARY KEY, organization TEXT NOT NULL,
    organization_coordsys_id INTEGER NOT NULL, definition TEXT NOT NULL, description TEXT
);
CREATE TABLE gpkg_contents (
    table_name TEXT NOT NULL PRIMARY KEY, data_type TEXT NOT NULL, identifier TEXT UNIQUE,
    description TEXT DEFAULT '',
    last_change DATETIME NOT NULL DEFAULT (strftime('%Y-%m-%dT%H:%M:%fZ','now')),
    min_x DOUBLE, min_y DOUBLE, max_x DOUBLE, max_y DOUBLE, srs_id INTEGER,
    CONSTRAINT fk_gc_r_srs_id FOREIGN KEY (srs_id) REFERENCES gpkg_spatial_ref_sys(srs_id)
);
CREATE TABLE gpkg_geometry_columns (
    table_name TEXT NOT NULL, column_name TEXT NOT NULL, geometry_type_name TEXT NOT NULL,
    srs_id INTEGER NOT NULL, z TINYINT NOT NULL, m TINYINT NOT NULL,
    CONSTRAINT pk_geom_cols PRIMARY KEY (table_name, column_name),
    CONSTRAINT uk_gc_table_name UNIQUE (table_name),
    CONSTRAINT fk_gc_tn FOREIGN KEY (table_name) REFERENCES gpkg_contents(table_name),
    CONSTRAINT fk_gc_srs FOREIGN KEY (srs_id) REFERENCES gpkg_spatial_ref_sys (srs_id)
);
"""
_TYPES = {"point": "POINT", "line": "LINESTRING", "polygon": "POLYGON"}
_LOCAL = 'LOCAL_CS["local metres: x east, y north",UNIT["metre",1]]'
_NUMBERS = ("value", "sigma", "lower_95", "upper_95", "w")
_UNITS = ("_m", "_m2", "_deg", "_s")
"""Columns of numbers: by their names, and by their units."""
# as created by QGIS (QgsOgrProvider, "saveStyle")
_STYLES = """
CREATE TABLE layer_styles (
    id INTEGER PRIMARY KEY AUTOINCREMENT NOT NULL,
    f_table_catalog TEXT(256), f_table_schema TEXT(256), f_table_name TEXT(256),
    f_geometry_column TEXT(256), styleName TEXT(30), styleQML TEXT, styleSLD TEXT,
    useAsDefault BOOLEAN, description TEXT, owner TEXT(30), ui TEXT(30),
    update_time DATETIME DEFAULT (strftime('%Y-%m-%dT%H:%M:%fZ','now'))
)
"""
# ISO WKB codes of geometries with height (OGC 06-103r4, table 7)
_WKB_TYPES = {"point": 1001, "line": 1002, "polygon": 1003}


Quantity = Callable[[float, float, str], str]


def write_geopackage(
    features: Features,
    path: Path,
    looks: Looks = MappingProxyType({}),
    words: Quantity | None = None,
) -> None:
    """Write all layers with shapes, in the projected coordinate system, else in local metres.

    Heights are those of the local origin's datum; without an origin they are above the plane.

    Parameters
    ----------
    features
        Survey to write.
    path
        The file.
    looks
        Styles with which QGIS shows layers when they are added to a map, by layer name.
    words
        Format of the numbers in the column ``text`` of measured layers and known lengths; if
        omitted, there is no such column.
    """
    features = replace(features, layers=tuple(layer for layer in features.layers if len(layer)))
    # In memory: SQLite itself opens no path of more than 512 bytes.
    with closing(sqlite3.connect(":memory:")) as file:
        with file:
            file.executescript(_CORE)
            file.executemany(
                "INSERT INTO gpkg_spatial_ref_sys VALUES (?, ?, ?, ?, ?, '')", _everywhere()
            )
            system = _system_of(features.crs)
            file.execute(
                "INSERT OR IGNORE INTO gpkg_spatial_ref_sys VALUES (?, ?, ?, ?, ?, '')", system
            )
            for layer in features.layers:
                texts = () if words is None else layer.value_texts(words)
                attributes = layer.attributes | ({"text": texts} if texts else {})
                shapes = _on_map(features, layer)
                _write_layer(file, layer, shapes, attributes, system.srs_id)
                file.execute(
                    "UPDATE gpkg_contents SET description = ? WHERE table_name = ?",
                    (_heights(features), layer.name),
                )
            _write_styles(file, features, looks)
        path.write_bytes(file.serialize())


class _System(NamedTuple):
    """A coordinate system in the form of the file's table."""

    name: str
    srs_id: int
    organization: str
    number: int
    definition: str


_OWN_SYSTEM = 100_000  # beyond EPSG's numbers


def _everywhere() -> tuple[_System, ...]:
    """Return the systems that every such file must have (requirement 11)."""
    return (
        _System("undefined Cartesian", -1, "NONE", -1, "undefined"),
        _System("undefined geographic", 0, "NONE", 0, "undefined"),
        _system_of("EPSG:4326"),
    )


def _system_of(crs: str | None) -> _System:
    """Return the system of all layers, by EPSG's number, else only by its definition."""
    if crs is None:
        return _System("local metres", _OWN_SYSTEM, "NONE", _OWN_SYSTEM, _LOCAL)
    system = CRS.from_user_input(crs)
    try:
        definition = system.to_wkt("WKT1_GDAL")  # which every program reads
    except CRSError:  # the older form cannot express it
        definition = system.to_wkt()
    organization, number = system.to_authority() or ("NONE", "")
    if organization != "EPSG" or not number.isdigit():
        return _System(system.name, _OWN_SYSTEM, "NONE", _OWN_SYSTEM, definition)
    return _System(system.name, int(number), organization, int(number), definition)


def _write_layer(
    file: sqlite3.Connection,
    layer: Layer,
    shapes: tuple[Floats, ...],
    attributes: Mapping[str, Attribute],
    srs_id: int,
) -> None:
    """Write one table of shapes and attributes, and register it."""
    fields = {key: _field(values) for key, values in attributes.items()}
    columns = "".join(
        f", {quote_name(key)} {_kind(key, values)}" for key, values in attributes.items()
    )
    file.execute(
        f"CREATE TABLE {quote_name(layer.name)} (fid INTEGER PRIMARY KEY AUTOINCREMENT NOT NULL, "
        f"geom {_TYPES[layer.kind]}{columns})"
    )
    bounds = _bounds(shapes)
    west, _, south, _ = np.fmin.reduce(bounds, axis=0, initial=np.nan)
    _, east, _, north = np.fmax.reduce(bounds, axis=0, initial=np.nan)
    file.execute(
        "INSERT INTO gpkg_contents (table_name, data_type, identifier, min_x, min_y, max_x, max_y, "
        "srs_id) VALUES (?, 'features', ?, ?, ?, ?, ?, ?)",
        (layer.name, layer.name, west, south, east, north, srs_id),
    )
    file.execute(
        "INSERT INTO gpkg_geometry_columns VALUES (?, 'geom', ?, ?, 1, 0)",
        (layer.name, _TYPES[layer.kind], srs_id),
    )
    marks = ", ".join("?" * (1 + len(fields)))
    names = ", ".join(["geom", *map(quote_name, fields)])
    placed_shapes = zip(shapes, bounds.tolist(), strict=True)
    coded = (_geometry(layer, shape, around, srs_id) for shape, around in placed_shapes)
    rows = zip(coded, *fields.values(), strict=True)
    sql = f"INSERT INTO {quote_name(layer.name)} ({names}) VALUES ({marks})"  # noqa: S608 - quoted
    file.executemany(sql, rows)


def _heights(features: Features) -> str:
    """Return the description of heights, which a coordinate system of maps does not give."""
    if features.origin is None:
        return "metres; heights above the plane of the ground"
    above = "mean sea level" if features.height_datum == "msl" else "the WGS 84 ellipsoid"
    return f"heights in metres above {above}"


def _write_styles(file: sqlite3.Connection, features: Features, looks: Looks) -> None:
    """Write the table of styles from which QGIS takes the default one of a layer."""
    styles = [
        (layer.name, "geom", layer.name, tostring(create_style(look, layer.kind), "unicode"))
        for layer in features.layers
        if (look := looks.get(layer.name)) is not None
    ]
    if not styles:
        return
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


def _on_map(features: Features, layer: Layer) -> tuple[Floats, ...]:
    """Return the vertices of each shape on the map."""
    origin, crs = features.origin, features.crs
    if origin is None or crs is None:
        return layer.transform(lambda enu: enu)
    return layer.transform(lambda enu: projected_from_enu(enu, origin, crs))


def _field(values: Attribute) -> list[str] | list[float]:
    """Return a column; NaN becomes NULL (SQLite converts it)."""
    if values and isinstance(values[0], str):
        return [str(value) for value in values]
    return [float(value) for value in values]


def _kind(name: str, values: Attribute) -> str:
    """Return the type of a column, also in a layer without shapes, for programs that fill it."""
    if values:
        return "TEXT" if isinstance(values[0], str) else "REAL"
    return "REAL" if name in _NUMBERS or name.endswith(_UNITS) else "TEXT"


def _bounds(shapes: tuple[Floats, ...]) -> Floats:
    """Return (N, 4) west, east, south, north of shapes (v, 3); NaN for those without a position."""
    bounds = np.full((len(shapes), 4), np.nan)
    counts = np.array([len(shape) for shape in shapes], np.int64)
    there = np.flatnonzero(counts)
    if len(there):
        begin = (np.cumsum(counts) - counts)[there]
        corners = np.concatenate(shapes)[:, :2]
        bounds[there, ::2] = np.minimum.reduceat(corners, begin)
        bounds[there, 1::2] = np.maximum.reduceat(corners, begin)
    return bounds


def _geometry(layer: Layer, vertices: Floats, bounds: list[float], srs_id: int) -> bytes | None:
    """Encode one shape, little-endian: header, bounds, well-known binary; None without position."""
    if not len(vertices):
        return None
    has_bounds = layer.kind != "point"
    head = struct.pack("<2sBBi", b"GP", 0, 1 | has_bounds << 1, srs_id)
    if has_bounds:
        head += struct.pack("<4d", *bounds)
    counts = {"point": (), "line": (len(vertices),), "polygon": (1, len(vertices))}[layer.kind]
    head += struct.pack(f"<B{1 + len(counts)}I", 1, _WKB_TYPES[layer.kind], *counts)
    return head + vertices.astype("<f8").tobytes()
