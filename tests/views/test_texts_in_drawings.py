"""In every kind of drawing of random surveys no text covers another, and lines end at texts."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import synthetic_survey
from drawn_texts import check_texts, in_annex, in_cad, in_recording, in_report, in_svg, on_plan
from planned_sample import sample_plan

from uavgram.model.result.result import Result
from uavgram.views.field_sheet import field_sheet

SURVEYS = 4


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
