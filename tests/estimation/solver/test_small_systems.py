"""Algebra with the number of the system as the last axis, against numpy."""

from __future__ import annotations

import numpy as np

from uavgram.estimation.solver.batched import cholesky, solve_lower, solve_lower_transposed


def test_factors_and_solutions_are_those_of_numpy() -> None:
    rng = np.random.default_rng(2)
    root = rng.standard_normal((40, 6, 6))
    matrix = root @ np.swapaxes(root, 1, 2) + 0.1 * np.eye(6)
    right = rng.standard_normal((40, 6, 3))
    lower = cholesky(matrix.transpose(1, 2, 0))
    assert np.allclose(lower.transpose(2, 0, 1), np.linalg.cholesky(matrix), atol=1e-12)
    solved = solve_lower_transposed(lower, solve_lower(lower, right.transpose(1, 2, 0)))
    assert np.allclose(solved.transpose(2, 0, 1), np.linalg.solve(matrix, right), rtol=1e-9)


def test_what_is_not_positive_is_marked_alone() -> None:
    matrix = np.repeat(np.eye(3)[:, :, None], 4, axis=2)
    matrix[1, 1, 2] = -1.0
    lower = cholesky(matrix)
    assert np.isnan(lower[..., 2]).any()
    assert np.isfinite(lower[..., [0, 1, 3]]).all()
