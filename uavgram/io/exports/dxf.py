"""Writer of the survey as a CAD drawing (DXF R2010, metres): points, lines, dimensions, ellipses.

All entities are at their heights; programs show plans from above. Measured profiles have sheets of
their own.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from ezdxf import const, units
from ezdxf.document import Drawing
from ezdxf.filemanagement import new

from uavgram.geometry.geodesy import map_scale, projected_from_enu
from uavgram.io.exports.dxf_layers import (
    ALIGNED,
    NumberFormat,
    Place,
    Sheet,
    Text,
    cad_layer,
    compute_half_size,
    draw_profiles,
    escape_mtext,
    escape_text,
    place_beside_point,
)
from uavgram.model.arrays import Floats
from uavgram.model.maps import Features, Layer, LayerStyle, Looks, look_of, transform_vertices
from uavgram.stages.products.text_places import Label, Placed, place_labels

POINT_BLOCK = "SURVEY_POINT"
_HEIGHT_SHARE = 0.6  # letter height of heights, relative to that of labels
_NUMBERS = ("sigma_east_m", "sigma_north_m")
"""Attributes of each point, in addition to its label."""
_OFF_GROUND_NUMBERS = ("sigma_up_m", "height_above_ground_m", "height_sigma_m")
"""Additional attributes of points off the ground; on all points they would take half as long again.

