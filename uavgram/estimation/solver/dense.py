"""The Cholesky factor of a small system.

LAPACK's own functions, on matrices in its own order: the wrappers of scipy.linalg look at every
number and copy each matrix, which takes as long again as factoring some hundred unknowns.
"""

from __future__ import annotations

from typing import cast

import numpy as np
from scipy.linalg import lapack

from uavgram.estimation.solver.sparse.multifrontal import NotPositiveError
from uavgram.model.arrays import Floats


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
