"""Normal equations of a sparse least-squares problem: factorisation and covariance.

Small systems are dense; larger ones stay sparse, and of their inverse only what is asked for is
ever computed: the part on the pattern of the normal matrix (each unknown with those it shares an
observation with), and the joint covariance of a few chosen unknowns.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.linalg
import scipy.sparse as sp

from uavgram.estimation.multifrontal import NotPositiveError
from uavgram.estimation.sparse_factor import SparseFactor, Structure, Symbolic, gather_blocks
from uavgram.model.arrays import Floats, Ints

DENSE_LIMIT = 2500
"""Unknowns up to which a dense Cholesky beats the sparse factorisation."""

SINGULAR = 1e-13
"""Smallest pivot of the scaled normal matrix (unit diagonal) that still carries information."""


class SingularError(ValueError):
    """The observations leave an unknown undetermined; `index` is the first one found."""

    def __init__(self, index: int) -> None:
        self.index = index
        super().__init__(f"unknown {index} is not determined by the observations")


@dataclass(frozen=True, eq=False)
class Block:
    """Rows of a whitened observation group.

    Attributes
    ----------
    residual
        (n, r) whitened: unit variance where the model holds.
    columns
        (n, k) index of the unknown behind each Jacobian column.
    jacobian
        (n, r, k).
    """

    residual: Floats
    columns: Ints
    jacobian: Floats


class NormalEquations:
    """J^T J and J^T r of a list of blocks, over `size` unknowns."""

    def __init__(
        self,
        blocks: list[Block],
        size: int,
        structure: Structure | None = None,
        symbolic: Symbolic | None = None,
    ) -> None:
        self.size = size
        self._structure = structure or Structure.plain(size)
        self._symbolic = symbolic
        self.jacobian = _stack(blocks, size)
        residual = np.concatenate([b.residual.ravel() for b in blocks])
        self.cost = float(residual @ residual)
        self.gradient = self.jacobian.T @ residual
        self.normal = (self.jacobian.T @ self.jacobian).tocsr()
        self.diagonal = self.normal.diagonal()

    def factor(self, damping: float = 0.0) -> Factor:
        """Factor J^T J + damping * diag(J^T J).

        Raises
        ------
        SingularError
            An unknown is not determined.
        """
        empty = np.flatnonzero(self.diagonal <= 0)
        if empty.size:
            raise SingularError(int(empty[0]))
        return Factor(self.normal, self.symbolic(), self.diagonal, damping)

    def symbolic(self) -> Symbolic | None:
        """What serves every system of the same pattern; None where the system is small."""
        if self._symbolic is None and self.size > DENSE_LIMIT:
            self._symbolic = Symbolic(self.jacobian, self._structure)
        return self._symbolic


def _stack(blocks: list[Block], size: int) -> sp.csr_matrix:
    """Whitened Jacobian of all blocks as one sparse matrix; duplicate entries are added."""
    data, columns, lengths = [], [], []
    for block in blocks:
        n, r, k = block.jacobian.shape
        data.append(block.jacobian.ravel())
        columns.append(np.broadcast_to(block.columns[:, None, :], (n, r, k)).ravel())
        lengths.append(np.full(n * r, k))
    indptr = np.concatenate([[0], np.cumsum(np.concatenate(lengths))])
    matrix = sp.csr_matrix(
        (np.concatenate(data), np.concatenate(columns), indptr), shape=(len(indptr) - 1, size)
    )
    matrix.sum_duplicates()
    return matrix


class Factor:
    """A factorised, symmetrically scaled normal matrix.

    The scaling to a unit diagonal takes the units (pixels, radians, metres) out of the question
    whether a pivot is zero.
    """

    def __init__(
        self, normal: sp.csr_matrix, symbolic: Symbolic | None, diagonal: Floats, damping: float
    ) -> None:
        self._scale = 1.0 / np.sqrt(diagonal)
        scaled = sp.diags(self._scale) @ normal @ sp.diags(self._scale)
        scaled = (scaled + damping * sp.identity(len(diagonal))).tocsr()
        self.size = len(diagonal)
        self._dense: Floats | None = None
        self._sparse: SparseFactor | None = None
        if symbolic is None:
            self._dense = _cholesky(scaled.toarray())
        else:
            try:
                self._sparse = SparseFactor(scaled, symbolic, SINGULAR)
            except NotPositiveError as error:
                raise SingularError(error.index) from None

    def solve(self, right: Floats) -> Floats:
        """Solve for one (n,) or several (n, m) right-hand sides."""
        scale = self._scale if right.ndim == 1 else self._scale[:, None]
        if self._dense is not None:
            y = scipy.linalg.cho_solve((self._dense, True), right * scale, check_finite=False)
        else:
            assert self._sparse is not None  # noqa: S101  (one of the two is always there)
            scaled = np.ascontiguousarray(right * scale)
            y = self._sparse.solve(scaled.reshape(self.size, -1)).reshape(right.shape)
        return np.asarray(y * scale)

    def joint(self, indices: Ints) -> Floats:
        """Joint covariance (m, m) of m chosen unknowns."""
        right = np.zeros((self.size, len(indices)))
        right[indices, np.arange(len(indices))] = 1.0
        block = self.solve(right)[indices]
        return np.asarray(0.5 * (block + block.T))

    def covariance(self) -> Covariance:
        """Covariance between all unknowns that share an observation."""
        if self._dense is not None:
            inverse = self.solve(np.eye(self.size))
            return Covariance(dense=0.5 * (inverse + inverse.T), selected=None)
        assert self._sparse is not None  # noqa: S101  (one of the two is always there)
        scale = sp.diags(self._scale)
        selected = (scale @ self._sparse.inverse_on_pattern() @ scale).tocsr()
        selected.sum_duplicates()  # sorted rows: entries are found by bisection
        return Covariance(dense=None, selected=selected)


@dataclass(frozen=True, eq=False)
class Covariance:
    """Covariance of the unknowns: whole (dense), or on the pattern of the normal matrix."""

    dense: Floats | None
    selected: sp.csr_matrix | None

    def blocks(self, columns: Ints) -> Floats:
        """(n, k, k) covariances among n groups of k unknowns each, given as (n, k) indices.

        With a selected inverse, all unknowns of a group must share observations.
        """
        if self.dense is not None:
            rows = np.broadcast_to(columns[:, :, None], (*columns.shape, columns.shape[1]))
            return np.asarray(self.dense[rows, np.swapaxes(rows, 1, 2)])
        assert self.selected is not None  # noqa: S101  (one of the two is always there)
        return gather_blocks(self.selected, columns)


def _cholesky(scaled: Floats) -> Floats:
    try:
        lower = scipy.linalg.cholesky(scaled, lower=True, check_finite=False)
    except scipy.linalg.LinAlgError:
        _, vectors = np.linalg.eigh(scaled)
        raise SingularError(int(np.argmax(np.abs(vectors[:, 0])))) from None
    pivots = np.diag(lower) ** 2
    if pivots.min() < SINGULAR:
        raise SingularError(int(np.argmin(pivots)))
    return np.asarray(lower)
