"""The survey as a CAD drawing (DXF R2010, metres): points, lines, real dimensions, ellipses.

Everything lies at its height; a program that shows plans shows it from above. Measured profiles
have sheets of their own.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
from ezdxf import const, units
from ezdxf.document import Drawing
from ezdxf.enums import TextEntityAlignment
from ezdxf.filemanagement import new

from uavgram.geometry.earth.map_projection import map_scale, projected_from_enu
from uavgram.io.exports.dxf_points import add_point_block, draw_points
from uavgram.io.exports.dxf_profiles import draw_profiles
from uavgram.io.exports.dxf_sheet import LABELS, LAYERS, Place, Sheet, Words, half_size
from uavgram.model.arrays import Floats, Ints
from uavgram.model.maps.layers import HIDDEN, Features, Layer, placed
from uavgram.stages.products.text_places import Choice, TextPlaces, around

METRIC = Words()
"""Numbers in metres, as the drawing itself."""

_DIMENSIONS, _NOTES = "DIMENSIONS", "NOTES"
_UPRIGHT = {"height", "vertical_distance"}
"""Kinds of measurement that have no length in a plan."""
_NOT_IN_SPACE = {*_UPRIGHT, "horizontal_distance", "profile"}
_IN_SPACE = " (3-D)"
"""After a length to or from a point off the ground: seen from above it is shorter."""
_DOUBT = " ?"
"""After a value that is another one in another solution that fits as well."""

_SHARES = (0.5, 0.35, 0.65, 0.2, 0.8)
"""Of a dimension line, where its text may stand."""
_CROWDED = 16
_GAP = 0.3  # around the text of a dimension, in heights of a letter
_FAR = 1e6  # heights of a letter: farther than any drawing reaches
_PAPER_M = (0.420, 0.297)  # A3
_TEXT_SHARE = 1 / 80  # of the drawing's extent is the height of its letters,
_CROWD = 0.2  # or, of many points, what leaves three quarters of an evenly filled sheet empty


def write_local_dxf(
    features: Features, path: Path, words: Words = METRIC, room: list[Choice] | None = None
) -> None:
    """Write the drawing in local metres: every distance in it is the distance on the ground.

    Parameters
    ----------
    features
        What is drawn.
    path
        The file.
    words
        By which texts and dimensions are written.
    room
        Where texts went in another drawing of the same features, if there was one; then here.
    """
    note = "local metres: x east, y north, z up; distances are true ground distances"
    if features.origin is None:
        note = "local metres; position and direction of north are arbitrary, distances are true"
    _write(features, path, lambda enu: enu, note, words, room)


def write_map_dxf(
    features: Features, path: Path, words: Words = METRIC, room: list[Choice] | None = None
) -> None:
    """Write the drawing in the projected coordinate system of the survey, which it must have.

    The texts of dimensions are ground values; what CAD measures is longer or shorter by the
    projection's scale, which a note in the drawing states.

    Parameters
    ----------
    features
        What is drawn.
    path
        The file.
    words
        By which texts and dimensions are written.
    room
        Where texts went in another drawing of the same features, if there was one; then here.
    """
    if features.origin is None or features.crs is None:
        raise ValueError("a drawing on the map needs a survey that lies on the earth")
    origin, crs = features.origin, features.crs
    note = (
        f"{crs}; map distance = ground distance x {map_scale(origin, crs):.6f}; "
        "texts of dimensions are ground values"
    )
    _write(features, path, lambda enu: projected_from_enu(enu, origin, crs), note, words, room)


def _write(
    features: Features,
    path: Path,
    place: Place,
    note: str,
    words: Words,
    room: list[Choice] | None,
) -> None:
    document = new("R2010", units=units.M)
    for name, colour in (*LAYERS.values(), (LABELS, 7), (_DIMENSIONS, 134), (_NOTES, 8)):
        document.layers.add(name, color=colour)
    for hidden in HIDDEN:
        document.layers.get(LAYERS[hidden][0]).freeze()  # some programs do not know "off"
    text_m = _text_height(features)
    places = TextPlaces(room or ())
    sheet = Sheet(document, document.modelspace(), place, text_m, words, places)
    add_point_block(document, text_m)
    _dimension_style(document, text_m)
    _keep_free_below(sheet, _below(sheet, features))
    # Labels first: they stand at their points, while dimensions can go farther out.
    for layer in sorted(features.layers, key=lambda one: one.name != "points"):
        _draw(sheet, layer)
    draw_profiles(document, features.profiles, _below(sheet, features), text_m, words)
    _note(sheet, features, note)
    _look_at_points(sheet, features)
    if room is not None:
        room[:] = places.choices
    document.saveas(path)


def _look_at_points(sheet: Sheet, features: Features) -> None:
    """What a program shows first: all points, with their dimensions."""
    vertices = features.layer("points").vertices_m
    if not vertices:
        return
    shown = sheet.place(np.concatenate(vertices))[:, :2]
    low, high = shown.min(axis=0), shown.max(axis=0)
    height = max(1.3 * float((high - low).max()), 20 * sheet.text_m)
    sheet.document.set_modelspace_vport(height, tuple(((low + high) / 2).tolist()))
    # ezdxf writes the header from these; LibreCAD takes the limits for its paper, in our metres
    sheet.space.dxf.extmin, sheet.space.dxf.extmax = (*low.tolist(), 0.0), (*high.tolist(), 0.0)
    sheet.document.layout("Layout1").dxf.limmax = _PAPER_M


def _text_height(features: Features) -> float:
    vertices = features.layer("points").vertices_m
    if len(vertices) < 2:
        return 0.25
    corners = np.concatenate(vertices)[:, :2]
    share = min(_TEXT_SHARE, _CROWD / float(np.sqrt(len(corners))))
    return max(float(np.ptp(corners, axis=0).max()) * share, 0.01)


def _dimension_style(document: Drawing, text_m: float) -> None:
    style = document.dimstyles.duplicate_entry("Standard", "UAVGRAM")
    sizes = {"dimtxt": 1.0, "dimasz": 0.8, "dimexe": 0.3, "dimexo": 0.3, "dimgap": _GAP}
    for name, share in sizes.items():
        style.set_dxf_attrib(name, share * text_m)
        # for programs that draw all dimensions alike, as the header says (LibreCAD 2.2)
        document.header[f"${name.upper()}"] = share * text_m
    document.header["$DIMSCALE"] = 1.0
    style.dxf.dimclrd = style.dxf.dimclre = style.dxf.dimclrt = const.BYLAYER


def _draw(sheet: Sheet, layer: Layer) -> None:
    name = LAYERS[layer.name][0]
    if layer.name.startswith("ellipses"):
        _ellipses(sheet, layer, name)
    elif layer.name == "points":
        draw_points(sheet, layer)
    elif layer.name == "footprints":
        _footprints(sheet, layer, name)
    elif layer.kind == "point":
        for vertices in placed(layer.vertices_m, sheet.place):
            sheet.space.add_point(vertices[0], dxfattribs={"layer": name})
    else:
        strips = placed(layer.vertices_m, sheet.place)
        for vertices in strips:
            if len(vertices):
                sheet.space.add_polyline3d(
                    vertices, close=layer.kind == "polygon", dxfattribs={"layer": name}
                )
        _values(sheet, layer, strips)


def _footprints(sheet: Sheet, layer: Layer, name: str) -> None:
    """Level outlines at their middle height: background, which may be large."""
    for ring in placed(layer.vertices_m, sheet.place):
        sheet.space.add_lwpolyline(
            ring[:, :2].tolist(),
            close=True,
            dxfattribs={"layer": name, "elevation": float(ring[:, 2].mean())},
        )


def _ellipses(sheet: Sheet, layer: Layer, name: str) -> None:
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


def _values(sheet: Sheet, layer: Layer, drawn: tuple[Floats, ...]) -> None:
    """Dimensions on two-point distances, as they are drawn, a text on all else with a value."""
    is_known = layer.name == "known_lengths"
    if not is_known and not layer.name.startswith("measured"):
        return
    value, sigma = ("length_m", "sigma_m") if is_known else ("value", "sigma")
    for row, strip in enumerate(layer.vertices_m):
        one = {key: values[row] for key, values in layer.attributes.items()}
        unit = str(one.get("unit", "m"))
        text = sheet.words.value(float(str(one[value])), float(str(one[sigma])), unit)
        if not is_known and layer.above_ground_m and layer.above_ground_m[row].any():
            text += "" if one["kind"] in _NOT_IN_SPACE or unit != "m" else _IN_SPACE
        text = f"{one['name']}: {text}{_DOUBT if one.get('alternatives') else ''}"
        if len(strip) == 2 and unit == "m" and one.get("kind") not in _UPRIGHT:
            on = LAYERS[layer.name][0] if is_known else _DIMENSIONS
            _dimension(sheet, drawn[row], on, text)
        elif len(strip):
            middle = sheet.place(strip.mean(axis=0, keepdims=True))[0]
            _text(sheet, middle, text, _DIMENSIONS)


def _dimension(sheet: Sheet, ends: Floats, layer: str, text: str) -> None:
    """Seen from above, at the height of the middle; where others are in the way, farther out."""
    start, end = sorted(ends[:, :2], key=tuple)  # from left to right, as texts are read
    if np.linalg.norm(end - start) < 1e-6:
        return
    half = half_size(text, sheet.text_m)
    aside = _moved_aside(half, float(np.linalg.norm(end - start)), sheet.text_m)
    room = half + np.array([aside / 2, 0.0])
    shift = aside / 2 * (end - start) / np.linalg.norm(end - start)
    place = sheet.places.take_near(_along(start + shift, end + shift, room, sheet.text_m))
    place[:2] -= shift
    distance = _across(start, end) @ (place[:2] - start) - half[1]
    drawn = sheet.space.add_aligned_dim(
        p1=tuple(start),
        p2=tuple(end),
        distance=float(distance),
        text=text,
        dimstyle="UAVGRAM",
        dxfattribs={"layer": layer},
    )
    drawn.set_location(tuple(place[:2]))
    dimension = drawn.render().dimension
    dimension.translate(0.0, 0.0, float(ends[:, 2].mean()))
    for part in dimension.get_geometry_block() or ():
        if part.dxf.layer == "0":  # not every program colours that as the dimension
            part.dxf.layer = layer


def _moved_aside(half: Floats, length: float, text_m: float) -> float:
    """How far LibreCAD moves a text along its line where it is longer than that, wherever it was.

    `RS_Dimension::updateCreateDimensionLine` of LibreCAD 2.2: by half of both and the gap.
    """
    return float(half[0] + length / 2 + _GAP * text_m) if 2 * half[0] > length else 0.0


def _across(start: Floats, end: Floats) -> Floats:
    """Unit vector to the left of the way from start to end."""
    along = (end - start) / np.linalg.norm(end - start)
    return np.array([-along[1], along[0]])


def _along(start: Floats, end: Floats, half: Floats, text_m: float) -> Callable[[Ints], Floats]:
    """(c, 5) places for the text above dimension lines, or crowded out beyond their ends.

    Of each round one line, farther out every second time, on either side of what is measured.
    """
    across, way = _across(start, end), end - start
    beyond = 1.5 * half[0] / np.linalg.norm(way)
    share = np.array([*_SHARES, 1.0 + beyond, -beyond])
    middle = start + share[:, None] * way
    size = [*half, np.arctan2(way[1], way[0])]

    def places(rounds: Ints) -> Floats:
        outwards = np.where(rounds % 2 == 0, 1.0, -1.0) * (2.5 + 1.5 * (rounds // 2)) * text_m
        moved = middle + (outwards + half[1])[:, None, None] * across
        there = (rounds >= _CROWDED)[:, None] | (np.arange(len(share)) < len(_SHARES))
        found = np.empty((np.count_nonzero(there), 5))
        found[:, :2] = moved[there]
        found[:, 2:] = size
        return found

    return places


def _text(sheet: Sheet, at: Floats, text: str, layer: str) -> None:
    half = half_size(text, sheet.text_m)
    own = np.array([[at[0], at[1], *half, 0.0]])

    def places(rounds: Ints) -> Floats:
        outside = around(at[:2], half, 0.0, rounds[rounds > 0] - 1)
        return np.concatenate([own, outside]) if rounds[0] == 0 else outside

    place = sheet.places.take_near(places)
    sheet.space.add_text(text, height=sheet.text_m, dxfattribs={"layer": layer}).set_placement(
        (*place[:2].tolist(), float(at[2])), align=TextEntityAlignment.MIDDLE_CENTER
    )


def _keep_free_below(sheet: Sheet, corner: tuple[float, float]) -> None:
    """Where the notes and the profiles stand, nothing else is written."""
    large = _FAR * sheet.text_m
    top = corner[1] + 1.5 * sheet.text_m
    sheet.places.reserve(np.array([corner[0], top - large, large, large, 0.0]))


def _below(sheet: Sheet, features: Features) -> tuple[float, float]:
    """Where the notes begin: below all points, to the left."""
    vertices = features.layer("points").vertices_m
    low = np.concatenate(vertices).min(axis=0, keepdims=True) if vertices else np.zeros((1, 3))
    east, north, _ = sheet.place(low)[0].tolist()
    return east, north - 6.0 * sheet.text_m


def _note(sheet: Sheet, features: Features, note: str) -> None:
    if not len(features.layer("points")):
        return
    if any(layer.name == "verticals" for layer in features.layers):
        note += "; red: points off the ground, and their heights over it"
    layers = (features.layer(name) for name in ("measured_areas", "measured_lines"))
    if any(any(layer.attributes["alternatives"]) for layer in layers):
        note += f";{_DOUBT} = other solutions fit as well and give other values, see the report"
    sheet.space.add_text(
        f"{features.name}: {note}", height=sheet.text_m, dxfattribs={"layer": _NOTES}
    ).set_placement(_below(sheet, features))
