"""Sums of products by group against a loop, for any groups and chunks."""

from __future__ import annotations

import numpy as np
import pytest

from uavgram.estimation.solver.sparse import block_matrix
from uavgram.estimation.solver.sparse.block_matrix import GroupedProducts


@pytest.mark.parametrize("chunk", [1, 250_000])
def test_every_product_is_added_once_to_its_group(
    monkeypatch: pytest.MonkeyPatch, chunk: int
) -> None:
    monkeypatch.setattr(block_matrix, "CHUNK_SIZE", chunk)
    rng = np.random.default_rng(0)
    left, right = rng.normal(size=(30, 2, 3)), rng.normal(size=(20, 2, 4))
    one, other = rng.integers(0, 30, 200), rng.integers(0, 20, 200)
    group = rng.integers(0, 12, 200) ** 2 // 12  # some groups large, some empty
    before = rng.normal(size=(15, 3, 4))
    expected = before.copy()
    for i, j, g in zip(one, other, group, strict=True):
        expected[g] += left[i].T @ right[j]

    GroupedProducts(one, other, group).add(before, left, right)

    np.testing.assert_allclose(before, expected, atol=1e-12)


def test_no_products_change_nothing() -> None:
    none = np.zeros(0, dtype=np.int64)
    out = np.ones((3, 2, 2))
    GroupedProducts(none, none, none).add(out, np.ones((1, 1, 2)), np.ones((1, 1, 2)))
    np.testing.assert_array_equal(out, 1.0)
