"""Real flights drawn: every point is named in plans and photos, and no text covers another."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from drawn_texts import check_texts, in_annex, in_cad, in_recording, in_report, on_plan

from uavgram.io.exports.dxf import place_texts
from uavgram.model.result.result import Result
from uavgram.pipeline.measure.compute import compute
from uavgram.pipeline.measure.inputs import read_inputs
from uavgram.stages.products.map_layers import features_of


@pytest.fixture(scope="module", params=["street_nadir", "street_oblique", "calm_nadir"])
def result(request: pytest.FixtureRequest, data_dir: Path) -> Result:
    return compute(read_inputs(data_dir / request.param / "project.yaml")).result


def test_the_plan_names_what_the_result_rests_on_and_the_annex_every_point(
    result: Result,
) -> None:
    every, lines = set(result.points.label), result.lines
    used = {*lines.start, *lines.end, *result.point_checks.label}.union(*result.known.points)
    used = used.union(*result.measurements.points)
    assert used & every
    (plan,) = (one for one in in_report(result) if used & every <= set(one.texts))
    assert every.intersection(plan.texts) == used & every
    plans = [one for one in in_annex(result) if every <= set(one.texts)]
    assert len(plans) == 2
    for one in (*in_report(result), *in_annex(result)):
        check_texts(one)


def test_texts_on_the_plan_to_scale_and_in_the_recording_are_apart(result: Result) -> None:
    check_texts(on_plan(result))
    for one in in_recording(result):
        check_texts(one)


def test_texts_of_the_cad_drawing_are_apart_and_near_what_they_name(result: Result) -> None:
    placed = place_texts(features_of(result, None))
    assert len(placed.texts) > 100
    check_texts(in_cad(result))
    for text, box in zip(placed.texts, placed.places.boxes, strict=True):
        start, end = text.label.start, text.label.end
        line = start + np.linspace(0.0, 1.0, 501)[:, None] * (end - start)
        cos, sin = np.cos(box[4]), np.sin(box[4])
        own = np.abs((line - box[:2]) @ np.array([[cos, -sin], [sin, cos]])) - box[2:4]
        apart = np.linalg.norm(np.maximum(own, 0.0), axis=1).min()
        assert apart < 12.0 * placed.text_m
