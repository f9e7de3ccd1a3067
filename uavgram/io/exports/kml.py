"""Writer of survey.kml: the survey for Google Earth and other globes (OGC KML 2.3)."""

from __future__ import annotations

import math
from pathlib import Path
from xml.etree.ElementTree import Element, ElementTree, SubElement

import numpy as np

from uavgram.geometry.earth.geodesy import Origin, geodetic_from_enu
from uavgram.model.arrays import Floats
from uavgram.model.maps import HIDDEN, Features, Layer, transform_vertices

_NAMESPACE = "http://www.opengis.net/kml/2.2"
# title, and colour as aabbggrr, the order of KML; polygons are filled with a tenth of it
_LAYERS = {
    "footprints": ("Photo footprints", "99ffffff"),
    "camera_poses": ("Cameras", "ffffaa55"),
    "ellipses_95": ("95 % ellipses", "ff007be0"),
    "ellipses_95_within_survey": ("95 % ellipses within the survey", "ff00c8ff"),
    "known_lengths": ("Known lengths", "ff7a12b0"),
    "control_lines": ("Lines of known position", "ff9c27b0"),
    "measured_areas": ("Measured areas", "ff6b7900"),
    "measured_lines": ("Measured lines", "ff6b7900"),
    "points": ("Points", "ff00ffff"),
    "planned_footprints": ("What photos will show", "99ffffff"),
    "planned_area": ("Area", "ffffffff"),
    "planned_no_go": ("Keep out", "ff0000ff"),
    "planned_corners": ("Corners of the area", "ffffffff"),
    "planned_flight": ("Flight", "ffffaa55"),
    "planned_photos": ("Photos to take", "ffffaa55"),
    "planned_measurements": ("Planned measurements", "ff6b7900"),
    "planned_points": ("Points to measure", "ff6b7900"),
    "planned_lines": ("Lines to lay and tape", "ff7a12b0"),
    "planned_plates": ("Plates to lay", "ff7a12b0"),
    "planned_line_ends": ("Ends of lines", "ff7a12b0"),
}
_UNSEEN = ("verticals", "planned_accuracy")
"""Layers left out: points have their own lines to the ground; map cells would hide the globe."""
_HIDDEN = (*HIDDEN, "planned_footprints")
_NO_PLACE = "Nothing ties this survey to the earth, so nothing of it can be drawn on a globe."


def write_kml(features: Features, path: Path) -> None:
    """Write all layers as folders.

    Shapes on the ground are on the globe's terrain; shapes off it are drawn at their height above
    the ground over that terrain, points with a line down to it, and cameras at their height.
    """
    root = Element("kml", xmlns=_NAMESPACE)
    document = SubElement(root, "Document")
    SubElement(document, "name").text = features.name
    if features.origin is None:
        SubElement(document, "description").text = _NO_PLACE
    else:
        shown = [layer for layer in features.layers if layer.name not in _UNSEEN]
        for layer in shown:
            _style(document, layer)
        for layer in shown:
            _folder(document, layer, features.origin)
    ElementTree(root).write(path, encoding="utf-8", xml_declaration=True)


def _style(document: Element, layer: Layer) -> None:
    style = SubElement(document, "Style", id=layer.name)
    colour = _title_and_colour(layer)[1]
    if layer.kind == "point":
        SubElement(SubElement(style, "IconStyle"), "color").text = colour
    line = SubElement(style, "LineStyle")
    SubElement(line, "color").text = colour
    SubElement(line, "width").text = "2"
    if layer.kind == "polygon":
        SubElement(SubElement(style, "PolyStyle"), "color").text = "1a" + colour[2:]


def _title_and_colour(layer: Layer) -> tuple[str, str]:
    """Return title and colour of a layer, by default its own name, and white."""
    return _LAYERS.get(layer.name, (layer.name.replace("_", " ").capitalize(), "ffffffff"))


def _folder(document: Element, layer: Layer, origin: Origin) -> None:
    folder = SubElement(document, "Folder")
    SubElement(folder, "name").text = _title_and_colour(layer)[0]
    visibility = "0" if layer.name in _HIDDEN else "1"
    SubElement(folder, "visibility").text = visibility
    folder.tail = "\n"
    names = next(iter(layer.attributes.values()))  # label, name or frame comes first
    for row, places in enumerate(_places(layer, origin)):
        if not len(places):
            continue
        mark = SubElement(folder, "Placemark")
        mark.tail = "\n"
        SubElement(mark, "name").text = str(names[row])
        SubElement(mark, "visibility").text = visibility
        SubElement(mark, "styleUrl").text = f"#{layer.name}"
        data = SubElement(mark, "ExtendedData")
        for key, values in layer.attributes.items():
            value = values[row]
            if value == "" or (isinstance(value, float) and not math.isfinite(value)):
                continue
            SubElement(SubElement(data, "Data", name=key), "value").text = str(value)
        _geometry(mark, layer, places)


def _places(layer: Layer, origin: Origin) -> tuple[Floats, ...]:
    """Return (v, 3) longitude, latitude, height above ground of each shape, rings closed."""

    def on_globe(enu: Floats) -> Floats:
        latitude, longitude, _ = geodetic_from_enu(enu, origin)
        return np.stack([longitude, latitude, np.zeros(len(enu))], axis=1)

    shapes = transform_vertices(layer.vertices_m, on_globe)
    above = layer.above_ground_m
    if layer.name == "camera_poses":
        above = tuple(center[:, 2] for center in layer.vertices_m)
    if above:
        shapes = tuple(
            np.column_stack([shape[:, :2], height])
            for shape, height in zip(shapes, above, strict=True)
        )
    if layer.kind == "polygon":
        shapes = tuple(np.concatenate([ring, ring[:1]]) for ring in shapes)
    return shapes


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
