"""Points in a CAD drawing: a cross, a label, and over the ground their height."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from ezdxf import const
from ezdxf.document import Drawing

from uavgram.io.exports.dxf_entities import LABELS
from uavgram.io.exports.dxf_sheet import LAYERS, Sheet, Words
from uavgram.model.arrays import Floats
from uavgram.model.maps.layers import Layer

POINT_BLOCK = "SURVEY_POINT"
_HEIGHT_SHARE = 0.6  # of the labels' letters are those of heights
_NUMBERS = ("sigma_east_m", "sigma_north_m")
"""What each point carries, beside its label."""
_TAGS = ("LABEL", *(key.upper() for key in _NUMBERS))
_OFF_GROUND_NUMBERS = ("sigma_up_m", "height_above_ground_m", "height_sigma_m")
"""What points off the ground carry too; on all points it would take half as long again to write.
So do points that no person, or not a person alone, picked: PICKED_BY."""


def add_point_block(document: Drawing, text_m: float) -> None:
    """A cross; label and standard deviations are hidden attributes, for some programs draw none."""
    block = document.blocks.new(POINT_BLOCK)
    half = 0.4 * text_m
    block.add_line((-half, 0), (half, 0))
    block.add_line((0, -half), (0, half))
    for tag, place in zip(_TAGS, _attribute_places((0.0, 0.0, 0.0), text_m), strict=True):
        attribute = block.add_attdef(
            tag,
            place[:2],
            dxfattribs={"height": text_m, "layer": LABELS, "flags": const.ATTRIB_INVISIBLE},
        )
        attribute.dxf.prompt = tag


def draw_points(sheet: Sheet, layer: Layer) -> None:
    """Points with their labels; those off the ground on their own layer, with their heights."""
    if not len(layer):
        return
    placed = sheet.place(np.concatenate(layer.vertices_m)).tolist()
    for row, place in enumerate(placed):
        one = {key: values[row] for key, values in layer.attributes.items()}
        off = one["height_source"] in {"stated", "free", "found"}
        label = str(one["label"])
        beside = sheet.beside(label, np.array(place[:2]), sheet.text_m, 0.1 * sheet.text_m)
        at = (*beside.tolist(), place[2])
        numbers = (label, *(_decimals(one[key]) for key in _NUMBERS))
        own = list(zip(_TAGS, numbers, _attribute_places(place, sheet.text_m), strict=True))
        if one["picked_by"] not in ("", "hand"):
            own.append(("PICKED_BY", str(one["picked_by"]), place))
        if off:
            own += [(key.upper(), _decimals(one[key]), at) for key in _OFF_GROUND_NUMBERS]
        layer_name = LAYERS["off_ground" if off else "points"][0]
        sheet.drawn.named_block(layer_name, POINT_BLOCK, place, sheet.text_m, own)
        sheet.drawn.text(LABELS, at, sheet.text_m, label)
        if off:
            _height(sheet, one, np.array(place))


def _attribute_places(place: Sequence[float], text_m: float) -> list[tuple[float, ...]]:
    """Where the attributes of all points stand, one below the other."""
    east, north, up = place
    beside = 0.4 * text_m
    return [(east + beside, north + beside - 1.3 * row * text_m, up) for row in range(len(_TAGS))]


def _height(sheet: Sheet, one: dict[str, str | float], place: Floats) -> None:
    """Write the height of a point beside it."""
    words, small = _height_text(one, sheet.words), _HEIGHT_SHARE * sheet.text_m
    at = (*sheet.beside(words, place[:2], small, 0.1 * sheet.text_m).tolist(), float(place[2]))
    sheet.drawn.text(LAYERS["verticals"][0], at, small, words)


def _decimals(value: object) -> str:
    """A number to tenths of a millimetre; empty where there is none."""
    number = float(str(value))
    return f"{number:.4f}" if np.isfinite(number) else ""


def _height_text(one: dict[str, str | float], words: Words) -> str:
    """How high a point stands over the ground, and how well that is known."""
    height = float(one["height_above_ground_m"]) / words.length_m
    sigma = float(one["height_sigma_m"]) / words.length_m
    unit = "" if words.symbol == "m" else f" {words.symbol}"
    return f"{height:+.3f} " + (f"±{sigma:.3f}{unit}" if sigma > 0 else f"{unit} stated".strip())
