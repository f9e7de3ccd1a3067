"""Factorisation of a survey's normal matrix: points first, then frames by nested dissection.

Points that no length joins to another see only frames and what all share: they are eliminated by
their own small blocks (Schur complement; Brown 1958 for photogrammetry). What is left, frames,
points with lengths and the shared border, goes to the multifrontal factorisation. Of the inverse
only the pattern of the normal matrix is computed.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from uavgram.estimation.multifrontal import Multifrontal, NotPositiveError, Ordering
from uavgram.model.arrays import Floats, Ints


@dataclass(frozen=True)
class Structure:
    """What the unknowns are, in their order: points, then blocks, then what all share.

    Attributes
    ----------
    size
        Number of unknowns.
    points, point_size
        The first points * point_size unknowns.
    block_size
        Unknowns of a frame.
    first_shared
        From here on, unknowns that many observations have in common.
    """

    size: int
    points: int
    point_size: int
    block_size: int
    first_shared: int

    @classmethod
    def plain(cls, size: int) -> Structure:
        """Nothing is known: every unknown stands for itself."""
        return cls(size=size, points=0, point_size=1, block_size=1, first_shared=size)


class Symbolic:
    """Everything about a sparse system that its values do not change.

    Parameters
    ----------
    jacobian
        Sparse Jacobian; only its pattern is used. Values would hide products that cancel to zero,
        and the inverse has no zero there.
    structure
        What the unknowns are.
    """

    def __init__(self, jacobian: sp.csr_matrix, structure: Structure) -> None:
        ones = sp.csr_matrix(
            (np.ones(jacobian.nnz), jacobian.indices, jacobian.indptr), shape=jacobian.shape
        )
        self.pattern = (ones.T @ ones).tocsr()
        self.pattern.sort_indices()
        self.structure = structure
        points, size = structure.points, structure.point_size
        alone = self._alone()
        self.eliminated = (alone[:, None] * size + np.arange(size)).ravel()
        joined = np.setdiff1d(np.arange(points), alone)
        joined_columns = (joined[:, None] * size + np.arange(size)).ravel()
        self.kept = np.concatenate([joined_columns, np.arange(points * size, structure.size)])
        self.blocks = np.concatenate(
            [np.repeat(np.arange(len(joined)), size), len(joined) + self._later_blocks()]
        ).astype(np.int64)
        self.coupling = self.pattern[self.eliminated][:, self.kept].tocsr()
        self.coupling.sort_indices()
        reduced = self.pattern[self.kept][:, self.kept]
        if len(self.eliminated):  # the rows of a point's unknowns see the same columns
            once = self.coupling[::size]
            reduced = reduced + once.T @ once
        self.reduced = reduced.tocsr()
        self.ordering = Ordering(self.reduced, self.blocks, structure.size - structure.first_shared)

    def _alone(self) -> Ints:
        """Points that share observations with no other point."""
        points, size = self.structure.points, self.structure.point_size
        among = self.pattern[: points * size, : points * size].tocoo()
        one, other = among.row // size, among.col // size
        return np.setdiff1d(np.arange(points), one[one != other])

    def _later_blocks(self) -> Ints:
        first = self.structure.points * self.structure.point_size
        return (np.arange(first, self.structure.size) - first) // self.structure.block_size


class SparseFactor:
    """Factor of one scaled normal matrix (unit diagonal, plus damping).

    Raises
    ------
    NotPositiveError
        An unknown is not determined; its index is that of the whole system.
    """

    def __init__(self, scaled: sp.csr_matrix, symbolic: Symbolic, smallest: float) -> None:
        self._symbolic = symbolic
        out, kept, size = symbolic.eliminated, symbolic.kept, symbolic.structure.point_size
        coupling = scaled[out][:, kept]
        self._blocks = _diagonal_blocks(scaled, out, size)
        self._inverse = _inverse_blocks(self._blocks, out, smallest)
        self._gain = (_block_diagonal(self._inverse) @ coupling).tocsr()
        reduced = (scaled[kept][:, kept] - coupling.T @ self._gain).tocsr()
        try:
            self._front = Multifrontal(reduced, symbolic.ordering, smallest)
        except NotPositiveError as error:
            raise NotPositiveError(int(kept[error.index])) from None

    def solve(self, right: Floats) -> Floats:
        """Solve for (n, m) right-hand sides."""
        out, kept = self._symbolic.eliminated, self._symbolic.kept
        solution = np.empty_like(right)
        solution[kept] = self._front.solve(right[kept] - self._gain.T @ right[out])
        own = self._inverse @ right[out].reshape(*self._inverse.shape[:2], right.shape[1])
        solution[out] = own.reshape(len(out), right.shape[1]) - self._gain @ solution[kept]
        return solution

    def inverse_on_pattern(self) -> sp.csr_matrix:
        """Symmetric inverse on the pattern of the normal matrix."""
        symbolic = self._symbolic
        out, kept = symbolic.eliminated, symbolic.kept
        reduced = self._front.inverse_on_pattern(symbolic.reduced)
        reduced.sum_duplicates()  # sorted rows: entries are found by bisection
        coupling, own = self._eliminated_part(reduced)
        size, whole = symbolic.structure.size, []
        for rows, columns, part in (
            (kept, kept, reduced),
            (out, kept, coupling),
            (kept, out, coupling.T),
            (out, out, own),
        ):
            entries = part.tocoo()
            whole.append((entries.data, rows[entries.row], columns[entries.col]))
        data, row, column = (np.concatenate(parts) for parts in zip(*whole, strict=True))
        inverse = sp.csr_matrix((data, (row, column)), shape=(size, size))
        inverse.sort_indices()
        return inverse

    def _eliminated_part(self, reduced: sp.csr_matrix) -> tuple[sp.csr_matrix, sp.csr_matrix]:
        """Covariances of the eliminated points with the kept unknowns, and of their own.

        With G = A^-1 B: S_pc = -G S_cc, S_pp = A^-1 + G S_cc G^T, point by point, in batches of
        points that see equally many kept unknowns.
        """
        pattern, size = self._symbolic.coupling, self._symbolic.structure.point_size
        data, own = np.zeros(pattern.nnz), self._inverse.copy()
        gain = _on_pattern(self._gain, pattern)
        width = np.diff(pattern.indptr)[::size]
        for count in np.unique(width):
            points = np.flatnonzero(width == count)
            if not count:
                continue
            entries = pattern.indptr[points * size][:, None, None] + (
                np.arange(size)[:, None] * count + np.arange(count)
            )
            columns = pattern.indices[entries[:, 0]]
            joint = gather_blocks(reduced, columns)
            mine = gain[entries]
            mixed = -mine @ joint
            data[entries] = mixed
            own[points] -= mixed @ np.swapaxes(mine, 1, 2)
        coupling = sp.csr_matrix((data, pattern.indices, pattern.indptr), shape=pattern.shape)
        return coupling, _block_diagonal(own)


def gather_blocks(matrix: sp.csr_matrix, columns: Ints) -> Floats:
    """(n, k, k) dense parts of a sparse matrix, rows and columns given as (n, k) indices."""
    n, k = columns.shape
    values = np.empty((n, k, k))
    step = max(1, 2_000_000 // max(k * k, 1))
    for start in range(0, n, step):
        part = columns[start : start + step]
        rows = np.repeat(part, k, axis=1).ravel()
        cols = np.tile(part, (1, k)).ravel()
        values[start : start + step] = np.asarray(matrix[rows, cols]).reshape(-1, k, k)
    return values


def _on_pattern(matrix: sp.csr_matrix, pattern: sp.csr_matrix) -> Floats:
    """Values of a matrix at the entries of a pattern that contains its own."""
    if matrix.nnz == pattern.nnz:
        matrix.sort_indices()
        return np.asarray(matrix.data)
    rows = np.repeat(np.arange(pattern.shape[0]), np.diff(pattern.indptr))
    return np.asarray(matrix[rows, pattern.indices]).ravel()


def _diagonal_blocks(matrix: sp.csr_matrix, index: Ints, size: int) -> Floats:
    """(n, size, size) diagonal blocks of the rows in `index`, n * size of them."""
    block = index.reshape(-1, size)
    return gather_blocks(matrix, block)


def _inverse_blocks(blocks: Floats, index: Ints, smallest: float) -> Floats:
    size = blocks.shape[1]
    value = np.linalg.eigvalsh(blocks)[:, 0] if len(blocks) else np.ones(1)
    worst = int(np.argmin(value))
    if value[worst] < smallest:
        raise NotPositiveError(int(index[worst * size]))
    return np.asarray(np.linalg.inv(blocks), dtype=np.float64) if len(blocks) else blocks


def _block_diagonal(blocks: Floats) -> sp.csr_matrix:
    n, size = blocks.shape[:2]
    columns = np.arange(n * size).reshape(n, 1, size).repeat(size, axis=1)
    indptr = np.arange(n * size + 1) * size
    return sp.csr_matrix((blocks.ravel(), columns.ravel(), indptr), shape=(n * size, n * size))
