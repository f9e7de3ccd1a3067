"""QGIS project (survey.qgs) of survey.gpkg and ground.tif, and styles of its layers (QML).

The layers are drawn as in the report, in the same style in GeoPackage and project.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from xml.etree.ElementTree import Element, ElementTree, SubElement, indent

import numpy as np
from pyproj import CRS

from uavgram.geometry.earth.geodesy import projected_from_enu
from uavgram.model.maps import Features, Layer, LayerStyle, ShapeKind

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


def write_qgis_project(
    features: Features, looks: Mapping[str, LayerStyle], path: Path, *, has_ground: bool
) -> None:
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
