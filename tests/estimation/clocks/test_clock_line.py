"""Lines between clocks: outliers, drift, one-sided delays."""

import numpy as np
import pytest

from uavgram.estimation.clocks.clock_line import BOOT_DRIFT_SIGMA, ClockLine, fit_lower_envelope
from uavgram.estimation.clocks.clock_line import fit_line as fit_any_line
from uavgram.model.arrays import Floats

EPOCH = 1.7e9


def fit_line(time_s: Floats, other_s: Floats) -> ClockLine:
    return fit_any_line(time_s, other_s, BOOT_DRIFT_SIGMA)


def test_offset_and_drift_come_back_from_noisy_pairs_with_outliers() -> None:
    rng = np.random.default_rng(1)
    time = np.arange(30, 1500, 0.2)
    other = EPOCH + time * (1 - 146e-6) + rng.normal(0, 0.01, len(time))
    other[rng.random(len(time)) < 0.2] += 18.0  # another leap second count
    line = fit_line(time, other)
    error = (
        time
        + line.offset_s
        + line.drift * (time - line.reference_s)
        - (EPOCH + time * (1 - 146e-6))
    )
    assert np.abs(error).max() < 0.003
    assert 0.009 < line.scatter_s < 0.014  # a fifth of outliers widens the median deviation


def test_the_sigma_of_the_line_is_that_of_its_level() -> None:
    rng = np.random.default_rng(2)
    time = np.linspace(0, 200, 400)
    errors = []
    for _ in range(300):
        line = fit_line(time, EPOCH + time + rng.normal(0, 0.05, len(time)))
        errors.append((line.at(100.0) - EPOCH - 100) / line.offset_sigma_s)
    assert 0.85 < np.std(errors) < 1.15  # 300 trials: sigma of std is 0.04


def test_a_short_log_invents_no_drift() -> None:
    rng = np.random.default_rng(3)
    time = np.array([10.0, 10.2, 10.4, 10.6])
    line = fit_line(time, EPOCH + time + rng.normal(0, 0.01, 4))
    assert abs(line.drift) < 1e-5


def test_a_single_pair_is_its_own_line() -> None:
    line = fit_line(np.array([5.0]), np.array([EPOCH + 5]))
    assert line.at(5.0) == pytest.approx(EPOCH + 5, abs=1e-6)


def test_the_lower_envelope_ignores_the_delays() -> None:
    rng = np.random.default_rng(4)
    time = np.arange(100, 400, 0.25)
    delay = 0.02 + rng.exponential(0.2, len(time))
    late = EPOCH + time * (1 + 20e-6) + delay
    line = fit_lower_envelope(time, late)
    error = (
        time
        + line.offset_s
        + line.drift * (time - line.reference_s)
        - (EPOCH + time * (1 + 20e-6) + 0.02)
    )
    assert np.abs(error).max() < 0.03
    assert np.abs(fit_line(time, late).at(0.0) - EPOCH) > 0.1  # what the envelope is for


def test_the_sigma_of_the_drift_is_true() -> None:
    rng = np.random.default_rng(5)
    time = np.linspace(0, 600, 600)
    lines = [fit_line(time, EPOCH + time + rng.normal(0, 0.02, len(time))) for _ in range(300)]
    errors = [line.drift / line.drift_sigma for line in lines]
    assert 0.85 < np.std(errors) < 1.15  # 300 trials: sigma of std is 0.04
