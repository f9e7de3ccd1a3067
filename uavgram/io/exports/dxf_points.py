"""Points in a CAD drawing: a cross, a label, and over the ground their height."""

from __future__ import annotations

import numpy as np
from ezdxf import const
from ezdxf.document import Drawing
from ezdxf.enums import TextEntityAlignment

from uavgram.io.exports.dxf_sheet import LABELS, LAYERS, Sheet, Words
from uavgram.model.arrays import Floats
from uavgram.model.maps.layers import Layer

POINT_BLOCK = "SURVEY_POINT"
_HEIGHT_SHARE = 0.6  # of the labels' letters are those of heights
_NUMBERS = ("sigma_east_m", "sigma_north_m")
"""What each point carries, beside its label."""
_OFF_GROUND_NUMBERS = ("sigma_up_m", "height_above_ground_m", "height_sigma_m")
"""What points off the ground carry too; on all points it would take half as long again to write.
So do points that no person, or not a person alone, picked: PICKED_BY."""


def add_point_block(document: Drawing, text_m: float) -> None:
    """A cross; label and standard deviations are hidden attributes, for some programs draw none."""
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
    """Points with their labels; those off the ground on their own layer, with their heights."""
    if not len(layer):
        return
    placed = sheet.place(np.concatenate(layer.vertices_m)).tolist()
    for row, place in enumerate(placed):
        one = {key: values[row] for key, values in layer.attributes.items()}
        off = one["height_source"] in {"stated", "free", "found"}
        own = LAYERS["off_ground"][0] if off else LAYERS["points"][0]
        insert = sheet.space.add_blockref(POINT_BLOCK, tuple(place), dxfattribs={"layer": own})
        numbers = {key.upper(): _decimals(one[key]) for key in _NUMBERS}
        insert.add_auto_attribs({"LABEL": str(one["label"]), **numbers})
        if one["picked_by"] not in ("", "hand"):
            made = insert.add_attrib("PICKED_BY", str(one["picked_by"]), place, {"layer": LABELS})
            made.is_invisible = True
        at = _named(sheet, one, np.array(place))
        if off:
            for key in _OFF_GROUND_NUMBERS:
                insert.add_attrib(
                    key.upper(), _decimals(one[key]), at, {"layer": LABELS}
                ).is_invisible = True
            _height(sheet, one, np.array(place))


def _named(sheet: Sheet, one: dict[str, str | float], place: Floats) -> tuple[float, float, float]:
    """Write the label of a point beside it; the text's middle."""
    label = str(one["label"])
    at = (*sheet.beside(label, place[:2], sheet.text_m, 0.1 * sheet.text_m), place[2])
    text = sheet.space.add_text(label, height=sheet.text_m, dxfattribs={"layer": LABELS})
    text.set_placement(at, align=TextEntityAlignment.MIDDLE_CENTER)
    return at


def _height(sheet: Sheet, one: dict[str, str | float], place: Floats) -> None:
    """Write the height of a point beside it."""
    words, small = _height_text(one, sheet.words), _HEIGHT_SHARE * sheet.text_m
    at = (*sheet.beside(words, place[:2], small, 0.1 * sheet.text_m), place[2])
    text = sheet.space.add_text(words, height=small, dxfattribs={"layer": LAYERS["verticals"][0]})
    text.set_placement(at, align=TextEntityAlignment.MIDDLE_CENTER)


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
