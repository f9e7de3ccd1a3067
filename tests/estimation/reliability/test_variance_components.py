"""Variance components: against the textbook's closed forms and a dense marginal likelihood."""

from typing import NamedTuple

import numpy as np
import pytest

from uavgram.estimation.reliability.variance_components import (
    LinearisedObservations,
    VarianceComponent,
    compute_boundary_probability,
    estimate_single,
)
from uavgram.estimation.solver.normal_equations import Block
from uavgram.estimation.solver.sparse.block_matrix import Structure
from uavgram.model.arrays import Floats

GROUPS, EACH = 12, 5


class OneWay(NamedTuple):
    """Measurements of a mean in groups, each with an offset of its own, as a linear model."""

    value: Floats
    linear: LinearisedObservations

    @property
    def mean_squares(self) -> tuple[float, float]:
        """Between and within groups."""
        middle = self.value.mean(axis=1)
        between = EACH * float(np.sum((middle - self.value.mean()) ** 2)) / (GROUPS - 1)
        within = float(np.sum((self.value - middle[:, None]) ** 2)) / (GROUPS * (EACH - 1))
        return between, within


def one_way(seed: int, noise: float, offset: float) -> OneWay:
    """Unknowns: the offsets of the groups, then the mean; residuals at zero of all of them."""
    rng = np.random.default_rng(seed)
    value = 3.0 + rng.normal(0, offset, (GROUPS, 1)) + rng.normal(0, noise, (GROUPS, EACH))
    group = np.repeat(np.arange(GROUPS), EACH)
    columns = np.column_stack([group, np.full(len(group), GROUPS)])
    measured = Block(-value.reshape(-1, 1), columns, np.ones((len(group), 1, 2)))
    offsets = Block(np.zeros((GROUPS, 1)), np.arange(GROUPS)[:, None], np.ones((GROUPS, 1, 1)))
    blocks = {"pixels": measured, "roughness": offsets}
    return OneWay(value, LinearisedObservations(blocks, GROUPS + 1, Structure.plain(GROUPS + 1)))


BOTH = (VarianceComponent("pixels"), VarianceComponent("roughness"))


@pytest.mark.parametrize("seed", range(4))
def test_a_balanced_one_way_layout_has_the_estimates_of_the_analysis_of_variance(seed: int) -> None:
    # Searle, Casella and McCulloch 1992, "Variance components", sec. 4.5: restricted maximum
    # likelihood of balanced data are the ANOVA estimators, where these are positive.
    layout = one_way(seed, noise=0.7, offset=1.6)
    between, within = layout.mean_squares
    found = layout.linear.estimate(BOTH, np.ones(2))

    expected = np.sqrt([within, (between - within) / EACH])
    np.testing.assert_allclose(found.factor, expected, rtol=2e-3)
    # The within-group estimator is chi-square: its logarithm has the sigma 1 / sqrt(2 * degrees).
    sigma = layout.linear.log_sigmas(BOTH, found.factor)
    assert sigma[0] == pytest.approx(1 / np.sqrt(2 * GROUPS * (EACH - 1)), rel=0.05)


def test_the_likelihood_is_the_marginal_one_of_the_dense_model() -> None:
    layout = one_way(9, noise=0.7, offset=1.6)
    same = np.kron(np.eye(GROUPS), np.ones((EACH, EACH)))

    def dense(noise: float, offset: float) -> float:
        """Harville 1977: log likelihood of what is free of the mean."""
        covariance = noise**2 * np.eye(GROUPS * EACH) + offset**2 * same
        inverse, one = np.linalg.inv(covariance), np.ones(GROUPS * EACH)
        weight = one @ inverse @ one
        y = layout.value.ravel()
        rest = y - one @ inverse @ y / weight
        logarithm = float(np.linalg.slogdet(covariance)[1]) + float(np.log(weight))
        return -0.5 * (logarithm + float(rest @ inverse @ rest))

    pairs = [(0.7, 1.6), (1.2, 0.4), (0.4, 2.5)]
    ours = [layout.linear.log_likelihood(BOTH, np.array(pair)) for pair in pairs]
    theirs = [dense(*pair) for pair in pairs]
    np.testing.assert_allclose(np.diff(ours), np.diff(theirs), rtol=1e-9)


def test_a_prior_counts_as_so_many_observations() -> None:
    free = estimate_single(80.0, 20.0, VarianceComponent("pixels"))
    held = estimate_single(80.0, 20.0, VarianceComponent("pixels", weight=20.0))

    assert free.factor == pytest.approx(2.0)
    assert held.factor == pytest.approx(np.sqrt(2.5))
    assert held.sigma < free.sigma


def test_a_factor_never_falls_below_its_bound() -> None:
    held = VarianceComponent("pixels", weight=20.0, smallest=1.0)
    assert estimate_single(1.0, 60.0, held).factor == 1.0
    layout = one_way(2, noise=0.3, offset=1.6)
    found = layout.linear.estimate((held, VarianceComponent("roughness")), np.ones(2))
    assert found.factor[0] == pytest.approx(1.0)


def test_rows_make_components_of_their_own() -> None:
    layout = one_way(5, noise=0.5, offset=0.01)
    blocks = dict(layout.linear.blocks)
    worse = np.arange(0, GROUPS * EACH, 2)
    residual = np.array(blocks["pixels"].residual)
    residual[worse] = -3.0 + 4.0 * (residual[worse] + 3.0)
    blocks["pixels"] = Block(residual, blocks["pixels"].columns, blocks["pixels"].jacobian)
    linear = LinearisedObservations(blocks, GROUPS + 1, layout.linear.structure)
    rest = np.setdiff1d(np.arange(GROUPS * EACH), worse)
    found = linear.estimate(
        (VarianceComponent("pixels", worse), VarianceComponent("pixels", rest)), np.ones(2)
    )

    assert found.factor[0] / found.factor[1] == pytest.approx(4.0, rel=0.5)


def test_a_variance_at_its_boundary_has_half_the_chance() -> None:
    # Critical values of 5 % of the mixtures of chi-squares: 2.706 and 4.231 (Stoel et al. 2006,
    # "Likelihood ratio testing in variance components models with constraints", Psychological
    # Methods 11).
    assert compute_boundary_probability(2.706 / 2, 1) == pytest.approx(0.05, abs=1e-4)
    assert compute_boundary_probability(4.231 / 2, 2) == pytest.approx(0.05, abs=1e-4)
    assert compute_boundary_probability(0.0, 1) == 1.0
