"""Writer of survey.kml: the survey for Google Earth and other globes (OGC KML 2.3)."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType
from xml.etree.ElementTree import Element, ElementTree, SubElement

import numpy as np

from uavgram.geometry.earth.geodesy import Origin, geodetic_from_enu
from uavgram.model.arrays import Floats
from uavgram.model.maps import HIDDEN, Features, Layer, LayerStyle

_NAMESPACE = "http://www.opengis.net/kml/2.2"
_UNSEEN = ("verticals", "planned_accuracy")
"""Layers left out: points have their own lines to the ground; map cells would hide the globe."""
_NO_PLACE = "Nothing ties this survey to the earth, so nothing of it can be drawn on a globe."


def write_kml(
    features: Features, path: Path, looks: Mapping[str, LayerStyle] = MappingProxyType({})
) -> None:
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
        SubElement(document, "description").text = _NO_PLACE
    else:
        shown = [layer for layer in features.layers if layer.name not in _UNSEEN]
        for layer in shown:
            _style(document, layer, looks.get(layer.name, _default_look(layer)).globe)
        for layer in shown:
            title = looks.get(layer.name, _default_look(layer)).title
            _folder(document, layer, f"{title[:1].upper()}{title[1:]}", features.origin)
    ElementTree(root).write(path, encoding="utf-8", xml_declaration=True)


def _default_look(layer: Layer) -> LayerStyle:
    return LayerStyle(title=layer.name.replace("_", " "), colour="#ffffff")


def _style(document: Element, layer: Layer, colour: str) -> None:
    style = SubElement(document, "Style", id=layer.name)
    if layer.kind == "point":
        SubElement(SubElement(style, "IconStyle"), "color").text = colour
    line = SubElement(style, "LineStyle")
    SubElement(line, "color").text = colour
    SubElement(line, "width").text = "2"
    if layer.kind == "polygon":
        SubElement(SubElement(style, "PolyStyle"), "color").text = "1a" + colour[2:]


def _folder(document: Element, layer: Layer, title: str, origin: Origin) -> None:
    folder = SubElement(document, "Folder")
    SubElement(folder, "name").text = title
    visibility = "0" if layer.name in HIDDEN else "1"
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
        _geometry(mark, layer, places)


def _places(layer: Layer, origin: Origin) -> tuple[Floats, ...]:
    """Return (v, 3) longitude, latitude, height above ground of each shape, rings closed."""
    above = layer.above_ground_m
    if layer.name == "camera_poses":
        above = tuple(center[:, 2] for center in layer.vertices_m)
    shapes = layer.placed(lambda enu: _on_globe(enu, origin))
    for shape, heights in zip(shapes, above, strict=bool(above)):
        shape[:, 2] = np.resize(heights, len(shape))  # the last vertex of a ring is its first
    return shapes


def _on_globe(enu: Floats, origin: Origin) -> Floats:
    latitude, longitude, _ = geodetic_from_enu(enu, origin)
    return np.stack([longitude, latitude, np.zeros(len(enu))], axis=1)


def _geometry(mark: Element, layer: Layer, places: Floats) -> None:
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
