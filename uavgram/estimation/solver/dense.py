"""Small systems: one dense Jacobian, and the Cholesky factor of the normal matrix.

LAPACK's own functions, on matrices in its own order: the wrappers of scipy.linalg look at every
number and copy each matrix, which takes as long again as factoring some hundred unknowns.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import cast

import numpy as np
from scipy.linalg import lapack

from uavgram.estimation.solver.sparse.multifrontal import NotPositiveError
from uavgram.model.arrays import Floats, Ints


class DenseFactor:
    """L L^T of a symmetric matrix with a unit diagonal, or one a little larger.

    Parameters
    ----------
    matrix
        (n, n) in C order; it is used up.
    smallest
        Pivot below which an unknown is not determined.

    Raises
    ------
    NotPositiveError
        An unknown is not determined; `index` is the first one found.
    """

    def __init__(self, matrix: Floats, smallest: float) -> None:
        # The transpose of a symmetric matrix is the matrix, in the order that LAPACK wants.
        lower, fault = lapack.dpotrf(matrix.T, lower=1, clean=1)
        if fault:
            _, vectors = np.linalg.eigh(matrix)
            raise NotPositiveError(int(np.argmax(np.abs(vectors[:, 0]))))
        self._lower = cast("Floats", lower)
        self._pivot = lower.diagonal()
        if self._pivot.min() ** 2 < smallest:
            raise NotPositiveError(int(np.argmin(self._pivot)))

    def log_determinant(self) -> float:
        """Natural logarithm of the determinant of the matrix."""
        return 2.0 * float(np.log(self._pivot).sum())

    def solve(self, right: Floats) -> Floats:
        """Solve for one (n,) or several (n, m) right-hand sides."""
        return cast("Floats", lapack.dpotrs(self._lower, right, lower=1)[0])

    def inverse(self) -> Floats:
        """(n, n), exactly symmetric."""
        half = cast("Floats", lapack.dpotri(self._lower, lower=1)[0])
        whole = half + half.T  # above the diagonal of `half` stand the zeros of the factor
        np.fill_diagonal(whole, half.diagonal())
        return whole


class DenseStack:
    """Where the entries of groups of rows stand in one dense Jacobian.

    Parameters
    ----------
    columns
        (n, k) unknowns of the rows of each group.
    jacobians
        (n, r, k) of each group.
    size
        Number of unknowns.
    """

    def __init__(self, columns: Sequence[Ints], jacobians: Sequence[Floats], size: int) -> None:
        self._columns, self._shapes = columns, [one.shape for one in jacobians]
        entry, first = [np.zeros(0, dtype=np.int64)], 0
        for own, (n, r, _) in zip(columns, self._shapes, strict=True):
            row = first + np.arange(n * r).reshape(n, r, 1)
            entry.append((row * size + own[:, None, :]).ravel())
            first += n * r
        self._entry, self._shape = np.concatenate(entry), (first, size)

    def serves(self, columns: Sequence[Ints], jacobians: Sequence[Floats]) -> bool:
        """Whether these groups are like those that it was made for."""
        return self._shapes == [one.shape for one in jacobians] and all(
            mine is theirs or np.array_equal(mine, theirs)
            for mine, theirs in zip(self._columns, columns, strict=True)
        )

    def jacobian(self, jacobians: Sequence[Floats]) -> Floats:
        """(rows, size) the whitened Jacobian of all groups; duplicate entries are added."""
        entries = np.concatenate([np.zeros(0), *(one.ravel() for one in jacobians)])
        rows, size = self._shape
        flat = np.bincount(self._entry, entries, minlength=rows * size)
        return np.asarray(flat, dtype=np.float64).reshape(rows, size)
