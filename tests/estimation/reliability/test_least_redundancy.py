"""A reading that nearly nothing checks is not accused, however large its test statistic is."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scenes import make_scene

from uavgram.estimation.reliability.data_snooping import find_suspicions
from uavgram.estimation.reliability.test_statistics import compute_test_statistics
from uavgram.estimation.survey.observations.kinds import READINGS
from uavgram.stages.refine.minima import Participants, find_best_minima


@pytest.mark.parametrize("seed", [5, 16, 24])
def test_lengths_that_nothing_checks_are_not_blamed_for_relief(seed: int) -> None:
    """One oblique photo of which all picks are a little off, as over uneven ground."""
    scene = make_scene(seed, frames=1, labels=10, lines=7, gauge="plane", telemetry=False, tilt=1.0)
    pixel = scene.survey.pixel_px
    off = 4.0 * np.random.default_rng(seed).normal(size=pixel.shape)
    survey = replace(scene.survey, pixel_px=pixel + off)
    none = np.zeros(len(survey.line_start), dtype=np.bool_)
    taking = Participants(survey, np.ones(len(pixel), dtype=np.bool_), none, {})
    adjustment = find_best_minima(taking).adjustment
    groups = compute_test_statistics(adjustment)
    found = list(find_suspicions(adjustment, groups, 0.001))
    assert found
    for suspicion in found:
        for one in (suspicion.suspect, *suspicion.group, *suspicion.rivals):
            if one.kind in READINGS:
                assert groups[one.kind].redundancy[one.row].max() > 0.02
