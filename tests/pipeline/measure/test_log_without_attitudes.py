"""A log that never says how the vehicle was turned: places from it, attitudes from ties."""

from dataclasses import replace
from pathlib import Path

import numpy as np
from hostile_conditions import CLEAN
from hostile_project import write_project
from hostile_surveys import make_survey

from uavgram.pipeline.measure.compute import compute
from uavgram.pipeline.measure.inputs import read_inputs


def test_ties_turn_photos_of_a_log_that_has_only_positions(tmp_path: Path) -> None:
    survey = make_survey(replace(CLEAN, ties=80), 0)
    inputs = read_inputs(write_project(survey, tmp_path))
    assert inputs.log is not None
    boots = tuple(replace(boot, attitudes=None, gimbal=None) for boot in inputs.log.boots)
    result = compute(replace(inputs, log=replace(inputs.log, boots=boots)), curved=False).result

    assert result.solution.converged
    assert set(result.frames.status) == {"refined"}
    rows = result.measurements
    true = np.array([survey.truth[name] for name in rows.name])
    assert (np.abs(rows.value - true) < 4.5 * rows.sigma).all()
    assert (rows.sigma < 0.01 * true).all()
    assert "attitude-unknown" in {m.code for m in result.messages}
