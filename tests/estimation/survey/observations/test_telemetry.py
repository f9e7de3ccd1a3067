"""The factor by which correlated errors are less well known than independent ones."""

from __future__ import annotations

import numpy as np
import pytest
import scenes
from numpy.typing import ArrayLike

from uavgram.estimation.survey.observations.telemetry import compute_trend_inflation
from uavgram.model.arrays import Floats


def sampled(time: Floats, tau: float, draws: int = 4000) -> float:
    """Variance of a Gauss-Markov process over white noise, in one period over the whole span."""
    white = np.random.default_rng(8).normal(size=(len(time), draws))
    errors = scenes.gauss_markov(white, time, tau)
    phase = 2 * np.pi * np.arange(len(time)) / len(time)
    wave = np.exp(1j * phase) / np.sqrt(len(time))
    result: float = np.mean(np.abs(wave @ errors) ** 2)
    return result


@pytest.mark.parametrize(("count", "tau"), [(30, 5.0), (100, 5.0), (100, 15.0), (200, 60.0)])
def test_it_is_what_draws_of_the_process_show(count: int, tau: float) -> None:
    time = 2.0 * np.arange(count, dtype=float)
    factor = compute_trend_inflation(time, tau, tau)
    # The ends of a short record leak power between its waves: a fifth, at these lengths.
    assert sampled(time, tau) == pytest.approx(factor, rel=0.2)


def test_the_worst_time_of_the_range_is_taken() -> None:
    time = 2.0 * np.arange(60, dtype=float)
    alone = [compute_trend_inflation(time, tau, tau) for tau in np.linspace(5, 60, 56)]
    assert compute_trend_inflation(time, 5.0, 60.0) == pytest.approx(max(alone), rel=0.02)
    assert compute_trend_inflation(time, 5.0, 60.0) == pytest.approx(60 / (2 * np.pi), rel=0.05)


@pytest.mark.parametrize("time", [[], [3.0], [3.0, 9.0], [7.0] * 9, 2.0 * np.arange(5)])
def test_a_few_frames_are_left_as_they_are(time: ArrayLike) -> None:
    assert compute_trend_inflation(np.array(time), 5.0, 60.0) == 1.0


def test_the_order_of_the_instants_does_not_matter() -> None:
    time = np.random.default_rng(0).uniform(0, 200, 50)
    assert compute_trend_inflation(time, 5.0, 60.0) == compute_trend_inflation(
        np.sort(time), 5.0, 60.0
    )
