"""Writer of survey.qgs: a QGIS project of survey.gpkg and ground.tif, drawn as in the report."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from xml.etree.ElementTree import Element, ElementTree, SubElement, indent

import numpy as np
from pyproj import CRS

from uavgram.geometry.earth.geodesy import projected_from_enu
from uavgram.io.exports.qgis_styles import Look, fill_style
from uavgram.model.maps import Features, Layer

GEOPACKAGE, GROUND = "survey.gpkg", "ground.tif"
ROOM_SHARE, LEAST_ROOM_M = 0.1, 1.0
_GEOMETRY = {"point": "Point", "line": "Line", "polygon": "Polygon"}
_GROUND_NAME = "ground"


def write_qgis_project(
    features: Features, looks: Mapping[str, Look], path: Path, *, has_ground: bool
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


def _vector(layers: Element, layer: Layer, look: Look, source: str, crs: str | None) -> None:
    one = SubElement(layers, "maplayer", type="vector", geometry=_GEOMETRY[layer.kind])
    _common(one, layer.name, look.title, source, crs)
    SubElement(one, "provider", encoding="UTF-8").text = "ogr"
    fill_style(one, look, layer.kind)


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
