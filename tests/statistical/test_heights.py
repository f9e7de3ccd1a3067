"""Are free heights, and distances from them, as exact as they say? A small part of the study.

All of it: `tests/benchmarks/study_heights.py`. Heights of one survey go together, so surveys are
what is counted.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from height_errors import distance_errors, height_errors
from hostile_conditions import CONDITIONS
from hostile_project import write_project
from hostile_surveys import make_survey
from scipy.stats import t

from uavgram.pipeline.measure.compute import compute
from uavgram.pipeline.measure.inputs import read_inputs

pytestmark = pytest.mark.statistical

SURVEYS = 20


def test_errors_of_free_heights_and_of_distances_from_them_are_as_large_as_stated(
    tmp_path: Path,
) -> None:
    """Cars, walls and kerbs, by 2 to 12 photos from above and aslant."""
    square = np.empty((SURVEYS, 2))
    for seed in range(SURVEYS):
        survey = make_survey(CONDITIONS["street"], seed)
        inputs = read_inputs(write_project(survey, tmp_path / str(seed)))
        result = compute(inputs, curved=False).result
        heights = height_errors(survey, result.points)
        distances = distance_errors(survey, result.measurements)
        square[seed] = [np.mean(one.z**2) for one in (heights, distances)]
        assert np.abs(heights.z).max() < 5.0

    spread = np.std(square, axis=0, ddof=1) / np.sqrt(SURVEYS)
    most = t.ppf(0.9995, SURVEYS - 1) * spread
    assert (np.abs(square.mean(axis=0) - 1.0) < most).all(), (square.mean(axis=0), most)
    assert most[0] < 0.4  # else the bound says nothing
    assert most[1] < 0.6
