"""Redundancy, standardised residuals and detectable biases against direct dense formulas."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import scenes
from power_of_tests import compute_power
from scenes import NO_TIMES, Scene, make_scene
from scipy.stats import binom, kstest, norm
from whole_surveys import with_all

from uavgram.estimation.measuring.propagation import compute_values, propagate
from uavgram.estimation.reliability import redundancy as module
from uavgram.estimation.reliability.external import compute_external_reliability
from uavgram.estimation.reliability.redundancy import (
    compute_critical_value,
    compute_group_fit,
    compute_minimal_detectable_bias,
    compute_reliability,
    compute_test_statistics,
    compute_upper_tail,
)
from uavgram.estimation.solver.normal_equations import Block, Factor, NormalEquations
from uavgram.estimation.survey.adjustment import Adjustment
from uavgram.estimation.survey.observations.kinds import READINGS
from uavgram.estimation.survey.readjustment import refit
from uavgram.model.arrays import Floats
from uavgram.model.observations import MeasurementRequest
from uavgram.model.options import SolveOptions
from uavgram.stages.judge.unchecked import compute_prior_residuals
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


# Test statistics of every group, and effects of undetected errors, against dense formulas.


ALPHA = 0.001
REQUESTS = (
    MeasurementRequest(name="whole", kind="distance", points=("P0", "P1")),
    MeasurementRequest(name="field", kind="area", points=("P0", "P1", "P2")),
    MeasurementRequest(name="place", kind="coordinate", points=("P3",)),
)


def dense_rows(block: Block, size: int) -> Floats:
    n, r, k = block.jacobian.shape
    rows = np.zeros((n, r, size))
    for i in range(n):
        for j in range(k):
            rows[i, :, block.columns[i, j]] += block.jacobian[i, :, j]
    return rows


def test_w_of_correlated_observations_equals_the_formula_in_their_own_units() -> None:
    adjustment = adjusted(make_scene(8, frames=5, control=3))
    problem, minimum = adjustment.problem, adjustment.minimum
    group, white = compute_test_statistics(adjustment)["telemetry"], problem.telemetry_whitening
    block, found = group.block, group.w
    size = problem.layout.size
    inverse = minimum.factor.joint(np.arange(size))
    rows = dense_rows(block, size)
    for i in range(len(block.residual)):
        unwhite = np.linalg.inv(white[i])
        own = unwhite @ unwhite.T  # covariance of the six observations
        design = unwhite @ rows[i]
        residual = unwhite @ block.residual[i]
        weight = np.linalg.inv(own)
        of_residual = own - design @ inverse @ design.T
        variance = np.diag(weight @ of_residual @ weight)
        np.testing.assert_allclose(found[i], weight @ residual / np.sqrt(variance), rtol=1e-6)


def test_calibration_is_one_correlated_observation_in_its_own_parameters() -> None:
    adjustment = adjusted(make_scene(8, frames=5, control=3))
    group = compute_test_statistics(adjustment)["calibration"]
    layout, basis = adjustment.problem.layout, adjustment.problem.intrinsic_basis
    columns = layout.first_intrinsic + np.arange(layout.intrinsics)
    posterior = basis @ adjustment.minimum.factor.joint(columns) @ basis.T
    prior = scenes.calibration_covariance()
    weight = np.linalg.inv(prior)
    residual = basis @ adjustment.state.intrinsic
    variance = np.diag(weight @ (prior - posterior) @ weight)
    np.testing.assert_allclose(group.w[0], weight @ residual / np.sqrt(variance), rtol=1e-5)
    # Tests of priors share the significance of ten: delta0 = z(1 - 10 alpha / 2 n) + z(0.8).
    tests = sum(
        g.w.size for kind, g in compute_test_statistics(adjustment).items() if kind not in READINGS
    )
    assert tests > 10
    delta0 = norm.isf(10 * ALPHA / (2 * tests)) + norm.isf(0.2)
    bias = delta0 / np.sqrt(variance)
    np.testing.assert_allclose(group.bias(ALPHA)[0], bias, rtol=1e-5)
    expected = residual / np.sqrt(np.diag(prior))
    np.testing.assert_allclose(compute_prior_residuals(group)[0], expected, rtol=1e-6, atol=1e-9)


def test_a_parameter_known_exactly_cannot_err() -> None:
    survey = make_scene(8).survey
    covariance = np.array(survey.calibration.covariance)
    covariance[8] = covariance[:, 8] = 0.0
    for known in (covariance, np.zeros((9, 9))):
        calibration = replace(survey.calibration, covariance=known)
        adjustment = refine(replace(survey, calibration=calibration), SolveOptions())[0].adjustment
        group = compute_test_statistics(adjustment)["calibration"]
        assert group.w[0, 8] == group.redundancy[0, 8] == compute_prior_residuals(group)[0, 8] == 0
        assert np.isnan(group.bias(ALPHA)[0, 8])


@pytest.mark.parametrize(
    "kind", ["lengths", "pixels", "control", "telemetry", "boresight", "clock"]
)
def test_an_undetected_error_moves_a_measurement_as_far_as_it_is_said_to(kind: str) -> None:
    scene = make_scene(8, frames=5, control=2, noise=0.1)
    adjustment = adjusted(scene)
    groups = compute_test_statistics(adjustment)
    measured = propagate(adjustment, REQUESTS, NO_TIMES)
    worst, _ = compute_external_reliability(groups, measured, ALPHA)
    group, found = groups[kind], worst[kind]
    row, axis = np.unravel_index(found.sigmas.argmax(), found.sigmas.shape)
    # A tenth of the bias, as an observed error of its own, and everything adjusted anew.
    error = np.zeros_like(group.block.residual)
    whitened = 0.1 * group.bias(ALPHA)[row, axis] / group.scale[row, axis]
    error[row] = group.direction[row, :, axis] * whitened
    moved = []
    for sign in (1.0, -1.0):
        state = refit(adjustment, {kind: sign * error})
        assert state is not None
        moved.append(compute_values(adjustment.problem, state, REQUESTS, NO_TIMES))
    change = (moved[0] - moved[1]) / 2 / 0.1
    assert np.abs(change / measured.sigma).argmax() == found.measurement[row, axis]
    on = found.measurement[row, axis]
    assert change[on] == pytest.approx(found.change[row, axis], rel=0.02)


def test_the_weakest_link_of_a_measurement_moves_it_most_of_all() -> None:
    adjustment = adjusted(make_scene(8, frames=5, control=2))
    groups, measured = (
        compute_test_statistics(adjustment),
        propagate(adjustment, REQUESTS, NO_TIMES),
    )
    _, weakest = compute_external_reliability(groups, measured, ALPHA)
    for i, link in enumerate(weakest):
        largest = 0.0
        for group in groups.values():
            step = measured.solved[:, i]
            by_axis = np.einsum("nra,nr->na", group.direction, group.response(step))
            effect = np.nan_to_num(by_axis * group.bias(ALPHA) / group.scale)
            largest = max(largest, np.abs(effect[group.redundancy > 0.01]).max())
        assert abs(link.change) == pytest.approx(largest)
        assert link.unchecked == ()


def test_what_nothing_checks_is_named() -> None:
    # One frame, no length on P0: its pick alone tells where it is.
    scene = make_scene(3, frames=1, telemetry=False, gauge="plane", tilt=0.4, ends=(
        (1, 6), (2, 7), (3, 8), (4, 9), (5, 10),
    ))  # fmt: skip
    adjustment = adjusted(scene)
    measured = propagate(adjustment, REQUESTS[:1], NO_TIMES)
    _, (weakest,) = compute_external_reliability(
        compute_test_statistics(adjustment), measured, ALPHA
    )
    assert ("pixels", 0) in {(m.kind, m.row) for m in weakest.unchecked}


def test_power_is_80_percent_at_the_detectable_bias_and_the_significance_at_none() -> None:
    redundancy, sigma = np.array([0.1, 0.7]), np.array([0.02, 3.0])
    bias = compute_minimal_detectable_bias(redundancy, sigma, ALPHA)
    np.testing.assert_allclose(compute_power(bias, redundancy, sigma, ALPHA), 0.80, atol=1e-9)
    np.testing.assert_allclose(compute_power(0 * bias, redundancy, sigma, ALPHA), ALPHA)
    assert compute_power(bias[0] / 2, redundancy[0], sigma[0], ALPHA) == pytest.approx(
        norm.sf(norm.isf(ALPHA / 2) - (norm.isf(ALPHA / 2) + norm.ppf(0.8)) / 2), rel=1e-4
    )
