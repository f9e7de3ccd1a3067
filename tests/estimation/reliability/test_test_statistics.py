"""Test statistics of every group against dense formulas, and what undetected errors would do."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import scenes
from power_of_tests import compute_power
from scenes import NO_TIMES, Scene, make_scene
from scipy.stats import norm

from uavgram.estimation.measuring.propagation import compute_values, propagate
from uavgram.estimation.reliability.external import compute_external_reliability
from uavgram.estimation.reliability.redundancy import compute_minimal_detectable_bias
from uavgram.estimation.reliability.test_statistics import compute_test_statistics
from uavgram.estimation.solver.normal_equations import Block
from uavgram.estimation.survey.adjustment import Adjustment
from uavgram.estimation.survey.moved import refit
from uavgram.estimation.survey.observations.kinds import READINGS
from uavgram.model.arrays import Floats
from uavgram.model.observations import MeasurementRequest
from uavgram.model.options import SolveOptions
from uavgram.stages.judge.priors import compute_prior_residuals
from uavgram.stages.refine import refine

ALPHA = 0.001
REQUESTS = (
    MeasurementRequest(name="whole", kind="distance", points=("P0", "P1")),
    MeasurementRequest(name="field", kind="area", points=("P0", "P1", "P2")),
    MeasurementRequest(name="place", kind="coordinate", points=("P3",)),
)


def adjusted(scene: Scene) -> Adjustment:
    return refine(scene.survey, SolveOptions())[0].adjustment


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
