"""Solve many small symmetric systems at once.

Where thousands of systems are solved together, the number of the system is the last axis: one row
of all systems is one array operation, so that nothing but arithmetic remains. LAPACK takes ten
times as long for them, one after the other.
"""

from __future__ import annotations

import numpy as np

from uavgram.model.arrays import Floats

MANY = 40
"""Systems from which on they are solved together rather than one after the other by LAPACK."""


def cholesky(matrix: Floats) -> Floats:
    """Factor positive definite matrices (n, n, B) into L L^T; NaN where one is not.

    Above the diagonal the result holds zeros.
    """
    size = len(matrix)
    lower = np.zeros_like(matrix)
    with np.errstate(invalid="ignore", divide="ignore"):
        for j in range(size):
            known = lower[j, :j]
            lower[j, j] = np.sqrt(matrix[j, j] - np.einsum("kb,kb->b", known, known))
            if j + 1 < size:
                rest = matrix[j + 1 :, j] - np.einsum("ikb,kb->ib", lower[j + 1 :, :j], known)
                lower[j + 1 :, j] = rest / lower[j, j]
    return lower


def forward(lower: Floats, right: Floats) -> Floats:
    """Solve ``L x = right`` for (n, n, B) lower factors and (n, ..., B) right-hand sides."""
    out = np.empty_like(right)
    for i in range(len(lower)):
        rest = right[i].copy()
        for k in range(i):
            rest -= lower[i, k] * out[k]
        out[i] = rest / lower[i, i]
    return out


def backward(lower: Floats, right: Floats) -> Floats:
    """Solve ``L^T x = right`` for (n, n, B) lower factors and (n, ..., B) right-hand sides."""
    out = np.empty_like(right)
    for i in range(len(lower) - 1, -1, -1):
        rest = right[i].copy()
        for k in range(i + 1, len(lower)):
            rest -= lower[k, i] * out[k]
        out[i] = rest / lower[i, i]
    return out


def solve_each(matrix: Floats, right: Floats) -> Floats:
    """Solve B systems of n unknowns: (B, n, n), (B, n) -> (B, n).

    Parameters
    ----------
    matrix
        (B, n, n) positive definite.
    right
        (B, n).
    """
    if len(matrix) < MANY:
        return np.asarray(np.linalg.solve(matrix, right[..., None])[..., 0])
    lower = cholesky(np.ascontiguousarray(np.moveaxis(matrix, 0, -1)))
    return np.asarray(backward(lower, forward(lower, np.ascontiguousarray(right.T))).T)
