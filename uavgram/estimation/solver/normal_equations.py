"""Normal equations of a least-squares problem: factorisation and covariance.

LAPACK's functions are called directly, on matrices in its own memory order: the wrappers of
scipy.linalg check every number and copy each matrix, which takes as long again as factoring some
hundred unknowns.

Small systems are dense. Larger ones are sparse, and only the requested parts of their inverse are
computed: the part on the pattern of the normal matrix (each unknown with those it shares an
observation with), and the joint covariance of a few chosen unknowns. Assembly multiplies all rows
of one kind at once, O(rows * k^2) for rows of k unknowns: no library assembles blocks by batch.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar, cast
from weakref import WeakKeyDictionary, WeakValueDictionary

import numpy as np
from scipy.linalg import lapack
from scipy.sparse import csc_array, csr_array

from uavgram.estimation.solver.sparse.block_matrix import Assembly, BlockMatrix, Structure
from uavgram.estimation.solver.sparse.cholesky import NotPositiveError, SparseFactor, Symbolic
from uavgram.model.arrays import Floats, Ints


class DenseFactor:
    """Factor L L^T of a symmetric matrix with a diagonal of one or slightly more.

    Parameters
    ----------
    matrix
        (n, n) in C order; it is overwritten.
    smallest
        Pivot below which an unknown is not determined.

    Raises
    ------
    NotPositiveError
        An unknown is not determined; `index` is the first one found.
    """

    def __init__(self, matrix: Floats, smallest: float) -> None:
        # The transpose of a symmetric matrix is the matrix itself, in LAPACK's memory order.
        lower, fault = lapack.dpotrf(matrix.T, lower=1, clean=1)
        if fault:
            _, vectors = np.linalg.eigh(matrix)
            raise NotPositiveError(int(np.argmax(np.abs(vectors[:, 0]))))
        self._lower = cast("Floats", lower)
        self._pivot = lower.diagonal()
        if self._pivot.min() ** 2 < smallest:
            raise NotPositiveError(int(np.argmin(self._pivot)))

    def log_determinant(self) -> float:
        """Return the natural logarithm of the determinant of the matrix."""
        return 2.0 * float(np.log(self._pivot).sum())

    def solve(self, right: Floats) -> Floats:
        """Solve for one (n,) or several (n, m) right-hand sides."""
        return cast("Floats", lapack.dpotrs(self._lower, right, lower=1)[0])

    def inverse(self) -> Floats:
        """Compute the (n, n) inverse, exactly symmetric."""
        half = cast("Floats", lapack.dpotri(self._lower, lower=1)[0])
        whole = half + half.T  # `half` has the zeros of the factor above its diagonal
        np.fill_diagonal(whole, half.diagonal())
        return whole


class DenseStack:
    """Positions of the entries of groups of rows in one dense Jacobian.

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
        """Return whether these groups have the shapes and columns that it was made for."""
        return self._shapes == [one.shape for one in jacobians] and all(
            mine is theirs or np.array_equal(mine, theirs)
            for mine, theirs in zip(self._columns, columns, strict=True)
        )

    def jacobian(self, jacobians: Sequence[Floats]) -> Floats:
        """Assemble the (rows, size) whitened Jacobian of all groups, adding duplicate entries."""
        entries = np.concatenate([np.zeros(0), *(one.ravel() for one in jacobians)])
        rows, size = self._shape
        flat = np.bincount(self._entry, entries, minlength=rows * size)
        return np.asarray(flat, dtype=np.float64).reshape(rows, size)


MAX_DENSE_ENTRIES = 250_000
"""Number of entries of a Jacobian up to which a dense one costs less than the overhead of sparse
matrices."""

MAX_RIGHT_SIDES = 32
"""Number of right-hand sides that are solved for together."""

MAX_ROWS_AT_ONCE = 2000
"""Number of rows whose covariances are gathered together."""

MIN_PIVOT = 1e-13
"""Smallest pivot of the scaled normal matrix (unit diagonal) that still contains information."""


class SingularError(ValueError):
    """Unknown that the observations leave undetermined; `index` is the first one found."""

    def __init__(self, index: int) -> None:
        self.index = index
        super().__init__(f"unknown {index} is not determined by the observations")


