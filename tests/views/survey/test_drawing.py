"""In every kind of drawing of random surveys no text covers another, and lines end at texts."""

from __future__ import annotations

import re
from dataclasses import replace
from math import pi
from typing import get_args

import numpy as np
import pytest
import synthetic_survey
from drawn_texts import check_texts, in_annex, in_cad, in_recording, in_report, in_svg, on_plan
from fontTools.pens.areaPen import AreaPen
from fontTools.pens.boundsPen import BoundsPen
from fontTools.svgLib.path import parse_path
from planned_sample import sample_plan

from uavgram.model.result.result import Result
from uavgram.views.field_sheet import field_sheet
from uavgram.views.survey.drawing import Drawing, Look, Sign

SURVEYS = 3


@pytest.fixture(scope="module", params=range(SURVEYS))
def result(request: pytest.FixtureRequest) -> Result:
    """A survey whose points are anywhere, some of them close together."""
    rng = np.random.default_rng(request.param)
    label = ("P{:02d}", "corner of kerb {}")[request.param % 2]
    made = synthetic_survey.build(frame_count=3, point_count=30, label=label)
    place = made.points.position_world_m.copy()
    crowd = rng.random(len(place)) < 0.6
    place[:, :2] += rng.normal(size=(len(place), 2)) * 12.0
    place[crowd, :2] = place[0, :2] + rng.normal(size=(int(crowd.sum()), 2)) * rng.uniform(0.3, 4)
    return replace(made, points=replace(made.points, position_world_m=place))


def test_in_the_report(result: Result) -> None:
    drawings = [*in_report(result), *in_annex(result)]
    assert len(drawings) >= 2
    assert sum(len(one.line_ends) for one in drawings) > 5
    for one in drawings:
        check_texts(one)


@pytest.mark.parametrize("result", [0, 2], indirect=True)  # whose lengths join named points
def test_the_plan_names_what_the_result_rests_on_and_the_annex_every_point(result: Result) -> None:
    every, lines = set(result.points.label), result.lines
    used = {*lines.start, *lines.end, *result.point_checks.label}.union(
        *result.known.points, *result.measurements.points
    )
    assert set() < used & every < every
    (plan,) = (one for one in in_report(result) if used & every <= set(one.texts))
    assert used & every < every.intersection(plan.texts)  # others where there is room
    assert len([one for one in in_annex(result) if every <= set(one.texts)]) == 2


def test_in_the_cad_drawing(result: Result) -> None:
    drawn = in_cad(result)
    assert set(result.points.label) <= set(drawn.texts)
    check_texts(drawn)


def test_on_the_plan_to_scale(result: Result) -> None:
    drawn = on_plan(result)
    assert len(drawn.texts) > 10
    check_texts(drawn)


def test_in_the_recording(result: Result) -> None:
    drawings = list(in_recording(result))
    assert sum(len(one.line_ends) for one in drawings) > 5
    for one in drawings:
        assert one.texts
        check_texts(one)


@pytest.mark.parametrize("seed", range(4))
def test_on_the_field_sheet(seed: int) -> None:
    rng, plan = np.random.default_rng(seed), sample_plan()
    points = plan.points.world_m + rng.normal(size=plan.points.world_m.shape) * [9.0, 9.0, 0.0]
    crowded = replace(plan, points=replace(plan.points, world_m=points))
    drawn = in_svg(field_sheet(crowded))
    assert {"L5b", "P6", "skid left"} <= set(drawn.texts)
    check_texts(drawn)


# Signs in drawings, as fontTools reads the paths of their SVG.


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
