"""Real flights drawn: every point is named in plans and photos, and no text covers another."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from uavgram.io.exports.dxf import place_texts
from uavgram.model.arrays import Floats
from uavgram.model.result.result import Result
from uavgram.pipeline.measure.compute import compute
from uavgram.pipeline.measure.inputs import read_inputs
from uavgram.stages.products.map_layers import features_of
from uavgram.stages.products.text_places import overlaps
from uavgram.views.report import render_annex, render_report

PLAN = re.compile(r'<svg class="drawing".*?</svg>', re.DOTALL)
TEXT = re.compile(
    r'<text x="([-\d.]+)" y="([-\d.]+)" class="(\w+)"[^>]*font-size="([\d.]+)" '
    r'font-weight="(\w+)"[^>]*>(.*?)</text>'
)


@pytest.fixture(scope="module", params=["street_nadir", "street_oblique", "calm_nadir"])
def result(request: pytest.FixtureRequest, data_dir: Path) -> Result:
    return compute(read_inputs(data_dir / request.param / "project.yaml")).result


def boxes_of(plan: str) -> tuple[list[str], Floats]:
    """Texts of a plan, and the rectangles of their letters, which are no wider than this."""
    texts, boxes = [], []
    for x, y, kind, size, weight, text in TEXT.findall(plan):
        if kind != "scale":
            height = float(size)
            half = (0.32 if weight == "bold" else 0.28) * height * len(text)
            texts.append(text)
            boxes.append((float(x), float(y) - 0.3 * height, half, 0.4 * height, 0.0))
    return texts, np.array(boxes)


def test_plans_of_the_report_name_every_point(result: Result) -> None:
    plans = PLAN.findall(render_report(result) + render_annex(result))
    assert len(plans) >= 3
    for plan in plans:
        texts, boxes = boxes_of(plan)
        assert set(result.points.label) <= set(texts)
        assert not np.triu(overlaps(boxes, boxes), 1).any()


def test_texts_of_the_cad_drawing_are_apart_and_near_what_they_name(result: Result) -> None:
    placed = place_texts(features_of(result, None))
    assert len(placed.texts) > 100
    assert not np.triu(overlaps(placed.boxes, placed.boxes), 1).any()
    for text, box in zip(placed.texts, placed.boxes, strict=True):
        start, end = text.label.start, text.label.end
        line = start + np.linspace(0.0, 1.0, 501)[:, None] * (end - start)
        cos, sin = np.cos(box[4]), np.sin(box[4])
        own = np.abs((line - box[:2]) @ np.array([[cos, -sin], [sin, cos]])) - box[2:4]
        apart = np.linalg.norm(np.maximum(own, 0.0), axis=1).min()
        assert apart < 12.0 * placed.text_m
