"""Dimensions as we write them, against those that ezdxf draws."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from ezdxf import units
from ezdxf.entities import DXFEntity
from ezdxf.filemanagement import new, readfile

from uavgram.io.exports.dxf_dimensions import dimension_style, draw_dimension
from uavgram.io.exports.dxf_entities import Drawn
from uavgram.io.exports.dxf_sheet import Sheet

TEXT_M = 0.5
UNLIKE = {"handle", "owner", "layer", "geometry"}


def described(entity: DXFEntity) -> list[tuple[str, object]]:
    """Attributes of an entity, numbers to a millionth."""
    values: dict[str, object] = {"type": entity.dxftype(), "text": getattr(entity, "text", "")}
    for name, value in entity.dxf.all_existing_dxf_attribs().items():
        if name in UNLIKE:
            continue
        values[name] = value if isinstance(value, str) else np.round(np.array([*_flat(value)]), 6)
    return [(name, str(values[name]).replace("-0.", " 0.")) for name in sorted(values)]


def _flat(value: object) -> list[float]:
    return [float(one) for one in value] if hasattr(value, "__iter__") else [float(str(value))]


@pytest.mark.parametrize("length", [30.0, 0.9])  # arrows between its ends, and outside of them
@pytest.mark.parametrize("distance", [2.0, -3.0])
def test_a_dimension_is_what_ezdxf_draws(length: float, distance: float, tmp_path: Path) -> None:
    document = new("R2010", setup=["linetypes", "styles"], units=units.M)
    space = document.modelspace()
    dimension_style(document, TEXT_M)
    start = np.array([3.0, 4.0])
    end = start + length * np.array([0.8, 0.6])
    middle = (start + end) / 2 + (distance + 0.8 * TEXT_M) * np.array([-0.6, 0.8])
    sheet = Sheet(document, Drawn(document, space), lambda enu: enu, TEXT_M)
    ends = np.column_stack([[start, end], [7.0, 7.0]])
    draw_dimension(sheet, "0", ends, distance, middle, "L1: 1.000 ±0.010 m")
    drawn = space.add_aligned_dim(
        p1=tuple(start), p2=tuple(end), distance=distance, text="L1: 1.000 ±0.010 m",
        dimstyle="UAVGRAM",
    )  # fmt: skip
    drawn.set_location(tuple(middle))
    drawn.render().dimension.translate(0.0, 0.0, 7.0)
    document.saveas(tmp_path / "drawing.dxf")

    ours, theirs = readfile(tmp_path / "drawing.dxf").modelspace().query("DIMENSION")
    assert described(ours) == described(theirs)
    parts = [[described(part) for part in one.get_geometry_block()] for one in (ours, theirs)]
    assert parts[0] == parts[1]
