"""Sums of products of small matrices, group by group: what normal equations are made of."""

from __future__ import annotations

import numpy as np

from uavgram.model.arrays import Floats, Ints

CHUNK = 250_000
"""Numbers gathered at a time: they stay in the processor's cache between gathering and use."""


class GroupedProducts:
    """Sums over groups g of left[i]^T right[j], for fixed triples (i, j, g).

    Groups of equally many members are one batch of matrix products, so that the gathered factors
    are all that is ever held beside the result.

    Parameters
    ----------
    left, right
        (n,) which matrices are multiplied.
    group
        (n,) which sum the product belongs to.
    """

    def __init__(self, left: Ints, right: Ints, group: Ints) -> None:
        order = np.argsort(group, kind="stable")
        target, start, count = np.unique(group[order], return_index=True, return_counts=True)
        self._batches: list[tuple[Ints, Ints, Ints]] = []
        for members in np.unique(count):
            chosen = np.flatnonzero(count == members)
            one = order[start[chosen][:, None] + np.arange(members)]
            self._batches.append((target[chosen], left[one], right[one]))

    def add(self, out: Floats, left: Floats, right: Floats) -> None:
        """Add each sum to its place in `out`.

        Parameters
        ----------
        out
            (groups, a, b), changed in place.
        left, right
            (n, r, a), (m, r, b).
        """
        rows, a, b = left.shape[1], left.shape[2], right.shape[2]
        for target, one, other in self._batches:
            step = max(1, CHUNK // (one.shape[1] * rows * (a + b)))
            for start in range(0, len(target), step):
                part = slice(start, start + step)
                some = one[part]  # b may be zero: sizes are told, not found out
                first = left[some].reshape(len(some), one.shape[1] * rows, a)
                second = right[other[part]].reshape(len(some), one.shape[1] * rows, b)
                out[target[part]] += np.swapaxes(first, 1, 2) @ second
