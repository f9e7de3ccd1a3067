"""Algebra with the number of the system as the last axis, against numpy and scipy."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from uavgram.estimation.repeated.photo_step import rotate
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


@pytest.mark.parametrize("angle", [0.0, 1e-9, 5e-3, 0.0099, 0.0101, 0.7, 3.0])
def test_turns_and_their_derivatives_are_those_of_scipy(angle: float) -> None:
    rng = np.random.default_rng(3)
    axis = rng.standard_normal((3, 20))
    vector = angle * axis / np.linalg.norm(axis, axis=0)
    base = Rotation.random(20, random_state=4)
    rotation, by_vector = rotate(base.as_matrix().transpose(1, 2, 0), vector)
    told = (base * Rotation.from_rotvec(vector.T)).as_matrix()
    assert np.allclose(rotation.transpose(2, 0, 1), told, atol=1e-14)
    step = 1e-6
    for k in range(3):
        moved = np.zeros((3, 1))
        moved[k] = step
        ahead, behind = ((base * Rotation.from_rotvec((vector + way * moved).T)) for way in (1, -1))
        # ahead = exp(w) behind: w is the turn in the world that the derivative tells.
        world = (ahead * behind.inv()).as_rotvec() / (2 * step)
        assert np.allclose(by_vector[:, k].T, world, atol=2e-9)