@dataclass(frozen=True, eq=False)
class Block:
    """Rows of a whitened observation group.

    Attributes
    ----------
    residual
        (n, r) whitened: unit variance if the model holds. For many states at once, (..., n, r).
    columns
        (n, k) index of the unknown of each Jacobian column.
    jacobian
        (n, r, k), or (..., n, r, k).
    """

    residual: Floats
    columns: Ints
    jacobian: Floats

    def multiply_transposed(self, along: Floats) -> Floats:
        """Multiply (..., n, r) by the Jacobian, to (..., n, k): J^T v, row by row."""
        return (along[..., None, :] @ self.jacobian)[..., 0, :]

    def sparse(self, size: int) -> csr_array:
        """Return the (n r, size) Jacobian by all unknowns."""
        n, r, k = self.jacobian.shape
        column = np.repeat(self.columns, r, axis=0)
        begin = np.arange(0, n * r * k + 1, k)
        return csr_array((self.jacobian.ravel(), column.ravel(), begin), (n * r, size))

    def times(self, rows: slice, several: Floats) -> Floats:
        """Multiply some rows of the Jacobian by (size, m) columns, to (n, r, m).

        Unknowns that all these rows share are multiplied at once; only the others are gathered row
        by row.
        """
        columns, jacobian = self.columns[rows], self.jacobian[rows]
        n, r, _ = jacobian.shape
        common = (columns == columns[:1]).all(axis=0)
        found = jacobian[..., ~common] @ several[columns[:, ~common]]
        if n and common.any():
            shared = (
                jacobian[..., common].reshape(n * r, int(common.sum()))
                @ several[columns[0, common]]
            )
            found += shared.reshape(found.shape)
        return np.asarray(found)


class NormalEquations:
    """Normal matrix J^T J and gradient J^T r of a list of blocks, over `size` unknowns.

    Parameters
    ----------
    blocks
        Observations.
    size
        Number of unknowns.
    structure
        Structure of the unknowns; used in large systems.
    plan
        Plan of an earlier system with the same columns, to be reused.
    """

    def __init__(
        self,
        blocks: list[Block],
        size: int,
        structure: Structure | None = None,
        plan: Plan | DenseStack | None = None,
    ) -> None:
        self.size = size
        self._blocks = blocks
        self.gradient = compute_gradient(blocks, size)
        rows = sum(b.residual.size for b in blocks)
        self.is_dense = rows * size <= MAX_DENSE_ENTRIES
        self._structure = structure or Structure.plain(size)
        self.plan = plan

    @cached_property
    def cost(self) -> float:
        """Weighted sum of squared residuals."""
        return compute_cost(self._blocks)

    @cached_property
    def normal(self) -> Floats | BlockMatrix:
        """Normal matrix J^T J."""
        columns = [b.columns for b in self._blocks]
        jacobians = [b.jacobian for b in self._blocks]
        if self.is_dense:
            if not isinstance(self.plan, DenseStack) or not self.plan.serves(columns, jacobians):
                self.plan = DenseStack(columns, jacobians, self.size)
            jacobian = self.plan.jacobian(jacobians)
            return np.asarray(jacobian.T @ jacobian)
        if not isinstance(self.plan, Plan) or not self.plan.assembly.serves(columns):
            self.plan = Plan.of(columns, self._structure)
        return self.plan.assembly.normal(jacobians)

    def factor(self, damping: float = 0.0, slack: float = 0.0) -> Factor:
        """Factor J^T J + damping * diag(J^T J).

        Parameters
        ----------
        damping
            Damping as a share of the diagonal.
        slack
            Added to the damping if the matrix is singular.

        Raises
        ------
        SingularError
            An unknown is not determined.
        """
        diagonal = self.normal.diagonal()
        empty = np.flatnonzero(diagonal <= 0)
        if empty.size:
            raise SingularError(int(empty[0]))
        plan = self.plan if isinstance(self.plan, Plan) else None
        try:
            return Factor(self.normal, plan, diagonal, damping)
        except SingularError:
            if not slack:
                raise
            return Factor(self.normal, plan, diagonal, damping + slack)


class Plan:
    """Assembly and symbolic factorisation, common to all large systems with the same columns."""

    _recent: ClassVar[WeakValueDictionary[object, Plan]] = WeakValueDictionary()

    @classmethod
    def of(cls, columns: list[Ints], structure: Structure) -> Plan:
        """Return the plan of an earlier system whose factor is still held, or a new one.

        Different starts of one survey, and the survey with other sigmas, have the same columns.
        """
        shape = structure, *(own.shape for own in columns)
        plan = cls._recent.get(shape)
        if plan is None or not plan.assembly.serves(columns):
            plan = cls._recent[shape] = cls(columns, structure)
        return plan

    def __init__(self, columns: list[Ints], structure: Structure) -> None:
        self.assembly = Assembly(columns, structure)

    @cached_property
    def symbolic(self) -> Symbolic:
        """Symbolic factorisation."""
        return Symbolic(self.assembly.pattern)


