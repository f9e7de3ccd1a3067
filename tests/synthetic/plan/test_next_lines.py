"""What one more line would have brought, against the survey that has it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from uavgram.model.planned import NextLines
from uavgram.synthetic.accident_scene import SceneLine, ScenePoint
from uavgram.synthetic.plan.next_lines import find_next_lines_of_inputs
from uavgram.synthetic.scenario import Scenario
from uavgram.synthetic.simulate import predict_sigmas
from uavgram.synthetic.survey import ScenarioWorld

HERE = Path("project.yaml")


def scenario() -> Scenario:
    """The demo with four photos on each strip, and nothing measured but lengths."""
    usual = Scenario()
    lengths = tuple(one for one in usual.measurements if one.kind in {"distance", "polyline"})
    flight = replace(usual.flight, photos_per_strip=4, wobble_m=0.0)
    errors = replace(usual.errors, lost_exposure=0)
    return replace(usual, flight=flight, errors=errors, measurements=lengths)


@pytest.fixture(scope="module")
def found() -> NextLines:
    return find_next_lines_of_inputs(ScenarioWorld(scenario()).exact().inputs, HERE)


def mean_of(one: Scenario) -> float:
    return float(np.mean(predict_sigmas(ScenarioWorld(one))[2]))


def test_the_mean_is_that_of_the_run(found: NextLines) -> None:
    assert found.mean_sigma == pytest.approx(mean_of(scenario()), rel=1e-6)
    assert found.unit == "m"


@pytest.mark.parametrize("lost", [0, 4])
def test_one_line_less_is_the_survey_without_it(found: NextLines, lost: int) -> None:
    usual = scenario()
    lines = tuple(one for one in usual.lines if one.name != found.name[lost])
    without = mean_of(replace(usual, lines=lines))
    assert found.without_it[lost] == pytest.approx(without, rel=1e-4)
    assert without > found.mean_sigma


def test_the_best_line_brings_what_it_promises(found: NextLines) -> None:
    usual = scenario()
    ends = np.stack([found.start_world_m[0], found.end_world_m[0]])[:, :2]
    xy = usual.site.in_scene(ends)
    added = tuple(
        ScenePoint(label=name, x_m=float(x), y_m=float(y))
        for name, (x, y) in zip("AB", xy, strict=True)
    )
    line = SceneLine(name="new", start="A", end="B")
    more = replace(usual, points=(*usual.points, *added), lines=(*usual.lines, line))
    gained = found.mean_sigma - mean_of(more)
    assert gained > 0
    assert found.mean_sigma - found.with_it[0] == pytest.approx(gained, rel=0.1)
    assert (np.diff(found.with_it) >= 0).all()
