"""Intervals of bias, spread and shares, against scipy and by their coverage."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import binom, binomtest, chi2, ttest_1samp

from uavgram.model.arrays import Floats
from uavgram.model.simulation import Repetitions
from uavgram.synthetic.simulate import (
    compute_accuracy,
    compute_running_ratio,
    compute_share_intervals,
)


def repetitions(error: Floats, sigma: float = 1.0, *, lost: tuple[int, ...] = ()) -> Repetitions:
    count, values = error.shape
    settled = ~np.isin(np.arange(count), lost)
    return Repetitions(
        name=tuple(f"m{k}" for k in range(values)),
        unit=("m",) * values,
        predicted=np.full(values, sigma),
        number=np.arange(count),
        true=np.full(error.shape, 7.0),
        value=7.0 + error,
        sigma=np.full(error.shape, sigma),
        level=("green",) * count,
        failure=("",) * count,
        converged=settled,
        codes=((),) * count,
    )


def test_ranges_are_those_of_scipy() -> None:
    error = np.random.default_rng(1).normal(0.3, 2.0, (40, 3))
    found = compute_accuracy(repetitions(error))
    for k in range(3):
        interval = ttest_1samp(error[:, k], 0.0).confidence_interval(0.95)
        assert found.bias_range[k] == pytest.approx([interval.low, interval.high])
        spread = error[:, k].std(ddof=1)
        assert found.spread[k] == pytest.approx(spread)
        ends = spread * np.sqrt(39 / np.array([chi2.ppf(0.975, 39), chi2.ppf(0.025, 39)]))
        assert found.spread_range[k] == pytest.approx(ends)
        inside = int((np.abs(error[:, k]) <= 1.0).sum())
        proportion = binomtest(inside, 40).proportion_ci(0.95, method="exact")
        assert found.coverage[k, 0] == inside / 40
        assert found.coverage_range[k, 0] == pytest.approx([proportion.low, proportion.high])
        assert found.z[k] == pytest.approx(np.sqrt(np.mean(error[:, k] ** 2)))


def test_none_and_all_have_ranges_too() -> None:
    share, ends = compute_share_intervals(np.array([0, 12]), np.array([12, 12]))
    told = [binomtest(k, 12).proportion_ci(0.95, method="exact") for k in (0, 12)]
    assert share.tolist() == [0.0, 1.0]
    assert ends == pytest.approx(np.array([[one.low, one.high] for one in told]))


def test_ranges_hold_the_truth_as_often_as_they_say() -> None:
    error = np.random.default_rng(2).normal(0.0, 1.0, (20, 4000))
    found = compute_accuracy(repetitions(error))
    for ends, true in ((found.bias_range, 0.0), (found.spread_range, 1.0), (found.z_range, 1.0)):
        held = int(((ends[:, 0] <= true) & (true <= ends[:, 1])).sum())
        assert binom.ppf(1e-4, 4000, 0.95) <= held <= binom.ppf(1 - 1e-4, 4000, 0.95)


def test_what_did_not_come_to_rest_is_not_counted() -> None:
    error = np.random.default_rng(3).normal(0.0, 1.0, (30, 2))
    wild = error.copy()
    wild[[4, 9]] = 1e6
    found = compute_accuracy(repetitions(wild, lost=(4, 9)))
    kept = compute_accuracy(repetitions(np.delete(error, [4, 9], axis=0)))
    assert found.count.tolist() == [28, 28]
    assert found.spread == pytest.approx(kept.spread)
    assert repetitions(wild, lost=(4, 9)).unsettled == 2


def test_without_any_value_there_is_nothing_to_say() -> None:
    found = compute_accuracy(repetitions(np.full((5, 1), np.nan)))
    assert found.count.tolist() == [0]
    assert np.isnan([found.bias[0], found.spread[0], found.z[0], *found.coverage[0]]).all()
    assert np.isnan(compute_running_ratio(repetitions(np.full((5, 1), np.nan)), 5))
