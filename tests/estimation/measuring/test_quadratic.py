"""Second-order terms of quadratic functions of normal errors: by the law, and by draws."""

from __future__ import annotations

import numpy as np
import pytest

from uavgram.estimation.measuring.second_order import compute_second_order_terms, make_moves


def test_moments_of_quadratic_forms() -> None:
    """Mean and variance of g e + e H e / 2: as they are known, and as draws have them."""
    rng = np.random.default_rng(19)
    slope, root = rng.standard_normal((3, 5)), rng.standard_normal((3, 5, 5))
    bent = root + np.swapaxes(root, 1, 2)

    def values(error: np.ndarray) -> np.ndarray:
        flat = 7.0 + error @ slope.T
        return np.asarray(flat + 0.5 * np.einsum("si,mij,sj->sm", error, bent, error))

    directions = np.linalg.qr(rng.standard_normal((5, 5)))[0]
    found = compute_second_order_terms(values(make_moves(directions)), np.full(3, 7.0))
    assert found.bias == pytest.approx(0.5 * np.trace(bent, axis1=1, axis2=2))
    assert found.variance == pytest.approx(0.5 * np.sum(bent**2, axis=(1, 2)))
    drawn = values(rng.standard_normal((200_000, 5)))
    whole = np.sum(slope**2, axis=1) + found.variance
    assert drawn.mean(axis=0) - 7.0 == pytest.approx(found.bias, abs=5e-3 * np.sqrt(whole.max()))
    assert drawn.var(axis=0) == pytest.approx(whole, rel=0.02)


def test_without_a_solution_there_is_no_term() -> None:
    values = np.zeros((6, 2))
    values[3, 1] = np.nan
    found = compute_second_order_terms(values, np.zeros(2))
    assert np.isnan(found.variance).tolist() == [False, True]