def compute_cost(blocks: Iterable[Block]) -> float:
    """Compute the weighted sum of squared residuals."""
    return float(sum(np.vdot(b.residual, b.residual) for b in blocks))


def compute_gradient(blocks: Iterable[Block], size: int) -> Floats:
    """Compute J^T r of all blocks, (..., size), with the leading axes of the residuals, if any."""
    gradient = np.zeros(size)
    for block in blocks:
        gradient = gradient + sum_by_unknown(
            block.columns, block.multiply_transposed(block.residual), size
        )
    return gradient


def sum_by_unknown(columns: Ints, product: Floats, size: int) -> Floats:
    """Sum (..., size) contributions by unknown.

    Parameters
    ----------
    columns, product
        (n, k) unknowns, and (..., n, k) contributions of each row to its own.
    size
        Number of unknowns.
    """
    many, at = product.shape[:-2], columns.ravel()
    if not many:
        return cast("Floats", np.bincount(at, product.ravel(), minlength=size))
    count = math.prod(many)
    at = (size * np.arange(count)[:, None] + at).ravel()
    found = np.bincount(at, product.ravel(), minlength=size * count)
    return cast("Floats", found.reshape(*many, size))


class Factor:
    """Factorised, symmetrically scaled normal matrix.

    The scaling to a unit diagonal makes the test for zero pivots independent of the units (pixels,
    radians, metres).
    """

    def __init__(
        self, normal: Floats | BlockMatrix, plan: Plan | None, diagonal: Floats, damping: float
    ) -> None:
        self._scale = 1.0 / np.sqrt(diagonal)
        self._damping = damping
        self._plan = plan  # kept for the next system of the same columns
        self.size = len(diagonal)
        self._factor: DenseFactor | SparseFactor
        try:
            if isinstance(normal, np.ndarray):
                scaled = normal * (self._scale[:, None] * self._scale)
                scaled.flat[:: self.size + 1] += damping
                self._factor = DenseFactor(scaled, MIN_PIVOT)
                return
            assert plan is not None  # noqa: S101  (it came with the block matrix)
            matrix = normal.scale_and_damp(self._scale, damping)
            self._factor = SparseFactor(matrix, plan.symbolic, MIN_PIVOT)
        except NotPositiveError as error:
            raise SingularError(error.index) from None

    @property
    def sparse(self) -> bool:
        """Return whether the system was large enough for the sparse factorisation."""
        return isinstance(self._factor, SparseFactor)

    def log_determinant(self) -> float:
        """Return the natural logarithm of the determinant of the (damped) normal matrix."""
        return self._factor.log_determinant() - 2.0 * float(np.log(self._scale).sum())

    def solve(self, right: Floats | csc_array) -> Floats:
        """Solve for one (n,) or several (n, m) right-hand sides; large systems a few at a time."""
        if isinstance(right, csc_array):
            return self._solve_sparse(right) if self.sparse else self.solve(right.toarray())
        scale = self._scale if right.ndim == 1 else self._scale[:, None]
        if not isinstance(self._factor, SparseFactor):
            return np.asarray(self._factor.solve(right * scale) * scale)
        columns = right.reshape(self.size, -1)
        found = np.empty(columns.shape)
        for start in range(0, columns.shape[1], MAX_RIGHT_SIDES):
            some = slice(start, start + MAX_RIGHT_SIDES)
            scaled = columns[:, some] * self._scale[:, None]
            found[:, some] = self._factor.solve(scaled) * self._scale[:, None]
        return found.reshape(right.shape)

    def _solve_sparse(self, right: csc_array) -> Floats:
        """Solve for sparse columns a few at a time: dense ones of many would fill the memory."""
        found = np.empty(right.shape)
        for start in range(0, right.shape[1], MAX_RIGHT_SIDES):
            some = slice(start, start + MAX_RIGHT_SIDES)
            found[:, some] = self.solve(right[:, some].toarray())
        return found

    def solve_among(self, columns: Ints, right: Floats) -> Floats:
        """Solve for right-hand sides (n, m) of n unknowns, zero elsewhere; return these n.

        The parts of a large survey that are elsewhere are left out of the computation.
        """
        found = np.empty(right.shape)
        for start in range(0, right.shape[1], MAX_RIGHT_SIDES):
            some = slice(start, start + MAX_RIGHT_SIDES)
            whole = np.zeros((self.size, right[:, some].shape[1]))
            whole[columns] = right[:, some] * self._scale[columns, None]
            if isinstance(self._factor, SparseFactor):
                solved = self._factor.solve(whole, columns)
            else:
                solved = self._factor.solve(whole)
            found[:, some] = solved[columns] * self._scale[columns, None]
        return found

    def predict_reduction(self, step: Floats, gradient: Floats) -> float:
        """Compute the reduction of the sum of squares by a solved step in the linear model.

        -2 g s - s N s, where (N + damping D) s = -g.
        """
        damped = self._damping * float(np.sum((step / self._scale) ** 2))
        return damped - float(step @ gradient)

    def joint(self, indices: Ints) -> Floats:
        """Compute the joint covariance (m, m) of m chosen unknowns."""
        return self.covariances(indices[:, None], np.ones((len(indices), 1)))

    def covariances(self, columns: Ints, gradients: Floats) -> Floats:
        """Compute the joint covariance (n, n) of linear functions, given as in `variances`."""
        joint = np.empty((len(columns), len(columns)))
        for some, _, solved in self._solve_columns(columns, gradients):
            joint[:, some] = np.einsum("nk,nkm->nm", gradients, solved[columns], optimize=True)
        return np.asarray(0.5 * (joint + joint.T))

    def variances(self, columns: Ints, gradients: Floats) -> Floats:
        """Compute variances (n,) of linear functions with gradients (n, k) by unknowns (n, k)."""
        found = np.empty(len(columns))
        for some, right, solved in self._solve_columns(columns, gradients):
            found[some] = np.sum(right * solved, axis=0)
        return found

    def _solve_columns(
        self, columns: Ints, gradients: Floats
    ) -> Iterator[tuple[slice, Floats, Floats]]:
        """Yield gradients as columns (size, m) and their solutions, a few functions at a time."""
        for start in range(0, len(columns), MAX_RIGHT_SIDES):
            some = slice(start, start + MAX_RIGHT_SIDES)
            at = (columns[some], np.arange(len(columns[some]))[:, None])
            right = np.zeros((self.size, len(columns[some])))
            np.add.at(right, at, gradients[some])  # a function may name an unknown twice
            yield some, right, self.solve(right)

    def covariance(self) -> Covariance:
        """Return the covariance between all unknowns that share an observation."""
        return Covariance(self)

    def inverse_on_pattern(self) -> Floats | BlockMatrix:
        """Compute the inverse of the normal matrix: whole, or on its pattern."""
        if isinstance(self._factor, SparseFactor):
            return self._factor.inverse_on_pattern().scale_and_damp(self._scale)
        return np.asarray(self._factor.inverse() * (self._scale[:, None] * self._scale))


