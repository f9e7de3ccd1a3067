"""Sparse Cholesky factorisation by dense fronts, with the selected inverse.

Duff and Reid 1983, "The multifrontal solution of indefinite sparse symmetric linear equations";
the inverse on the pattern of the factor after Takahashi, Fagan and Chen 1973, front by front.
Each front is a few dense BLAS calls, so a survey of thousands of frames costs a few hundred.
"""

from __future__ import annotations

import numpy as np
from scipy.linalg import blas, lapack

from uavgram.estimation.solver.sparse.block_matrix import BlockMatrix
from uavgram.estimation.solver.sparse.fronts import Front, Ordering
from uavgram.model.arrays import Floats


class NotPositiveError(ValueError):
    """The matrix is not positive definite; `index` is an unknown without information."""

    def __init__(self, index: int) -> None:
        self.index = index
        super().__init__(f"no information on unknown {index}")


class Multifrontal:
    """Cholesky factor of one matrix.

    Parameters
    ----------
    matrix
        Symmetric positive definite, on the pattern of `ordering`.
    ordering
        From the same pattern.
    smallest
        Pivot below which an unknown counts as undetermined.

    Raises
    ------
    NotPositiveError
    """

    def __init__(self, matrix: BlockMatrix, ordering: Ordering, smallest: float) -> None:
        self._ordering = ordering
        self._lower: list[Floats] = []
        self._below: list[Floats] = []
        self._factorise(ordering.values(matrix), smallest)

    def _factorise(self, values: Floats, smallest: float) -> None:
        """Only the upper triangle of a front holds; in Fortran's order that is the lower one.

        Fronts come in postorder, so that what waits for a parent lies on top of a stack (Duff and
        Reid 1983). Two stacks take turns from one level of the tree to the next: what a front hands
        on grows in its place on one while that of its children lies on the other.
        """
        fronts = self._ordering.fronts
        room = np.empty(max(front.own * front.size for front in fronts))
        stacks = [np.empty(size) for size in self._ordering.stacks]
        top = [0, 0]
        waiting: list[list[Front]] = [[], []]
        for position, front in enumerate(fronts):
            own, boundary, turn = front.own, len(front.boundary), front.level % 2
            flat = room[: own * front.size]
            flat[:] = 0.0
            flat[front.flat] = values[front.source]
            rows = flat.reshape(own, front.size)
            corner = _square(stacks[turn], top[turn], boundary)
            corner[:] = 0.0
            children = waiting[1 - turn]
            while children and children[-1].parent == position:
                child = children.pop()
                top[1 - turn] -= len(child.boundary) ** 2
                update = _square(stacks[1 - turn], top[1 - turn], len(child.boundary))
                _extend(rows, corner, child, update)
            lower = self._pivots(front, rows[:, :own], smallest)
            below = rows[:, own:].copy().T
            if own and boundary:
                below = blas.dtrsm(1.0, lower, below, side=1, lower=1, trans_a=1, overwrite_b=1)
                blas.dsyrk(-1.0, below, beta=1.0, c=corner.T, lower=1, overwrite_c=1)
            self._lower.append(lower)
            self._below.append(below)
            waiting[turn].append(front)
            top[turn] += boundary**2

    def _pivots(self, front: Front, dense: Floats, smallest: float) -> Floats:
        if not len(dense):
            return dense
        lower, info = lapack.dpotrf(dense.T, lower=1, clean=1)
        pivots = np.diag(lower) ** 2
        failed = info - 1 if info > 0 else int(np.argmin(pivots))
        if info > 0 or pivots[failed] < smallest:
            raise NotPositiveError(int(self._ordering.order[front.first + failed]))
        return np.asarray(lower)

    def log_determinant(self) -> float:
        """Natural logarithm of the determinant of the matrix."""
        return 2.0 * sum(float(np.log(np.diag(lower)).sum()) for lower in self._lower if len(lower))

    def solve(self, right: Floats) -> Floats:
        """Solve for (n, m) right-hand sides."""
        x = right[self._ordering.order]
        fronts = list(zip(self._ordering.fronts, self._lower, self._below, strict=True))
        for front, lower, below in fronts:
            if front.own:
                own = slice(front.first, front.first + front.own)
                x[own] = lapack.dtrtrs(lower, x[own], lower=1)[0]
                x[front.boundary] -= below @ x[own]
        for front, lower, below in reversed(fronts):
            if front.own:
                own = slice(front.first, front.first + front.own)
                later = x[own] - below.T @ x[front.boundary]
                x[own] = lapack.dtrtrs(lower, later, lower=1, trans=1)[0]
        solution: Floats = np.empty_like(x)
        solution[self._ordering.order] = x
        return solution

    def inverse_on_pattern(self) -> BlockMatrix:
        """Symmetric inverse on the pattern of the matrix."""
        fronts = self._ordering.fronts
        values = np.empty(self._ordering.stored)
        pending = np.bincount([f.parent for f in fronts if f.parent >= 0], minlength=len(fronts))
        dense: dict[int, Floats] = {}
        for position in range(len(fronts) - 1, -1, -1):
            front = fronts[position]
            later = np.empty((0, 0))
            if len(front.boundary):
                later = dense[front.parent][front.in_parent].take(front.in_parent, axis=1)
            rows = self._inverse_rows(position, later)
            values[front.source] = rows.ravel()[front.flat]
            if pending[position]:
                dense[position] = np.block([[rows], [rows[:, front.own :].T, later]])
            if front.parent >= 0:
                pending[front.parent] -= 1
                if not pending[front.parent]:
                    del dense[front.parent]
        return self._ordering.matrix(values)

    def _inverse_rows(self, position: int, later: Floats) -> Floats:
        """Own rows (own, own + boundary) of a front's inverse, from that among its boundary."""
        front = self._ordering.fronts[position]
        below, own = self._below[position], front.own
        inverse = np.empty((own, front.size))
        if own:
            root = lapack.dtrtri(self._lower[position], lower=1)[0]
            inverse[:, :own] = root.T @ root
            if len(below):
                gain = root.T @ below.T
                inverse[:, own:] = -gain @ later
                inverse[:, :own] -= inverse[:, own:] @ gain.T
        return inverse


def _square(stack: Floats, start: int, size: int) -> Floats:
    return stack[start : start + size**2].reshape(size, size)


def _extend(rows: Floats, corner: Floats, child: Front, update: Floats) -> None:
    """Add a child's update to its parent's front, run by run of neighbouring unknowns."""
    own = len(rows)
    for i, (start, end, to) in enumerate(child.runs):
        into, row, first = (rows, to, 0) if to < own else (corner, to - own, own)
        for left, right, column in child.runs[i:]:
            place = into[row : row + end - start, column - first : column - first + right - left]
            place += update[start:end, left:right]
