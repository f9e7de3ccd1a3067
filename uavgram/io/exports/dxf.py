"""The survey as a CAD drawing (DXF R2010, metres): points, lines, real dimensions, ellipses."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from ezdxf import const, units
from ezdxf.document import Drawing
from ezdxf.enums import TextEntityAlignment
from ezdxf.filemanagement import new
from ezdxf.layouts.layout import Modelspace

from uavgram.geometry.earth.map_projection import map_scale, projected_from_enu
from uavgram.model.arrays import Floats
from uavgram.model.maps.layers import HIDDEN, Features, Layer

Place = Callable[[Floats], Floats]

POINT_BLOCK = "SURVEY_POINT"
# Name in the drawing, and colour of AutoCAD's index.
_LAYERS = {
    "footprints": ("PHOTO_FOOTPRINTS", 252),
    "camera_poses": ("CAMERAS", 5),
    "ellipses_95": ("ELLIPSES_95", 30),
    "ellipses_95_within_survey": ("ELLIPSES_95_WITHIN_SURVEY", 40),
    "known_lengths": ("KNOWN_LENGTHS", 6),
    "measured_areas": ("MEASURED_AREAS", 134),
    "measured_lines": ("MEASURED_LINES", 134),
    "points": ("POINTS", 7),
}
_LABELS, _DIMENSIONS, _NOTES = "LABELS", "DIMENSIONS", "NOTES"
_UNITS = {"m": "m", "m2": "m²", "m3": "m³", "deg": "°", "m/s": "m/s"}
_DOUBT = " ?"
"""After a value that is another one in another solution that fits as well."""

_TEXT_SHARE = 1 / 80  # of the drawing's extent is the height of its letters


@dataclass(frozen=True)
class _Sheet:
    """A drawing under way: where local metres go, and the height of letters [m]."""

    document: Drawing
    space: Modelspace
    place: Place
    text_m: float


def write_local_dxf(features: Features, path: Path) -> None:
    """Write the drawing in local metres: every distance in it is the distance on the ground."""
    note = "local metres: x east, y north, z up; distances are true ground distances"
    if features.origin is None:
        note = "local metres; position and direction of north are arbitrary, distances are true"
    _write(features, path, lambda enu: enu, note)


def write_map_dxf(features: Features, path: Path) -> None:
    """Write the drawing in the projected coordinate system of the survey, which it must have.

    The texts of dimensions are ground values; what CAD measures is longer or shorter by the
    projection's scale, which a note in the drawing states.
    """
    if features.origin is None or features.crs is None:
        raise ValueError("a drawing on the map needs a survey that lies on the earth")
    origin, crs = features.origin, features.crs
    note = (
        f"{crs}; map distance = ground distance x {map_scale(origin, crs):.6f}; "
        "texts of dimensions are ground values"
    )
    _write(features, path, lambda enu: projected_from_enu(enu, origin, crs), note)


def _write(features: Features, path: Path, place: Place, note: str) -> None:
    document = new("R2010", setup=["linetypes", "styles"], units=units.M)
    for name, colour in (*_LAYERS.values(), (_LABELS, 7), (_DIMENSIONS, 134), (_NOTES, 8)):
        document.layers.add(name, color=colour)
    for hidden in HIDDEN:
        document.layers.get(_LAYERS[hidden][0]).freeze()  # some programs do not know "off"
    text_m = _text_height(features)
    sheet = _Sheet(document, document.modelspace(), place, text_m)
    _point_block(document, text_m)
    _dimension_style(document, text_m)
    for layer in features.layers:
        _draw(sheet, layer)
    _note(sheet, features, note)
    _look_at_points(sheet, features)
    document.saveas(path)


def _look_at_points(sheet: _Sheet, features: Features) -> None:
    """What a program shows first: all points, with their dimensions."""
    vertices = features.layer("points").vertices_m
    if not vertices:
        return
    placed = sheet.place(np.concatenate(vertices))[:, :2]
    low, high = placed.min(axis=0), placed.max(axis=0)
    height = max(1.3 * float((high - low).max()), 20 * sheet.text_m)
    sheet.document.set_modelspace_vport(height, tuple(((low + high) / 2).tolist()))
    sheet.document.header["$EXTMIN"] = (*low.tolist(), 0.0)
    sheet.document.header["$EXTMAX"] = (*high.tolist(), 0.0)


def _text_height(features: Features) -> float:
    vertices = features.layer("points").vertices_m
    if len(vertices) < 2:
        return 0.25
    corners = np.concatenate(vertices)[:, :2]
    return max(float(np.ptp(corners, axis=0).max()) * _TEXT_SHARE, 0.01)


def _point_block(document: Drawing, text_m: float) -> None:
    """A cross; label and standard deviations are hidden attributes, for some programs draw none."""
    block = document.blocks.new(POINT_BLOCK)
    half = 0.4 * text_m
    block.add_line((-half, 0), (half, 0))
    block.add_line((0, -half), (0, half))
    for row, tag in enumerate(("LABEL", "SIGMA_EAST_M", "SIGMA_NORTH_M")):
        attribute = block.add_attdef(
            tag,
            (half, half - 1.3 * row * text_m),
            dxfattribs={"height": text_m, "layer": _LABELS, "flags": const.ATTRIB_INVISIBLE},
        )
        attribute.dxf.prompt = tag


def _dimension_style(document: Drawing, text_m: float) -> None:
    style = document.dimstyles.duplicate_entry("Standard", "UAVGRAM")
    sizes = {"dimtxt": 1.0, "dimasz": 0.8, "dimexe": 0.3, "dimexo": 0.3, "dimgap": 0.3}
    for name, share in sizes.items():
        style.set_dxf_attrib(name, share * text_m)
        # for programs that draw all dimensions alike, as the header says (LibreCAD 2.2)
        document.header[f"${name.upper()}"] = share * text_m
    document.header["$DIMSCALE"] = 1.0
    style.dxf.dimclrd = style.dxf.dimclre = style.dxf.dimclrt = const.BYLAYER


def _draw(sheet: _Sheet, layer: Layer) -> None:
    name = _LAYERS[layer.name][0]
    if layer.name.startswith("ellipses"):
        _ellipses(sheet, layer, name)
    elif layer.name == "points":
        _points(sheet, layer, name)
    elif layer.name == "footprints":
        _footprints(sheet, layer, name)
    elif layer.kind == "point":
        for vertices in layer.vertices_m:
            sheet.space.add_point(sheet.place(vertices)[0], dxfattribs={"layer": name})
    else:
        for vertices in layer.vertices_m:
            if len(vertices):
                sheet.space.add_polyline3d(
                    sheet.place(vertices),
                    close=layer.kind == "polygon",
                    dxfattribs={"layer": name},
                )
        _values(sheet, layer)


def _points(sheet: _Sheet, layer: Layer, name: str) -> None:
    if not len(layer):
        return
    placed = sheet.place(np.concatenate(layer.vertices_m)).tolist()
    keys = ("label", "sigma_east_m", "sigma_north_m")
    rows = zip(placed, *(layer.attributes[key] for key in keys), strict=True)
    for place, label, east, north in rows:
        insert = sheet.space.add_blockref(POINT_BLOCK, tuple(place), dxfattribs={"layer": name})
        insert.add_auto_attribs(
            {
                "LABEL": str(label),
                "SIGMA_EAST_M": f"{float(east):.4f}",
                "SIGMA_NORTH_M": f"{float(north):.4f}",
            }
        )
        beside = (place[0] + 0.4 * sheet.text_m, place[1] + 0.4 * sheet.text_m)
        sheet.space.add_text(
            str(label), height=sheet.text_m, dxfattribs={"layer": _LABELS, "insert": beside}
        )


def _footprints(sheet: _Sheet, layer: Layer, name: str) -> None:
    """Level outlines at their middle height: background, which may be large."""
    for ring in layer.vertices_m:
        placed = sheet.place(ring)
        sheet.space.add_lwpolyline(
            placed[:, :2].tolist(),
            close=True,
            dxfattribs={"layer": name, "elevation": float(placed[:, 2].mean())},
        )


def _ellipses(sheet: _Sheet, layer: Layer, name: str) -> None:
    """True ellipses; their axes turn and stretch with the map."""
    if not len(layer):
        return
    keys = ("semi_major_m", "semi_minor_m", "azimuth_deg")
    major, minor, azimuth = (np.array(layer.attributes[key], np.float64) for key in keys)
    azimuth = np.radians(azimuth)
    center = np.stack([outline.mean(axis=0) for outline in layer.vertices_m])
    along = np.stack([np.sin(azimuth), np.cos(azimuth), np.zeros(len(layer))], axis=1)
    drawn = sheet.place(np.concatenate([center, center + major[:, None] * along]))
    middle, axis = drawn[: len(layer)], drawn[len(layer) :] - drawn[: len(layer)]
    axis[:, 2] = 0.0
    for row in np.flatnonzero((major > 0) & np.isfinite(minor)):
        sheet.space.add_ellipse(
            tuple(middle[row].tolist()),
            major_axis=tuple(axis[row].tolist()),
            ratio=min(max(float(minor[row] / major[row]), 1e-6), 1.0),
            dxfattribs={"layer": name},
        )


def _values(sheet: _Sheet, layer: Layer) -> None:
    """Dimensions on two-point distances, a text on everything else that has a value."""
    is_known = layer.name == "known_lengths"
    if not is_known and not layer.name.startswith("measured"):
        return
    value, sigma = ("length_m", "sigma_m") if is_known else ("value", "sigma")
    for row, strip in enumerate(layer.vertices_m):
        one = {key: values[row] for key, values in layer.attributes.items()}
        unit = str(one.get("unit", "m"))
        text = _value_text(one[value], one[sigma], unit)
        text += _DOUBT if one.get("alternatives") else ""
        if len(strip) == 2 and unit == "m":
            _dimension(sheet, strip, _LAYERS[layer.name][0] if is_known else _DIMENSIONS, text)
        elif len(strip):
            middle = sheet.place(strip.mean(axis=0, keepdims=True))[0]
            _text(sheet, middle, f"{one['name']}: {text}", _DIMENSIONS)


def _value_text(value: object, sigma: object, unit: str) -> str:
    return f"{float(str(value)):.3f} ±{float(str(sigma)):.3f} {_UNITS.get(unit, unit)}"


def _dimension(sheet: _Sheet, ends: Floats, layer: str, text: str) -> None:
    start, end = sheet.place(ends)[:, :2]
    if np.linalg.norm(end - start) < 1e-6:
        return
    sheet.space.add_aligned_dim(
        p1=tuple(start),
        p2=tuple(end),
        distance=2.5 * sheet.text_m,
        text=text,
        dimstyle="UAVGRAM",
        dxfattribs={"layer": layer},
    ).render()


def _text(sheet: _Sheet, at: Floats, text: str, layer: str) -> None:
    sheet.space.add_text(text, height=sheet.text_m, dxfattribs={"layer": layer}).set_placement(
        tuple(at), align=TextEntityAlignment.MIDDLE_CENTER
    )


def _note(sheet: _Sheet, features: Features, note: str) -> None:
    vertices = features.layer("points").vertices_m
    if not vertices:
        return
    layers = (features.layer(name) for name in ("measured_areas", "measured_lines"))
    if any(any(layer.attributes["alternatives"]) for layer in layers):
        note += f";{_DOUBT} = other solutions fit as well and give other values, see the report"
    low = np.concatenate(vertices).min(axis=0, keepdims=True)
    corner = sheet.place(low)[0] - np.array([0.0, 6.0 * sheet.text_m, 0.0])
    sheet.space.add_text(
        f"{features.name}: {note}", height=sheet.text_m, dxfattribs={"layer": _NOTES}
    ).set_placement((corner[0], corner[1]))