class Covariance:
    """Covariance of the unknowns: whole, or on the pattern of the normal matrix.

    It is computed on the first request, and so is the leverage of each block.
    """

    def __init__(self, factor: Factor) -> None:
        self._factor = factor
        self._leverage: WeakKeyDictionary[Block, Floats] = WeakKeyDictionary()

    @cached_property
    def _inverse(self) -> Floats | BlockMatrix:
        return self._factor.inverse_on_pattern()

    def blocks(self, columns: Ints) -> Floats:
        """Return (n, k, k) covariances among n groups of k unknowns each, given as (n, k) indices.

        Raises
        ------
        LookupError
            In a large survey, unknowns of a group share no observation: see ``Factor.joint``.
        """
        if isinstance(self._inverse, np.ndarray):
            at = columns[:, :, None] * len(self._inverse) + columns[:, None, :]
            return self._inverse.ravel().take(at)  # takes half the time of two index arrays
        return self._inverse.gather(columns)

    def joint(self, columns: Ints, gradients: Floats) -> Floats:
        """Compute the joint covariance (n, n) of linear functions, as `Factor.covariances`.

        Functions of unknowns that all observations share need no further solution.
        """
        inverse = self._inverse
        if isinstance(inverse, BlockMatrix) and not inverse.pattern.structure.is_border(columns):
            return self._factor.covariances(columns, gradients)
        unknowns, place = np.unique(columns, return_inverse=True)
        whole = np.zeros((len(columns), len(unknowns)))
        np.add.at(whole, (np.arange(len(columns))[:, None], place), gradients)
        return np.asarray(whole @ self.blocks(unknowns[None])[0] @ whole.T)

    def leverage(self, block: Block) -> Floats:
        """Compute (n, r) leverages of a block: shares of residuals absorbed by the unknowns."""
        if block not in self._leverage:
            found = np.empty(block.residual.shape)
            for start in range(0, len(found), MAX_ROWS_AT_ONCE):
                part = slice(start, start + MAX_ROWS_AT_ONCE)
                jacobian = block.jacobian[part]
                joint = self.blocks(block.columns[part])
                # Diagonal of A S A^T.
                found[part] = np.einsum("nrk,nrk->nr", jacobian @ joint, jacobian)
            self._leverage[block] = found
        return self._leverage[block]