Points that were picked by the program, alone or with a person, also carry PICKED_BY.
"""


def add_point_block(document: Drawing, text_m: float) -> None:
    """Add the block of a cross; its attributes are hidden, as some programs cannot draw them."""
    block = document.blocks.new(POINT_BLOCK)
    half = 0.4 * text_m
    block.add_line((-half, 0), (half, 0))
    block.add_line((0, -half), (0, half))
    for row, tag in enumerate(("LABEL", *(key.upper() for key in _NUMBERS))):
        attribute = block.add_attdef(
            tag,
            (half, half - 1.3 * row * text_m),
            dxfattribs={"height": text_m, "layer": LABELS.upper(), "flags": const.ATTRIB_INVISIBLE},
        )
        attribute.dxf.prompt = tag


def draw_points(sheet: Sheet, layer: Layer) -> None:
    """Draw points as crosses with labels as attributes; those off the ground on another layer."""
    if not len(layer):
        return
    places = sheet.place(np.concatenate(layer.vertices_m))
    for one, place in zip(_rows(layer), places.tolist(), strict=True):
        off = _is_off(one)
        own = sheet.on("off_ground" if off else "points")
        insert = sheet.space.add_blockref(POINT_BLOCK, tuple(place), dxfattribs=own)
        numbers = {key.upper(): _decimals(one[key]) for key in _NUMBERS}
        insert.add_auto_attribs({"LABEL": escape_text(str(one["label"])), **numbers})
        hidden = {key.upper(): _decimals(one[key]) for key in _OFF_GROUND_NUMBERS if off}
        if one["picked_by"] not in ("", "hand"):
            hidden["PICKED_BY"] = str(one["picked_by"])
        for tag, value in hidden.items():
            insert.add_attrib(tag, value, tuple(place), sheet.on(LABELS)).is_invisible = True


def list_point_texts(layer: Layer, text_m: float, words: NumberFormat) -> list[Text]:
    """Return the labels of points, then the heights of those off the ground.

    Parameters
    ----------
    layer
        The points.
    text_m
        Full height of letters.
    words
        Format of heights.
    """
    points = [(one, place[0]) for one, place in zip(_rows(layer), layer.vertices_m, strict=True)]
    labels = [place_beside_point(str(one["label"]), place, LABELS, text_m) for one, place in points]
    return labels + [
        place_beside_point(_height_text(one, words), place, "verticals", text_m, _HEIGHT_SHARE)
        for one, place in points
        if _is_off(one)
    ]


def _rows(layer: Layer) -> list[dict[str, str | float]]:
    """Return the attributes of each shape."""
    columns = layer.attributes
    return [dict(zip(columns, row, strict=True)) for row in zip(*columns.values(), strict=True)]


def _is_off(one: dict[str, str | float]) -> bool:
    """Return whether a point is off the ground."""
    return one["height_source"] in {"stated", "free", "found"}


def _decimals(value: object) -> str:
    """Format a number to tenths of a millimetre; empty without a value."""
    number = float(str(value))
    return f"{number:.4f}" if np.isfinite(number) else ""


def _height_text(one: dict[str, str | float], words: NumberFormat) -> str:
    """Format the height of a point above the ground, with its sigma."""
    height = float(one["height_above_ground_m"]) / words.length_m
    sigma = float(one["height_sigma_m"]) / words.length_m
    unit = "" if words.symbol == "m" else f" {words.symbol}"
    return f"{height:+.3f} " + (f"±{sigma:.3f}{unit}" if sigma > 0 else f"{unit} stated".strip())


METRIC_FORMAT = NumberFormat()
"""Numbers in metres, the unit of the drawing."""

LABELS, _DIMENSIONS, _NOTES = "labels", "dimensions", "notes"
_OWN = {
    LABELS: LayerStyle(title="labels", colour="", cad_colour=7),
    _DIMENSIONS: LayerStyle(title="dimensions", colour="", cad_colour=134),
    _NOTES: LayerStyle(title="notes", colour="", cad_colour=8),
}
"""Layers of texts only."""
_UPRIGHT = {"height", "vertical_distance"}
"""Kinds of measurement that have no length in a plan."""
_NOT_IN_SPACE = {*_UPRIGHT, "horizontal_distance", "profile"}
_IN_SPACE = " (3-D)"
"""Suffix of a length to or from a point off the ground, which is shorter in plan."""
_DOUBT_MARK = " ?"
"""Suffix of a value that differs in another solution with an equal fit."""

_SHORT_M = 1e-6  # a shorter length in plan has no direction
_STYLE = "UAVGRAM"
_GAP = 0.3  # around the text of a dimension, in letter heights
_TICK = 0.5  # half a stroke at an end of a dimension line, along and across it, in letter heights
_ALIGNED_DIMENSION = (
    const.DIM_ALIGNED | const.DIM_BLOCK_EXCLUSIVE | const.DIM_USER_LOCATION_OVERRIDE
)
_DASHED = "UAVGRAM_TO_TEXT"
_DASH = 0.4  # in letter heights
_FAR = 1e6  # in letter heights, beyond the extent of any drawing
_PAPER_M = (0.420, 0.297)  # A3
_TEXT_SHARE = 1 / 80  # letter height relative to the drawing's extent
_CROWDED_SHARE = (
    0.2  # or, with many points, so that three quarters of an evenly filled sheet stay empty
)


@dataclass(frozen=True)
class PlacedTexts:
    """Texts of a survey, placed in local metres for all of its drawings.

    Attributes
    ----------
    texts, places
        The texts, and their positions from `place_labels`.
    text_m
        Height of letters.
    corner
        East and north below which notes and profiles are.
    """

    texts: tuple[Text, ...]
    places: Placed
    text_m: float
    corner: Floats


def place_texts(features: Features, words: NumberFormat = METRIC_FORMAT) -> PlacedTexts:
    """Place the texts of drawings: none covers another, none is far from its object.

    Parameters
    ----------
    features
        Survey to draw.
    words
        Format of texts and dimensions.
    """
    text_m = _text_height(features)
    texts = list_point_texts(features.layer("points"), text_m, words)
    for layer in features.layers:
        texts += _values(layer, text_m, words)
    vertices = features.layer("points").vertices_m
    low = np.concatenate(vertices).min(axis=0)[:2] if vertices else np.zeros(2)
    corner = low - [0.0, 6.0 * text_m]
    large = _FAR * text_m
    below = np.array([[corner[0], corner[1] + 1.5 * text_m - large, large, large, 0.0]])
    labels = [text.label for text in texts]
    placed = place_labels(labels, below)
    # labels without room among hundreds at one place stay there, on top of each other
    own = [[*(one.start + one.end) / 2, *placed.size * one.half, 0.0] for one in labels]
    boxes = np.where(np.isfinite(placed.boxes), placed.boxes, np.reshape(own, placed.boxes.shape))
    return PlacedTexts(tuple(texts), placed._replace(boxes=boxes), text_m * placed.size, corner)


def write_dxf(
    features: Features,
    path: Path,
    looks: Looks,
    words: NumberFormat = METRIC_FORMAT,
    texts: PlacedTexts | None = None,
    *,
    on_map: bool = False,
) -> None:
    """Write the drawing in local metres, or in the survey's projected coordinate system.

    Distances in local metres are those on the ground. On the map they differ from these by the
    scale factor of the projection, which a note in the drawing states; the texts of dimensions are
    ground values in both.

    Parameters
    ----------
    features
        Survey to draw; for the map it needs a projected coordinate system.
    path
        The file.
    looks
        Styles by layer name.
    words
        Format of texts and dimensions.
    texts
        Placed texts, if already known.
    on_map
        Whether coordinates are those of the map.
    """
    place, note = _map_place(features) if on_map else _local_place(features)
    texts = texts or place_texts(features, words)
    document = new("R2010", units=units.M)
    looks = {**looks, **_OWN}
    for name in (*(layer.name for layer in features.layers), "off_ground", *_OWN):
        look = look_of(looks, name)
        own = document.layers.add(cad_layer(looks, name), color=look.cad_colour)
        if not look.shown:
            own.freeze()  # some programs do not know "off"
    sheet = Sheet(document, document.modelspace(), place, texts.text_m, looks)
    add_point_block(document, texts.text_m)
    _dimension_style(document, texts.text_m)
    for layer in features.layers:
        _draw(sheet, layer)
    _write_texts(sheet, texts)
    east, north, _ = place(np.array([[*texts.corner, 0.0]]))[0].tolist()
    draw_profiles(document, features.profiles, (east, north), texts.text_m, words)
    _note(sheet, features, note, (east, north))
    _look_at_points(sheet, features)
    document.saveas(path)


def _local_place(features: Features) -> tuple[Place, str]:
    """Return the identity, and the note on local metres."""
    if features.origin is None:
        note = "local metres; position and direction of north are arbitrary, distances are true"
    else:
        note = "local metres: x east, y north, z up; distances are true ground distances"
    return (lambda enu: enu), note


def _map_place(features: Features) -> tuple[Place, str]:
    """Return the projection to the map, and the note on its scale."""
    if features.origin is None or features.crs is None:
        raise ValueError("a drawing on the map needs a georeferenced survey")
    origin, crs = features.origin, features.crs
    scale = map_scale(origin, crs)
    note = f"map distance = ground distance x {scale:.6f}; texts of dimensions are ground values"
    return (lambda enu: projected_from_enu(enu, origin, crs)), f"{crs}; {note}"


def _look_at_points(sheet: Sheet, features: Features) -> None:
    """Set the initial view: all points, with their dimensions."""
    vertices = features.layer("points").vertices_m
    if not vertices:
        return
    shown = sheet.place(np.concatenate(vertices))[:, :2]
    low, high = shown.min(axis=0), shown.max(axis=0)
    height = max(1.3 * float((high - low).max()), 20 * sheet.text_m)
    sheet.document.set_modelspace_vport(height, tuple(((low + high) / 2).tolist()))
    # ezdxf writes the header from these; LibreCAD uses the limits for its paper, in our metres
    sheet.space.dxf.extmin, sheet.space.dxf.extmax = (*low.tolist(), 0.0), (*high.tolist(), 0.0)
    sheet.document.layout("Layout1").dxf.limmax = _PAPER_M


def _text_height(features: Features) -> float:
    vertices = features.layer("points").vertices_m
    if len(vertices) < 2:
        return 0.25
    corners = np.concatenate(vertices)[:, :2]
    share = min(_TEXT_SHARE, _CROWDED_SHARE / float(np.sqrt(len(corners))))
    return max(float(np.ptp(corners, axis=0).max()) * share, 0.01)


def _dimension_style(document: Drawing, text_m: float) -> None:
    style = document.dimstyles.duplicate_entry("Standard", _STYLE)
    dash = _DASH * text_m
    document.linetypes.add(_DASHED, [2.0 * dash, dash, -dash], description="to a text")
    sizes = {"dimtxt": 1.0, "dimasz": 0.0, "dimexe": 0.0, "dimexo": 0.0, "dimgap": _GAP}
    sizes["dimtsz"] = _TICK
    for name, share in sizes.items():
        style.set_dxf_attrib(name, share * text_m)
        # for programs that draw all dimensions with the header's style (LibreCAD 2.2)
        document.header[f"${name.upper()}"] = share * text_m
    document.header["$DIMSCALE"] = 1.0
    style.dxf.dimclrd = style.dxf.dimclre = style.dxf.dimclrt = const.BYLAYER


def _draw(sheet: Sheet, layer: Layer) -> None:
    on, strips = sheet.on(layer.name), transform_vertices(layer.vertices_m, sheet.place)
    if layer.name.startswith("ellipses"):
        _ellipses(sheet, layer)
    elif layer.name == "points":
        draw_points(sheet, layer)
    elif layer.name == "footprints":
        _footprints(sheet, strips)
    elif layer.kind == "point":
        for vertices in strips:
            sheet.space.add_point(vertices[0], dxfattribs=on)
    else:
        for vertices in strips:
            if len(vertices) == 2:  # a polyline would have four parts, each with its own handle
                sheet.space.add_line(vertices[0], vertices[1], dxfattribs=on)
            elif len(vertices):
                sheet.space.add_polyline3d(vertices, close=layer.kind == "polygon", dxfattribs=on)


def _footprints(sheet: Sheet, rings: tuple[Floats, ...]) -> None:
    """Draw footprints as level outlines at their mean height, as they may be large."""
    for ring in rings:
        sheet.space.add_lwpolyline(
            ring[:, :2].tolist(),
            close=True,
            dxfattribs={**sheet.on("footprints"), "elevation": float(ring[:, 2].mean())},
        )


def _ellipses(sheet: Sheet, layer: Layer) -> None:
    """Draw true ellipses; their axes rotate and scale with the map projection."""
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
            dxfattribs=sheet.on(layer.name),
        )


def _values(layer: Layer, text_m: float, words: NumberFormat) -> list[Text]:
    """Return dimension texts for two-point distances, and plain texts for all other values."""
    is_known, texts = layer.name == "known_lengths", []
    if not is_known and not layer.name.startswith("measured"):
        return []
    values = layer.value_texts(words.value)
    for row, (strip, one) in enumerate(zip(layer.vertices_m, _rows(layer), strict=True)):
        unit, text = str(one.get("unit", "m")), values[row]
        if not is_known and layer.above_ground_m and layer.above_ground_m[row].any():
            text += "" if one["kind"] in _NOT_IN_SPACE or unit != "m" else _IN_SPACE
        text += " (known)" if is_known else ""  # the drawn line has the adjusted length
        text += _DOUBT_MARK if one.get("alternatives") else ""
        is_length = len(strip) == 2 and unit == "m" and one.get("kind") not in _UPRIGHT
        if is_length and np.linalg.norm(strip[1, :2] - strip[0, :2]) > _SHORT_M:
            # from left to right, the reading direction
            ends = strip[np.lexsort(strip[:, 1::-1].T)]
            half = compute_half_size(text, text_m)
            label = Label(ends[0, :2], ends[1, :2], half, 0.0, "along")
            on = layer.name if is_known else _DIMENSIONS
            texts.append(Text(text, label, on, ends))
        elif len(strip) and not is_length:
            texts.append(place_beside_point(text, strip.mean(axis=0), _DIMENSIONS, text_m))
    return texts


def _write_texts(sheet: Sheet, texts: PlacedTexts) -> None:
    """Write dimensions, and texts with a leader line where they are not next to their object."""
    up = np.array([text.ends[:, 2].mean() for text in texts.texts])
    boxes, leaders, sides, _ = texts.places
    turn = boxes[:, 4:]
    # letters begin or end at the leader; a dimension has its own lines
    is_dimension = np.array([len(text.ends) > 1 for text in texts.texts], np.bool_)
    sides = np.where(is_dimension, 0, sides)
    aside = (sides * boxes[:, 2])[:, None] * np.column_stack([np.cos(turn), np.sin(turn)])
    middle = np.column_stack([boxes[:, :2] + aside, up])
    along = np.column_stack([np.cos(turn), np.sin(turn), 0.0 * turn])
    drawn = sheet.place(np.concatenate([middle, middle + along]))
    middle, way = drawn[: len(up)], np.diff(drawn.reshape(2, -1, 3), axis=0)[0]
    for k in np.flatnonzero(~is_dimension).tolist():
        text, (east, north, _) = texts.texts[k], way[k]
        degrees = (math.degrees(math.atan2(north, east)) + 90.0) % 180.0 - 90.0  # never upside down
        written = sheet.space.add_text(
            escape_text(text.words),
            height=text.share * sheet.text_m,
            rotation=degrees,
            dxfattribs=sheet.on(text.layer),
        )
        written.set_placement(tuple(middle[k]), align=ALIGNED[int(sides[k])])
        if np.isfinite(leaders[k, 0, 0]):
            ends = sheet.place(np.column_stack([leaders[k], np.full(2, text.ends[0, 2])]))
            start, end = ends.tolist()
            sheet.space.add_line(start, end, dxfattribs=sheet.on(text.layer))
    rows = np.flatnonzero(is_dimension)
    if len(rows):
        _draw_dimensions(sheet, [texts.texts[k] for k in rows], middle[rows], boxes[rows, 2:4])


def _draw_dimensions(sheet: Sheet, texts: list[Text], middle: Floats, half: Floats) -> None:
    """Draw dimensions in plan at mean height; their lines lead to texts that are farther out.

    Each has one polyline: from one point to the dimension line, along it, and to the other point.
    Strokes across the line show where the length begins and ends; a dashed line goes on to a text
    that is beyond.

    Parameters
    ----------
    sheet
        The drawing.
    texts
        Texts of the dimensions.
    middle
        (n, 3) middles of the texts, in the drawing's coordinates.
    half
        (n, 2) half the width and height of each text.
    """
    ends = sheet.place(np.concatenate([text.ends for text in texts])).reshape(-1, 2, 3)
    up, start, way = (
        ends[:, :, 2].mean(axis=1),
        ends[:, 0, :2],
        np.diff(ends[..., :2], axis=1)[:, 0],
    )
    length = np.linalg.norm(way, axis=1)
    along = way / length[:, None]
    across = np.column_stack([-along[:, 1], along[:, 0]])
    at = ((middle[:, :2] - start)[:, None] @ np.stack([along, across], axis=2))[:, 0]
    # The dimension line passes between the text and its object, or below a text beyond its ends.
    out = at[:, 1] - np.sign(at[:, 1]) * half[:, 1]
    low, high = at[:, 0] - half[:, 0], at[:, 0] + half[:, 0]
    is_beyond, zero = (low > length) | (high < 0.0), np.zeros(len(texts))
    from_, far = np.where(low > length, [length, high], [zero, low])
    u, v = [zero, zero, length, length, from_, far], [zero, out, out, zero, out, out]
    places = start + np.stack(u)[..., None] * along + np.stack(v)[..., None] * across
    path, beyond = np.split(places.swapaxes(0, 1), [4], axis=1)
    stroke = _TICK * sheet.text_m * (along + across)
    corners = [path[:, 1], path[:, 2]]
    ticks = np.stack([np.stack([one - stroke, one + stroke], axis=1) for one in corners], axis=1)
    degrees = np.degrees(np.arctan2(way[:, 1], way[:, 0]))
    for k, text in enumerate(texts):
        on = sheet.on(text.layer)
        place, words = (*middle[k, :2].tolist(), up[k]), escape_mtext(text.words)
        block = sheet.document.blocks.new_anonymous_block(type_char="D")
        block.add_lwpolyline(path[k].tolist(), dxfattribs={**on, "elevation": up[k]})
        for first, last in ticks[k]:
            block.add_line((*first, up[k]), (*last, up[k]), dxfattribs=on)
        if is_beyond[k]:
            first, last = beyond[k]
            dashed = {**on, "linetype": _DASHED}
            block.add_line((*first, up[k]), (*last, up[k]), dxfattribs=dashed)
        letters = {"char_height": sheet.text_m, "rotation": degrees[k], "insert": place}
        middle_center = const.MTEXT_MIDDLE_CENTER
        block.add_mtext(words, {**on, **letters, "attachment_point": middle_center})
        sheet.space.new_entity(
            "DIMENSION",
            {
                **on,
                "dimtype": _ALIGNED_DIMENSION,
                "dimstyle": _STYLE,
                "geometry": block.name,
                "text": words,
                "text_midpoint": place,
                "attachment_point": middle_center,
                "actual_measurement": length[k],
                "defpoint": (*path[k, -2].tolist(), up[k]),
                "defpoint2": (*start[k].tolist(), up[k]),
                "defpoint3": (*path[k, -1].tolist(), up[k]),
            },
        )


def _note(sheet: Sheet, features: Features, note: str, corner: tuple[float, float]) -> None:
    if not len(features.layer("points")):
        return
    if any(layer.name == "verticals" for layer in features.layers):
        note += "; red: points off the ground, and their heights over it"
    layers = (features.layer(name) for name in ("measured_areas", "measured_lines"))
    if any(any(layer.attributes["alternatives"]) for layer in layers):
        note += (
            f";{_DOUBT_MARK} = other solutions fit as well and give other values, see the report"
        )
    sheet.space.add_text(
        escape_text(f"{features.name}: {note}"), height=sheet.text_m, dxfattribs=sheet.on(_NOTES)
    ).set_placement(corner)
