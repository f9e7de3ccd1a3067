"""The loop against certified results, and what it does where there is no way down."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from uavgram.estimation.solver.levenberg_marquardt import Minimum, minimise
from uavgram.estimation.solver.normal_equations import Block, Factor, NormalEquations, SingularError
from uavgram.model.arrays import Floats

# NIST Statistical Reference Datasets, Misra1a (nonlinear regression, lower difficulty).
Y = np.array(
    [
        10.07,
        14.73,
        17.94,
        23.93,
        29.61,
        35.18,
        40.02,
        44.82,
        50.76,
        55.05,
        61.01,
        66.40,
        75.47,
        81.78,
    ]
)
X = np.array(
    [
        77.6,
        114.9,
        141.1,
        190.8,
        239.9,
        289.0,
        332.8,
        378.4,
        434.8,
        477.3,
        536.8,
        593.1,
        689.1,
        760.0,
    ]
)
CERTIFIED = np.array([2.3894212918e2, 5.5015643181e-4])
CERTIFIED_SD = np.array([2.7070075241, 7.2668688436e-6])
RESIDUAL_SD = 0.10187876330


def misra(b: Floats) -> dict[str, Block]:
    fall = np.exp(-b[1] * X)
    jacobian = np.stack([1 - fall, b[0] * X * fall], axis=1)
    columns = np.tile([0, 1], (len(X), 1))
    residual = (b[0] * (1 - fall) - Y) / RESIDUAL_SD
    return {"y": Block(residual[:, None], columns, jacobian[:, None, :] / RESIDUAL_SD)}


@pytest.mark.parametrize("start", [(500.0, 1e-4), (250.0, 5e-4)])
def test_misra1a_of_nist_to_its_certified_digits(start: tuple[float, float]) -> None:
    found = minimise(np.array(start), misra, lambda b, step: b + step, 2)
    variance = found.cost * RESIDUAL_SD**2 / (len(X) - 2)
    sigma = np.sqrt(np.diag(found.factor.joint(np.arange(2))))

    assert found.converged
    np.testing.assert_allclose(found.state, CERTIFIED, rtol=1e-6)
    np.testing.assert_allclose(np.sqrt(variance), RESIDUAL_SD, rtol=1e-9)
    np.testing.assert_allclose(sigma, CERTIFIED_SD, rtol=1e-5)


@pytest.mark.parametrize("start", [(500.0, 1e-4), (250.0, 5e-4)])
def test_iterations_end_where_a_required_sum_of_squares_is_out_of_reach(
    start: tuple[float, float],
) -> None:
    """A goal below the minimum ends them early and unconverged; one above it changes nothing."""

    def find(goal: float) -> Minimum[Floats]:
        return minimise(np.array(start), misra, lambda b, step: b + step, 2, goal=goal)

    whole = find(np.inf)
    above, below = find(1.01 * whole.cost), find(0.9 * whole.cost)

    np.testing.assert_array_equal(above.state, whole.state)
    assert above.iterations == whole.iterations
    assert not below.converged
    assert below.iterations < whole.iterations


def line(residual: float, slope: float) -> dict[str, Block]:
    return {"one": Block(np.array([[residual]]), np.zeros((1, 1), int), np.array([[[slope]]]))}


def test_a_step_into_the_impossible_is_refused_and_a_shorter_one_taken() -> None:
    # log(x) = log(1e-3) from x = 2: Newton's first step leads to x < 0.
    tried = []

    def evaluate(x: Floats) -> dict[str, Block] | None:
        tried.append(x[0])
        return None if x[0] <= 0 else line(np.log(x[0]) - np.log(1e-3), 1 / x[0])

    found = minimise(np.array([2.0]), evaluate, lambda x, step: x + step, 1)

    assert min(tried) < 0
    assert found.converged
    assert found.state[0] == pytest.approx(1e-3, rel=1e-6)


def test_impossible_first_values_are_an_error() -> None:
    with pytest.raises(ValueError, match="first values"):
        minimise(np.zeros(1), lambda _: None, lambda x, step: x + step, 1)


def test_a_jacobian_that_leads_uphill_never_converges_and_says_so() -> None:
    found = minimise(np.array([1.0]), lambda x: line(x[0], -1.0), lambda x, step: x + step, 1)
    assert not found.converged
    assert found.state[0] == 1.0


def test_a_minimum_at_infinity_is_not_reported_as_converged() -> None:
    # exp(-x / 1000) goes on falling: sixty steps do not bring it to rest.
    found = minimise(
        np.array([0.0]),
        lambda x: line(1e6 * np.exp(-x[0] / 1e3), -1e3 * np.exp(-x[0] / 1e3)),
        lambda x, step: x + np.clip(step, -1, 1),
        1,
    )
    assert not found.converged


def test_the_cost_never_rises() -> None:
    costs = []

    def evaluate(b: Floats) -> dict[str, Block]:
        blocks = misra(b)
        costs.append(float(np.sum(blocks["y"].residual ** 2)))
        return blocks

    found = minimise(np.array([500.0, 1e-4]), evaluate, lambda b, step: b + step, 2)
    assert found.cost == pytest.approx(min(costs), rel=1e-12)
    assert len(costs) > 5


def test_an_undetermined_unknown_is_named_even_where_damping_hides_it() -> None:
    def evaluate(x: Floats) -> dict[str, Block]:
        columns = np.array([[0, 1]])
        return {"sum": Block(np.array([[x.sum() - 1]]), columns, np.ones((1, 1, 2)))}

    with pytest.raises(SingularError) as error:
        minimise(np.zeros(2), evaluate, lambda x, step: x + step, 2)
    assert error.value.index in (0, 1)


def test_near_the_minimum_one_factor_serves_several_steps(monkeypatch: pytest.MonkeyPatch) -> None:
    factored = []
    factor = NormalEquations.factor

    def counted(self: NormalEquations, damping: float = 0.0, slack: float = 0.0) -> Factor:
        factored.append(1)
        return factor(self, damping, slack)

    monkeypatch.setattr(NormalEquations, "factor", counted)
    # A circle through noisy points: residuals do not vanish, so that Gauss-Newton converges slowly.
    angle = np.random.default_rng(0).uniform(0, 1.2, 40)
    point = np.column_stack([np.cos(angle), np.sin(angle)])
    point += np.random.default_rng(1).normal(0, 0.05, point.shape)

    def evaluate(c: Floats) -> dict[str, Block]:
        away = c[:2] - point
        reach = np.hypot(*away.T)
        rows = np.column_stack([away / reach[:, None], -np.ones(40)])[:, None] / 0.05
        return {"c": Block((reach - c[2])[:, None] / 0.05, np.tile([0, 1, 2], (40, 1)), rows)}

    found = minimise(np.array([0.3, 0.3, 0.7]), evaluate, lambda c, step: c + step, 3)

    assert found.converged
    assert found.iterations > len(factored)
    block = found.blocks["c"]
    rows = block.jacobian[:, 0]
    expected = np.linalg.inv(rows.T @ rows)
    np.testing.assert_allclose(found.factor.joint(np.arange(3)), expected, rtol=1e-9)
    gradient = rows.T @ block.residual[:, 0]
    assert gradient @ expected @ gradient < 1e-9


def test_a_fall_that_drowns_in_rounding_is_no_step() -> None:
    """A large remainder makes the sum of squares coarse: no damping can lower it any more."""

    def evaluate(state: Floats) -> dict[str, Block]:
        (x,) = state
        residual = np.array([[1e4, np.exp(x) - 2.0, 1e-3 * (x - 5.0)]])
        jacobian = np.array([[[0.0], [np.exp(x)], [1e-3]]])
        return {"all": Block(residual, np.zeros((1, 1), dtype=int), jacobian)}

    found = minimise(np.array([0.3]), evaluate, lambda state, step: state + step, 1)
    assert found.converged
    assert found.state[0] == pytest.approx(np.log(2.0), abs=1e-3)
    assert found.iterations < 8


def test_iterations_end_where_they_are_told_to() -> None:
    calls = []

    def evaluate(state: Floats) -> dict[str, Block]:
        calls.append(state)
        return {
            "all": Block(
                np.exp(state)[None], np.zeros((1, 1), dtype=int), np.exp(state)[None, None]
            )
        }

    found = minimise(np.array([8.0]), evaluate, lambda state, step: state + step, 1, most=3)
    assert found.iterations == 3
    assert len(calls) == 4
    assert not found.converged


def test_unknowns_that_begin_indistinguishable_are_told_apart_with_slack() -> None:
    """Like k1 and k4 of a rational lens that begins undistorted: their columns are opposite."""
    x = np.linspace(0.1, 1.0, 30)
    true = np.array([0.7, 0.4])

    def evaluate(k: Floats) -> dict[str, Block]:
        below = 1.0 + k[1] * x
        rows = np.column_stack([x / below, -x * (1.0 + k[0] * x) / below**2]) / 1e-3
        miss = ((1.0 + k[0] * x) / below - (1.0 + true[0] * x) / (1.0 + true[1] * x)) / 1e-3
        return {"k": Block(miss[:, None], np.tile([0, 1], (30, 1)), rows[:, None])}

    def moved(k: Floats, step: Floats) -> Floats:
        return k + step

    start = np.zeros(2)
    rows = evaluate(start)["k"].jacobian[:, 0]
    assert np.linalg.matrix_rank(rows) == 1
    with pytest.raises(SingularError):
        NormalEquations(list(evaluate(start).values()), 2).factor()
    found = minimise(start, evaluate, moved, 2, slack=1e-9)
    assert found.converged
    np.testing.assert_allclose(found.state, true, atol=1e-6)


def test_a_kept_factor_does_not_crawl_where_the_slope_falls() -> None:
    """Saturation: at the end the slope is 400 times smaller than at the start."""

    def evaluate(y: Floats) -> dict[str, Block]:
        residual = 0.2 * (np.exp(-6.0) - np.exp(-y))
        return {"y": Block(residual[:, None], np.array([[0]]), (0.2 * np.exp(-y))[:, None, None])}

    found = minimise(np.zeros(1), evaluate, lambda y, step: y + step, 1)
    assert found.iterations < 30
    np.testing.assert_allclose(found.state, 6.0, atol=0.05)


def valley(length: float) -> Callable[[Floats], dict[str, Block]]:
    """A valley that winds along a sine, and falls by so many sigmas to its end at x = 1."""

    def evaluate(b: Floats) -> dict[str, Block]:
        residual = np.array([1e4 * (b[1] - np.sin(200.0 * b[0]) / 200.0), length * (b[0] - 1.0)])
        slope = [[-1e4 * np.cos(200.0 * b[0]), 1e4], [length, 0.0]]
        columns = np.tile([0, 1], (2, 1))
        return {"one": Block(residual[:, None], columns, np.array(slope)[:, None, :])}

    return evaluate


def test_a_bent_valley_is_followed_in_few_steps() -> None:
    """Rosenbrock's valley, a hundred times as steep: 253 straight steps, 15 bent ones."""

    def evaluate(b: Floats) -> dict[str, Block]:
        residual = np.array([1e3 * (b[1] - b[0] ** 2), 1.0 - b[0]])
        slope = np.array([[-2e3 * b[0], 1e3], [-1.0, 0.0]])
        return {"one": Block(residual[:, None], np.tile([0, 1], (2, 1)), slope[:, None, :])}

    found = minimise(
        np.array([-1.2, 1.0]), evaluate, lambda b, step: b + step, 2, most=40, bends=True
    )
    assert found.converged
    np.testing.assert_allclose(found.state, 1.0, atol=1e-4)


@pytest.mark.parametrize(("length", "is_done"), [(0.05, True), (20.0, False)])
def test_the_end_of_a_winding_valley_is_reached_where_hardly_anything_is_left(
    length: float, *, is_done: bool
) -> None:
    found = minimise(np.zeros(2), valley(length), lambda b, step: b + step, 2, most=20)
    assert found.iterations == 20
    assert found.converged == is_done
