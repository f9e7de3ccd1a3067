"""Points on a line of known position: their errors together are as large as stated together.

The line is known better than the picks tell it. Its ends err, and all points on it with them: who
takes the points for independent thinks their common offset half as large as it is.
"""

from __future__ import annotations

import os
from functools import partial

import numpy as np
import pytest
from known_scenes import SIGMA_M, on_a_line_of_position, with_known
from scenes import make_scene
from scipy.stats import chi2

from uavgram.estimation.solver.levenberg_marquardt import minimise
from uavgram.estimation.survey import known_kinds
from uavgram.estimation.survey.likelihood import SurveyProblem
from uavgram.estimation.survey.observations.known import compute_known_rows
from uavgram.estimation.survey.unknowns import advance_state
from uavgram.geometry.ground.conditions import compute_joint_covariance
from uavgram.model.arrays import Floats

pytestmark = pytest.mark.statistical

TRIALS = max(24, int(os.environ.get("UAVGRAM_REPETITIONS", "0")))
TAIL = 0.0005


def squares() -> tuple[tuple[float, int], tuple[float, int]]:
    """Of all scenes: squared errors in their sigmas, and of how many numbers they are.

    All errors jointly; and the mean offset of each scene's points alone.
    """
    total, of_mean, count = 0.0, 0.0, 0
    for seed in range(TRIALS):
        rng = np.random.default_rng([seed, 8])
        placed = on_a_line_of_position(rng, SIGMA_M)
        scene = make_scene(seed, frames=3, labels=10, lines=4, sources=("pixels",))
        scene = with_known(scene, "on_line", placed, SIGMA_M, rng, 0.0)
        problem = SurveyProblem(scene.survey, scene.pivot, np.ones(4, dtype=bool))
        layout = problem.layout
        minimum = minimise(
            scene.truth,
            problem.evaluate,
            partial(advance_state, layout),
            layout.size,
            layout.structure,
        )
        assert minimum.converged
        rows = compute_known_rows(problem, minimum.state, scene.survey.known)
        joint = minimum.factor.covariances(rows.columns, rows.gradient)
        error = rows.value - placed.truth
        total += float(error @ np.linalg.solve(joint, error))
        of_mean += float(error.mean() ** 2 / joint.mean())
        count += len(error)
    return (total, count), (of_mean, TRIALS)


def is_honest(total: float, count: int) -> bool:
    return bool(chi2.ppf(TAIL, count) <= total <= chi2.ppf(1 - TAIL, count))


def test_errors_together_are_as_large_as_the_covariance_says() -> None:
    together, of_mean = squares()

    assert is_honest(*together), together
    assert is_honest(*of_mean), of_mean


def test_points_that_count_as_independent_break_the_bounds(monkeypatch: pytest.MonkeyPatch) -> None:
    right = compute_joint_covariance

    def independent(by_ends: Floats, sigma_m: Floats, own_m: float) -> Floats:
        return np.diag(np.diag(right(by_ends, sigma_m, own_m)))

    monkeypatch.setattr(known_kinds, "compute_joint_covariance", independent)

    assert not is_honest(*squares()[1])
