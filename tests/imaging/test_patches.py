"""Fits of many windows at once: each ends for itself."""

from __future__ import annotations

import numpy as np
import pytest

from uavgram.imaging.patches import (
    compute_variance_growth,
    estimate_neighbour_correlation,
    fit_windows,
)
from uavgram.model.arrays import Floats, Ints

PLACE = np.linspace(-6.0, 6.0, 41)
TRUTH = np.array([[0.4, 1.5, 80.0], [-1.0, 0.8, -50.0], [0.7, 2.5, 30.0]])
START = np.array([[0.0, 2.0, 50.0], [0.0, 2.0, -20.0], [0.0, 2.0, 10.0]])


def bells(state: Floats) -> tuple[Floats, Floats]:
    """Values (n, k) of bells by place, width and height, and their derivatives (n, 3, k)."""
    middle, width, height = (one[:, None] for one in state.T)
    away = (PLACE - middle) / width
    bell = np.exp(-0.5 * away**2)
    value = height * bell
    return value, np.stack([value * away / width, value * away**2 / width, bell], axis=1)


def model(state: Floats, index: Ints) -> tuple[Floats, Floats]:
    value, by = bells(state)
    return value - bells(TRUTH[index])[0], by


@pytest.mark.parametrize("damping", [1e-2, 0.0])
def test_windows_are_fitted_each_for_itself(damping: float) -> None:
    fit = fit_windows(model, START, damping=damping)
    np.testing.assert_allclose(fit.state, TRUTH, rtol=1e-6)
    assert fit.cost.max() < 1e-6
    by = bells(fit.state)[1]
    np.testing.assert_allclose(fit.inverse @ by @ np.swapaxes(by, 1, 2), [np.eye(3)] * 3, atol=1e-5)


def test_a_bound_holds() -> None:
    upper = np.array([np.inf, 1.2, np.inf])
    fit = fit_windows(model, np.minimum(START, upper), bounds=(-upper, upper))
    assert fit.state[:, 1].max() == 1.2
    np.testing.assert_allclose(fit.state[1], TRUTH[1], rtol=1e-6)


def test_a_window_without_residuals_is_given_up_and_stops_no_other() -> None:
    start = START.copy()
    start[1, 0] = np.nan
    fit = fit_windows(model, start)
    assert not np.isfinite(fit.cost[1])
    np.testing.assert_allclose(fit.state[[0, 2]], TRUTH[[0, 2]], rtol=1e-6)


def test_a_window_that_shows_nothing_stops_no_other() -> None:
    def masked(state: Floats, index: Ints) -> tuple[Floats, Floats]:
        residual, by = model(state, index)
        seen = (index != 2)[:, None]
        return residual * seen, by * seen[..., None]

    fit = fit_windows(masked, START)
    np.testing.assert_allclose(fit.state, [*TRUTH[:2], START[2]], rtol=1e-6)
    assert np.isfinite(fit.inverse).all()


def test_the_mean_of_residuals_that_run_on_scatters_by_their_growth() -> None:
    rng = np.random.default_rng(1)
    side, forget = 40, 0.5
    noise = rng.standard_normal((600, side + 20, side))
    for row in range(1, side + 20):
        noise[:, row] = forget * noise[:, row - 1] + np.sqrt(1 - forget**2) * noise[:, row]
    noise = noise[:, 20:]
    correlation = estimate_neighbour_correlation(noise, np.ones((side, side)))
    np.testing.assert_allclose(correlation.mean(axis=1), [0.0, forget], atol=0.02)
    white = 1.0 / side**2
    assert noise.mean(axis=(1, 2)).var() / white == pytest.approx(
        compute_variance_growth(correlation).mean(), rel=0.2
    )
