"""Points in a CAD drawing: a cross, a label, and a height if off the ground."""

from __future__ import annotations

import numpy as np
from ezdxf import const
from ezdxf.document import Drawing

from uavgram.io.exports.dxf_sheet import (
    LABELS,
    LAYERS,
    Sheet,
    Text,
    Words,
    as_text,
    text_beside,
)
from uavgram.model.maps import Layer

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
            dxfattribs={"height": text_m, "layer": LABELS, "flags": const.ATTRIB_INVISIBLE},
        )
        attribute.dxf.prompt = tag


def draw_points(sheet: Sheet, layer: Layer) -> None:
    """Draw points as crosses with labels as attributes; those off the ground on another layer."""
    if not len(layer):
        return
    places = sheet.place(np.concatenate(layer.vertices_m))
    for one, place in zip(_rows(layer), places.tolist(), strict=True):
        off = _is_off(one)
        own = LAYERS["off_ground"][0] if off else LAYERS["points"][0]
        insert = sheet.space.add_blockref(POINT_BLOCK, tuple(place), dxfattribs={"layer": own})
        numbers = {key.upper(): _decimals(one[key]) for key in _NUMBERS}
        insert.add_auto_attribs({"LABEL": as_text(str(one["label"])), **numbers})
        hidden = {key.upper(): _decimals(one[key]) for key in _OFF_GROUND_NUMBERS if off}
        if one["picked_by"] not in ("", "hand"):
            hidden["PICKED_BY"] = str(one["picked_by"])
        for tag, value in hidden.items():
            insert.add_attrib(tag, value, tuple(place), {"layer": LABELS}).is_invisible = True


def texts_of_points(layer: Layer, text_m: float, words: Words) -> list[Text]:
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
    labels = [text_beside(str(one["label"]), place, LABELS, text_m) for one, place in points]
    return labels + [
        text_beside(_height_text(one, words), place, LAYERS["verticals"][0], text_m, _HEIGHT_SHARE)
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


def _height_text(one: dict[str, str | float], words: Words) -> str:
    """Format the height of a point above the ground, with its sigma."""
    height = float(one["height_above_ground_m"]) / words.length_m
    sigma = float(one["height_sigma_m"]) / words.length_m
    unit = "" if words.symbol == "m" else f" {words.symbol}"
    return f"{height:+.3f} " + (f"±{sigma:.3f}{unit}" if sigma > 0 else f"{unit} stated".strip())
