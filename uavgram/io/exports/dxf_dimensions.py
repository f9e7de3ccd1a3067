"""Dimensions in a CAD drawing, and the lines that show them.

Every dimension has a block of lines, arrows and text: what programs show that do not draw
dimensions themselves.
"""

from __future__ import annotations

import numpy as np
from ezdxf import const
from ezdxf.document import Drawing
from ezdxf.render.arrows import ARROWS

from uavgram.io.exports.dxf_entities import Drawn, Tag, at
from uavgram.io.exports.dxf_sheet import Sheet
from uavgram.model.arrays import Floats

GAP = 0.3
"""Around the text of a dimension, in heights of a letter."""
_ARROW, _OVER, _AWAY = 0.8, 0.3, 0.3
"""In heights of a letter: an arrow, how far lines go beyond it, and begin from what is measured."""
_STYLE, _LETTERS = "UAVGRAM", "OpenSansCondensed-Light"  # of dimensions, and of their texts
_TEXT_ALONE = [(1001, "ACAD"), (1000, "DSTYLE"), (1002, "{"), (1070, 279), (1070, 2), (1002, "}")]
"""Of this dimension: the text stands where it was put, the line does not go with it."""


def dimension_style(document: Drawing, text_m: float) -> None:
    """How dimensions look in a drawing with letters of this height."""
    style = document.dimstyles.duplicate_entry("Standard", _STYLE)
    sizes = {"dimtxt": 1.0, "dimasz": _ARROW, "dimexe": _OVER, "dimexo": _AWAY, "dimgap": GAP}
    for name, share in sizes.items():
        style.set_dxf_attrib(name, share * text_m)
        # for programs that draw all dimensions alike, as the header says (LibreCAD 2.2)
        document.header[f"${name.upper()}"] = share * text_m
    document.header["$DIMSCALE"] = 1.0
    style.dxf.dimclrd = style.dxf.dimclre = style.dxf.dimclrt = const.BYLAYER
    ARROWS.create_block(document.blocks, ARROWS.closed_filled)


def draw_dimension(
    sheet: Sheet, layer: str, ends: Floats, distance: float, middle: Floats, text: str
) -> None:
    """Draw an aligned dimension.

    Parameters
    ----------
    sheet
        Where to.
    layer
        Of all that belongs to it.
    ends
        (2, 3) of what is measured, from left to right, both at the height of the drawing.
    distance
        Of the dimension line, to the left of the way from end to end.
    middle
        (2,) of the text.
    text
        The text.
    """
    height = float(ends[0, 2])
    along = ends[1] - ends[0]
    length = float(np.linalg.norm(along))
    along = along / length
    across = np.array([-along[1], along[0], 0.0])
    line = ends + distance * across
    words = (*middle.tolist(), height)
    block = sheet.document.blocks.new_anonymous_block("D")
    parts = Drawn(sheet.document, block)
    _draw_lines(parts, layer, ends, line, sheet.text_m)
    parts.paragraph(layer, words, sheet.text_m, along.tolist(), text, _LETTERS)
    for place in (line[0], *ends):
        parts.point("Defpoints", place.tolist())
    turn = float(np.degrees(np.arctan2(along[1], along[0])))
    own: list[Tag] = [(100, "AcDbDimension"), (280, 0), (2, block.name), (3, _STYLE)]
    text_at: list[Tag] = [*at(10, line[0].tolist()), *at(11, words), (70, 160), (71, 5), (1, text)]
    measured = [
        tag for code, end in zip((13, 14), ends.tolist(), strict=True) for tag in at(code, end)
    ]
    kind: list[Tag] = [(100, "AcDbAlignedDimension"), *measured, (50, turn)]
    last: list[Tag] = [(100, "AcDbRotatedDimension"), *_TEXT_ALONE]
    sheet.drawn.add("DIMENSION", layer, [*own, *text_at, *kind, *last])


def _draw_lines(parts: Drawn, layer: str, ends: Floats, line: Floats, text_m: float) -> None:
    """The line with its arrows, which stand outside where it is short, and those to the ends."""
    along = (line[1] - line[0]) / np.linalg.norm(line[1] - line[0])
    away = (line - ends) / np.linalg.norm(line - ends, axis=1, keepdims=True)
    for end, top in zip(
        (ends + _AWAY * text_m * away).tolist(),
        (line + _OVER * text_m * away).tolist(),
        strict=True,
    ):
        parts.line(layer, end, top)
    arrow = _ARROW * text_m
    outside = 2 * arrow + GAP * text_m > np.linalg.norm(line[1] - line[0])
    turn = float(np.degrees(np.arctan2(along[1], along[0])))
    name = ARROWS.block_name(ARROWS.closed_filled)
    for end, way in zip(line, (-along, along), strict=True):
        points_back = outside == (way is along)
        parts.block(layer, name, end.tolist(), arrow, turn + 180.0 if points_back else turn)
    if outside:
        for end, way in zip(line, (-along, along), strict=True):
            parts.line(layer, (end + arrow * way).tolist(), (end + 2 * arrow * way).tolist())
    inside = 0.0 if outside else arrow
    parts.line(layer, (line[0] + inside * along).tolist(), (line[1] - inside * along).tolist())
