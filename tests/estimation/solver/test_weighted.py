"""Weights of groups: the small and the large way against the whole problem written out."""

import numpy as np
import pytest

from uavgram.estimation.reliability.variance_components import WeightedProblem
from uavgram.estimation.solver import normal_equations
from uavgram.estimation.solver.normal_equations import Block
from uavgram.estimation.solver.sparse.block_matrix import Structure
from uavgram.model.arrays import Floats

SIZE = 6


def rows(rng: np.random.Generator, count: int, each: int) -> Block:
    """Of unknowns at random, some of them named twice in a row."""
    columns = rng.integers(0, SIZE, (count, 4))
    return Block(rng.normal(size=(count, each)), columns, rng.normal(size=(count, each, 4)))


def written_out(block: Block) -> tuple[Floats, Floats]:
    jacobian = np.zeros((*block.residual.shape, SIZE))
    for row, columns in enumerate(block.columns):
        for k, column in enumerate(columns):
            jacobian[row, :, column] += block.jacobian[row, :, k]
    return block.residual.ravel(), jacobian.reshape(-1, SIZE)


@pytest.mark.parametrize("others", [0, 5])
@pytest.mark.parametrize("entries", [0, 250_000], ids=["large", "small"])
def test_minimum_determinant_and_leverage_are_those_of_the_whole_problem(
    monkeypatch: pytest.MonkeyPatch, entries: int, others: int
) -> None:
    monkeypatch.setattr(normal_equations, "MAX_DENSE_ENTRIES", entries)
    rng = np.random.default_rng(3)
    groups, rest = [rows(rng, 9, 2), rows(rng, 7, 1)], [rows(rng, others, 3)] if others else []
    weighted = WeightedProblem(groups, rest, SIZE, Structure.plain(SIZE))
    for weight in (np.array([1.0, 1.0]), np.array([0.04, 30.0])):
        every = [written_out(block) for block in (*groups, *rest)]
        root = np.repeat(np.sqrt([*weight, 1.0][: len(every)]), [len(r) for r, _ in every])
        residual = np.concatenate([r for r, _ in every]) * root
        jacobian = np.concatenate([j for _, j in every]) * root[:, None]
        hat = jacobian @ np.linalg.pinv(jacobian)
        left = residual - hat @ residual
        fit = weighted.fit(weight)

        assert fit.cost == pytest.approx(left @ left, rel=1e-10)
        logarithm = np.linalg.slogdet(jacobian.T @ jacobian)[1]
        assert fit.log_determinant == pytest.approx(logarithm, rel=1e-10)
        spans = np.split(np.arange(len(residual)), [18, 25])[:2]
        np.testing.assert_allclose(fit.squares, [left[s] @ left[s] for s in spans], rtol=1e-9)
        np.testing.assert_allclose(fit.leverage, [np.trace(hat[np.ix_(s, s)]) for s in spans])
