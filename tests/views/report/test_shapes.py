"""Signs in drawings, as fontTools reads the paths of their SVG."""

import re
from math import pi
from typing import get_args

import numpy as np
import pytest
from fontTools.pens.areaPen import AreaPen
from fontTools.pens.boundsPen import BoundsPen
from fontTools.svgLib.path import parse_path

from uavgram.views.survey.drawing import Drawing, Look, Sign

X, Y, R, UNIT = 812.34, 77.5, 3.14, 2.0
AREAS = {"square": 4.0, "diamond": 2.0, "ring": pi, "cross": 0.0}


@pytest.mark.parametrize("sign", get_args(Sign))
def test_a_sign_is_about_its_place(sign: Sign) -> None:
    (path,) = paths(np.array([[X, Y]]), sign)
    r = R * UNIT

    assert bounds(path) == pytest.approx((X - r, Y - r, X + r, Y + r), abs=0.06)
    if sign != "cross":
        area = AreaPen(None)
        parse_path(path, area)
        assert abs(area.value) == pytest.approx(AREAS[sign] * r**2, rel=0.01)


def test_signs_of_one_look_are_one_path() -> None:
    (path,) = paths(np.array([[0.0, 0.0], [10.0, 20.0]]), "ring")
    r = R * UNIT

    assert bounds(path) == pytest.approx((-r, -r, 10 + r, 20 + r), abs=0.01)


def paths(places: np.ndarray, sign: Sign) -> list[str]:
    drawing = Drawing("", 1000.0, 100.0, unit=UNIT)
    drawing.signs("picks", places, R, Look("#123456", 1.0), sign=sign)
    return re.findall(' d="([^"]+)"', drawing.__html__())


def bounds(path: str) -> tuple[float, float, float, float]:
    pen = BoundsPen(None)
    parse_path(path, pen)
    assert pen.bounds is not None
    left, top, right, bottom = pen.bounds
    return left, top, right, bottom
