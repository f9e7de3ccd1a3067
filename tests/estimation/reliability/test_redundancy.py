"""Redundancy, standardised residuals and detectable biases against direct dense formulas."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scenes import Scene, make_scene
from scipy.stats import binom, kstest, norm
from whole_surveys import with_all

from uavgram.estimation.reliability import redundancy as module
from uavgram.estimation.reliability.redundancy import (
    compute_critical_value,
    compute_group_fit,
    compute_minimal_detectable_bias,
    compute_reliability,
    compute_upper_tail,
)
from uavgram.estimation.solver.normal_equations import Block, Factor, NormalEquations
from uavgram.estimation.survey.adjustment import Adjustment
from uavgram.model.arrays import Floats
from uavgram.model.options import SolveOptions
from uavgram.stages.refine import refine

CASES: dict[str, dict[str, Any]] = {
    "telemetry": {},
    "rough ground and control": {"roughness": 0.05, "control": 3},
    "lengths alone": {"telemetry": False, "gauge": "plane"},
}


def adjusted(scene: Scene) -> Adjustment:
    return refine(scene.survey, SolveOptions())[0].adjustment


@pytest.mark.parametrize("options", CASES.values(), ids=CASES.keys())
def test_redundancy_numbers_of_all_groups_sum_to_the_degrees_of_freedom(
    options: dict[str, Any],
) -> None:
    adjustment = adjusted(make_scene(4, **options))
    blocks = adjustment.minimum.blocks
    total = sum(
        compute_reliability(b, adjustment.covariance).redundancy.sum() for b in blocks.values()
    )
    observations = sum(b.residual.size for b in blocks.values())
    assert total == pytest.approx(observations - adjustment.problem.layout.size, abs=1e-5)


@pytest.mark.parametrize("kind", ["length", "pick"])
@pytest.mark.parametrize("index", [0, 3, 5])
def test_the_largest_w_is_that_of_a_planted_blunder(kind: str, index: int) -> None:
    scene = make_scene(6, frames=6, lines=8)
    survey = scene.survey
    if kind == "length":
        length = np.array(survey.length_m)
        length[index] += 0.5
        survey = replace(survey, length_m=length)
    else:
        pixel = np.array(survey.pixel_px)
        pixel[7 * index, 1] += 15
        survey = replace(survey, pixel_px=pixel)
    adjustment = with_all(survey).adjustment
    largest = {
        name: np.abs(compute_reliability(block, adjustment.covariance).w)
        for name, block in adjustment.minimum.blocks.items()
    }
    name = max(largest, key=lambda n: largest[n].max())
    w = largest[name]
    assert w.max() > 5
    if kind == "length":
        assert (name, int(w.argmax())) == ("lengths", index)
    else:
        row, axis = np.unravel_index(w.argmax(), w.shape)
        assert (name, int(row), int(axis)) == ("pixels", 7 * index, 1)


def random_problem(rng: np.random.Generator, n: int, unknowns: int) -> tuple[Block, Factor, Floats]:
    """A linear problem with unit weights: block, factor, covariance, the projector I - A S A^T."""
    jacobian = rng.normal(size=(n, 1, unknowns)) * rng.lognormal(size=(n, 1, 1))
    columns = np.tile(np.arange(unknowns), (n, 1))
    block = Block(np.zeros((n, 1)), columns, jacobian)
    factor = NormalEquations([block], unknowns).factor()
    rows = jacobian[:, 0]
    projector = np.eye(n) - rows @ np.linalg.inv(rows.T @ rows) @ rows.T
    return block, factor, projector


def test_a_bias_of_the_minimal_detectable_size_is_found_in_80_of_100_cases() -> None:
    rng = np.random.default_rng(1)
    block, factor, projector = random_problem(rng, 12, 5)
    covariance = factor.covariance()
    redundancy = compute_reliability(block, covariance).redundancy
    alpha, trials = 0.01, 4000
    sigma = rng.uniform(0.5, 2, (12, 1))
    bias = compute_minimal_detectable_bias(redundancy, sigma, alpha)
    lowest, highest = binom.ppf(np.array([1e-6, 1 - 1e-6]), trials, 0.80)
    for row in range(12):
        noise = rng.normal(size=(trials, 12))
        noise[:, row] += bias[row, 0] / sigma[row, 0]
        w = noise @ projector[row] / np.sqrt(redundancy[row, 0])
        one = replace(block, residual=(projector @ noise[0])[:, None])
        assert compute_reliability(one, covariance).w[row, 0] == pytest.approx(w[0])
        assert lowest <= (np.abs(w) > compute_critical_value(alpha)).sum() <= highest


def test_an_unchecked_observation_has_no_w_and_no_detectable_bias() -> None:
    block = Block(
        np.array([[0.3], [-0.2], [0.1]]),
        np.array([[0], [1], [1]]),
        np.ones((3, 1, 1)),
    )
    covariance = NormalEquations([block], 2).factor().covariance()
    numbers = compute_reliability(block, covariance)
    np.testing.assert_allclose(numbers.redundancy[:, 0], [0, 0.5, 0.5], atol=1e-12)
    assert numbers.w[0, 0] == 0
    bias = compute_minimal_detectable_bias(numbers.redundancy[:, 0], np.full(3, 0.02), 0.001)
    assert np.isnan(bias[0])
    assert bias[1] == pytest.approx(0.02 * (3.2905267 + 0.8416212) / np.sqrt(0.5), rel=1e-6)


@pytest.mark.parametrize("exact", [100, 0])
def test_probabilities_of_a_group_are_uniform_where_the_model_holds(
    monkeypatch: pytest.MonkeyPatch, exact: int
) -> None:
    # exact = 0: the way of large groups.
    monkeypatch.setattr(module, "MAX_EXACT_SIZE", exact)
    rng = np.random.default_rng(5)
    n, unknowns, part = 40, 8, 30
    whole, factor, projector = random_problem(rng, n, unknowns)
    covariance = factor.covariance()
    probability = []
    for _ in range(1000):
        residual = projector @ rng.normal(size=n)
        group = Block(residual[:part, None], whole.columns[:part], whole.jacobian[:part])
        fit = compute_group_fit(group, factor, covariance)
        probability.append(fit.probability)
    assert fit.redundancy == pytest.approx(np.trace(projector[:part, :part]))
    assert kstest(probability, "uniform").pvalue > 1e-4


def test_the_test_of_one_observation_is_its_w_test() -> None:
    rng = np.random.default_rng(2)
    whole, factor, projector = random_problem(rng, 10, 4)
    residual = projector @ rng.normal(size=10)
    one = Block(residual[:1, None], whole.columns[:1], whole.jacobian[:1])
    fit = compute_group_fit(one, factor, factor.covariance())
    w = compute_reliability(one, factor.covariance()).w[0, 0]
    assert fit.probability == pytest.approx(2 * norm.sf(abs(w)))
    assert fit.variance_factor == pytest.approx(w**2)


def test_without_redundancy_nothing_is_improbable() -> None:
    assert compute_upper_tail(1e9, 0) == 1.0
    block = Block(np.array([[3.0]]), np.zeros((1, 1), int), np.ones((1, 1, 1)))
    factor = NormalEquations([block], 1).factor()
    fit = compute_group_fit(block, factor, factor.covariance())
    assert np.isnan(fit.variance_factor)
    assert fit.probability == 1.0
