"""Are the uncertainties honest on surveys as users have them? A small part of the study.

All of it: `tests/benchmarks/study_reality.py`. Measurements of one survey go together, so surveys
are what is counted; bounds hold at 99.9 %.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hostile_conditions import CONDITIONS
from hostile_surveys import make_survey, write_project
from scipy.stats import t

from uavgram.model.arrays import Floats
from uavgram.model.result.result import Result
from uavgram.pipeline.measure.compute import compute
from uavgram.pipeline.measure.inputs import read_inputs

pytestmark = pytest.mark.statistical

SURVEYS = 40


def ran(condition: str, seed: int, folder: Path) -> tuple[Result, Floats]:
    """The result of a survey, and errors over sigmas of what was measured."""
    survey = make_survey(CONDITIONS[condition], seed)
    project = write_project(survey, folder / f"{condition}_{seed}")
    result = compute(read_inputs(project), curved=False).result
    measured = result.measurements
    truth = np.array([survey.truth[name] for name in measured.name])
    return result, (measured.value - truth) / measured.sigma


def test_errors_of_clean_surveys_are_as_large_as_stated(tmp_path: Path) -> None:
    square = [np.mean(ran("clean", seed, tmp_path)[1] ** 2) for seed in range(SURVEYS)]
    error = np.std(square, ddof=1) / np.sqrt(SURVEYS)
    most = t.ppf(0.9995, SURVEYS - 1) * error
    assert abs(np.mean(square) - 1.0) < most
    assert most < 0.5  # else the bound says nothing


@pytest.mark.parametrize("seed", [42, 146])
def test_no_false_pose_without_a_log(seed: int, tmp_path: Path) -> None:
    """Four points in common, or the lengths of the first photo alone, once led to a false pose."""
    result, z = ran("no_log_few", seed, tmp_path)
    assert result.solution.variance_factor < 1.5
    assert np.nanmax(np.abs(z)) < 4.0
