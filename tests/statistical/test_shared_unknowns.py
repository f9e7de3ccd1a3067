"""What a flight has in common is found, and as well as its sigma says."""

from __future__ import annotations

import numpy as np
import pytest
from adjusted_scenes import adjust_from_truth
from scenes import make_scene
from scipy.stats import chi2

from uavgram.estimation.survey.observations.telemetry import TELEMETRY_PARTS
from uavgram.geometry.motion import camera_motion as telemetry_pose
from uavgram.model.arrays import Floats

pytestmark = pytest.mark.statistical

TRIALS = 24
TAIL = 1e-5 / 2
PARTS = ("position_bias", "heading_bias", "clock", "clock_drift")


def found_and_true(name: str, trials: int = TRIALS) -> tuple[Floats, Floats]:
    """Squared errors over covariance, and posterior over prior sigmas, of one shared unknown."""
    part = TELEMETRY_PARTS[name]
    squares: list[float] = []
    gain: list[Floats] = []
    for seed in range(trials):
        scene = make_scene(
            500 + seed, frames=8, labels=9, lines=0, control=5, sources=(name, "pixels")
        )
        adjustment = adjust_from_truth(scene)
        assert adjustment is not None
        first = adjustment.problem.layout.first_telemetry + part.start
        covariance = adjustment.shared_covariance(first, part.stop - part.start)
        error = adjustment.state.telemetry[part] - scene.truth.telemetry[part]
        squares.append(float(error @ np.linalg.solve(covariance, error)))
        gain.append(np.sqrt(np.diag(covariance)) / adjustment.problem.telemetry_sigma[part])
    return np.array(squares), np.array(gain)


def off_bounds(squares: Floats, degrees: int) -> bool:
    count = len(squares)
    low, high = chi2.ppf(np.array([TAIL, 1 - TAIL]), count * degrees) / count
    return not low <= squares.mean() <= high


@pytest.mark.parametrize("name", PARTS)
def test_a_planted_value_is_found_within_its_sigma(name: str) -> None:
    squares, gain = found_and_true(name)
    assert gain.max() < 0.6  # the observations tell it, not its prior
    assert not off_bounds(squares, gain.shape[1])


def test_a_drift_applied_twice_breaks_the_bounds(monkeypatch: pytest.MonkeyPatch) -> None:
    right = telemetry_pose.correct_time

    def twice(shared: Floats, time_s: Floats, middle_s: float) -> Floats:
        doubled = shared.copy()
        doubled[TELEMETRY_PARTS["clock_drift"]] *= 2.0
        return right(doubled, time_s, middle_s)

    monkeypatch.setattr("uavgram.estimation.survey.observations.telemetry.correct_time", twice)
    squares, _ = found_and_true("clock_drift", trials=5)
    assert off_bounds(squares, 1)
