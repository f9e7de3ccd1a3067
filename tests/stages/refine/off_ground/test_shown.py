"""Matches say where points are in space: what is no point of the ground, and how uneven that is."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hostile_conditions import CONDITIONS
from hostile_project import write_project
from hostile_surveys import make_survey

from uavgram.model.result.result import Result
from uavgram.pipeline.measure.compute import compute
from uavgram.pipeline.measure.inputs import read_inputs

RAISED_M, ROUGH_M = 1.5, 0.04


@pytest.fixture(scope="module")
def result(tmp_path_factory: pytest.TempPathFactory) -> Result:
    condition = replace(CONDITIONS["matched"], raised=((3, RAISED_M),), relief_m=ROUGH_M)
    folder: Path = tmp_path_factory.mktemp("raised")
    project = write_project(make_survey(condition, 5), folder)
    return compute(read_inputs(project), curved=False).result


def test_a_label_that_stands_off_the_ground_is_told_with_its_height(result: Result) -> None:
    told = [message for message in result.messages if message.code == "point-off-ground"]

    assert [message.labels for message in told] == [("P3",)]
    (height,), (sigma,) = told[0].heights_m, told[0].heights_sigma_m
    assert sigma < 0.1
    assert abs(height - RAISED_M) < 4 * sigma


def test_uneven_ground_costs_no_match_and_is_told_as_such(result: Result) -> None:
    codes = {message.code for message in result.messages if message.level != "info"}

    assert "removed" not in result.picks.status
    assert codes <= {"point-off-ground", "ground-not-plane", "nothing-checks"}
    assert result.noise is not None
    (ground,) = result.noise.roughness
    assert ground.stated_m == 0.02
    assert abs(ground.estimated_m - ROUGH_M) < 4 * ground.sigma_m
    assert ground.sigma_m < 0.5 * ROUGH_M
    match = next(one for one in result.noise.picks if one.source == "match")
    assert np.isclose(match.factor, 1.0, atol=5 * match.sigma)
