"""A readout time drawn from its prior is found within its sigma, and lengths stay honest."""

from __future__ import annotations

import numpy as np
import pytest
from rolling_scenes import read_in_rows
from scenes import make_scene
from scipy.stats import chi2

from uavgram.model.options import SolveOptions
from uavgram.stages.refine import refine

pytestmark = pytest.mark.statistical

TRIALS = 30
TAIL = 1e-4 / 2


def test_the_readout_and_lengths_are_as_far_off_as_their_sigmas_say() -> None:
    readout, lengths, gain = [], [], []
    for seed in range(TRIALS):
        drawn_s = float(np.random.default_rng((5, seed)).normal(0.0, 0.03))
        scene = read_in_rows(make_scene(900 + seed, frames=5), drawn_s, seed=seed)
        adjustment = refine(scene.survey, SolveOptions())[0].adjustment
        if not adjustment.problem.layout.readout:
            continue
        variance = adjustment.shared_covariance(adjustment.problem.layout.first_readout, 1)[0, 0]
        readout.append((adjustment.state.readout[0] - drawn_s) ** 2 / variance)
        gain.append(np.sqrt(variance) / 0.03)
        start, end = (
            np.array([adjustment.label_index("P0")]),
            np.array([adjustment.label_index("P1")]),
        )
        length, gradient, unknowns = adjustment.problem.lengths_between(
            adjustment.state, start, end
        )
        sigma = np.sqrt(adjustment.minimum.factor.variances(unknowns, gradient))
        true = np.linalg.norm(scene.world[0] - scene.world[1])
        lengths.append(((length - true) / sigma)[0] ** 2)

    assert len(readout) == TRIALS
    assert np.median(gain) < 0.5  # the picks tell it, not its prior
    low, high = (float(chi2.ppf(tail, TRIALS)) / TRIALS for tail in (TAIL, 1 - TAIL))
    assert low < np.mean(readout) < high
    assert low < np.mean(lengths) < high
