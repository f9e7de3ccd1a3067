"""The marks of the report, as fontTools reads the paths of drawings."""

from math import pi

import pytest
from fontTools.pens.areaPen import AreaPen
from fontTools.pens.boundsPen import BoundsPen
from fontTools.svgLib.path import parse_path

from uavgram.views.report.picture_marks import draw_mark, draw_rings

X, Y, R, INNER = 812.34, 77.5, 6.28, 1.44
AREAS = {"match": 4 * R**2, "target": 2 * R**2, "hand": pi * R**2, "removed": 0.0}


@pytest.mark.parametrize("kind", AREAS)
def test_a_mark_stands_about_its_pick(kind: str) -> None:
    made = draw_mark((X, Y), kind, "#123456", (R, INNER))

    assert made[:3] == (X, Y, "#123456")
    assert _bounds(made.outline) == pytest.approx((X - R, Y - R, X + R, Y + R), abs=0.01)
    assert _bounds(made.middle) == pytest.approx(
        (X - INNER, Y - INNER, X + INNER, Y + INNER), abs=0.01
    )
    if kind != "removed":
        area = AreaPen(None)
        parse_path(made.outline, area)
        assert abs(area.value) == pytest.approx(AREAS[kind], rel=0.001)


def test_rings_are_one_path() -> None:
    assert _bounds(draw_rings([(0.0, 0.0), (10.0, 20.0)], 2.2)) == pytest.approx(
        (-2.2, -2.2, 12.2, 22.2)
    )


def _bounds(path: str) -> tuple[float, float, float, float]:
    pen = BoundsPen(None)
    parse_path(path, pen)
    assert pen.bounds is not None
    left, top, right, bottom = pen.bounds
    return left, top, right, bottom
