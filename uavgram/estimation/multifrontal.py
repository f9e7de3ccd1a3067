"""Sparse Cholesky factorisation by dense fronts, with the selected inverse.

Duff and Reid 1983, "The multifrontal solution of indefinite sparse symmetric linear equations";
the inverse on the pattern of the factor after Takahashi, Fagan and Chen 1973, front by front.
Each front is one dense LAPACK call, so a survey of thousands of frames costs a few hundred calls.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.linalg
import scipy.sparse as sp

from uavgram.estimation.nested_dissection import dissect
from uavgram.model.arrays import Floats, Ints


class NotPositiveError(ValueError):
    """The matrix is not positive definite; `index` is an unknown without information."""

    def __init__(self, index: int) -> None:
        self.index = index
        super().__init__(f"no information on unknown {index}")


@dataclass(frozen=True, eq=False)
class _Front:
    """Symbolic part of one front, in elimination order.

    Attributes
    ----------
    first, last
        Own unknowns first..last-1.
    boundary
        Later unknowns that the own ones, or their descendants, are coupled with; sorted.
    parent
        Position of the parent front; -1 for the root.
    in_parent
        Where the boundary's unknowns stand in the parent's (own, boundary).
    """

    first: int
    last: int
    boundary: Ints
    parent: int
    in_parent: Ints


class Ordering:
    """Elimination order and fronts of a sparsity pattern; serves every matrix that has it.

    Parameters
    ----------
    pattern
        (n, n) symmetric sparse matrix; its values mean nothing.
    blocks
        (n,) number of the block that each unknown belongs to, not decreasing.
    dense
        Number of last unknowns that are coupled with everything: the root of the tree.
    """

    def __init__(self, pattern: sp.csr_matrix, blocks: Ints, dense: int) -> None:
        size = pattern.shape[0]
        inner = size - dense
        count = int(blocks[inner - 1]) + 1 if inner else 0
        member = sp.csr_matrix(
            (np.ones(inner), (np.arange(inner), blocks[:inner])), shape=(inner, count)
        )
        graph = (member.T @ abs(pattern[:inner, :inner]) @ member).tocsr()
        nodes = dissect(graph)
        members = np.split(np.arange(inner), np.flatnonzero(np.diff(blocks[:inner])) + 1)
        own = [np.concatenate([members[b] for b in node.own] or [np.arange(0)]) for node in nodes]
        own[-1] = np.concatenate([own[-1], np.arange(inner, size)])
        self.order = np.concatenate(own).astype(np.int64)
        self.place = np.argsort(self.order)
        self.fronts = _symbolic(pattern, self.order, own, [node.parent for node in nodes])


def _symbolic(
    pattern: sp.csr_matrix, order: Ints, own: list[Ints], parent: list[int]
) -> list[_Front]:
    permuted = pattern[order][:, order].tocsr()
    last = np.cumsum([len(o) for o in own])
    children: list[list[int]] = [[] for _ in own]
    for child, above in enumerate(parent):
        if above >= 0:
            children[above].append(child)
    boundary: list[Ints] = []
    for node in range(len(own)):
        rows = slice(permuted.indptr[last[node] - len(own[node])], permuted.indptr[last[node]])
        coupled: list[Ints] = [permuted.indices[rows].astype(np.int64)]
        coupled += [boundary[child] for child in children[node]]
        later: Ints = np.unique(np.concatenate(coupled)).astype(np.int64)
        boundary.append(later[later >= last[node]])
    fronts = []
    for node, above in enumerate(parent):
        first = int(last[node]) - len(own[node])
        inside = np.arange(0)
        if above >= 0:
            unknowns = np.concatenate(
                [np.arange(last[above] - len(own[above]), last[above]), boundary[above]]
            )
            inside = np.searchsorted(unknowns, boundary[node])
        fronts.append(_Front(first, int(last[node]), boundary[node], above, inside))
    return fronts


class Multifrontal:
    """Cholesky factor of one matrix.

    Parameters
    ----------
    matrix
        (n, n) symmetric positive definite, on the pattern of `ordering`.
    ordering
        From the same pattern.
    smallest
        Pivot below which an unknown counts as undetermined.

    Raises
    ------
    NotPositiveError
    """

    def __init__(self, matrix: sp.csr_matrix, ordering: Ordering, smallest: float) -> None:
        self._ordering = ordering
        self._matrix = matrix[ordering.order][:, ordering.order].tocsr()
        self._lower: list[Floats] = []
        self._below: list[Floats] = []
        self._factorise(smallest)

    def _factorise(self, smallest: float) -> None:
        place = np.full(self._matrix.shape[0], -1)
        waiting: dict[int, list[tuple[Ints, Floats]]] = {}
        for position, front in enumerate(self._ordering.fronts):
            own = front.last - front.first
            dense = self._assemble(front, place)
            for inside, update in waiting.pop(position, []):
                dense[inside[:, None], inside] += update
            lower = self._pivots(front, dense[:own, :own], smallest)
            below = scipy.linalg.solve_triangular(
                lower, dense[:own, own:], lower=True, check_finite=False
            )
            self._lower.append(lower)
            self._below.append(below)
            if front.parent >= 0:
                update = dense[own:, own:] - below.T @ below
                waiting.setdefault(front.parent, []).append((front.in_parent, update))

    def _assemble(self, front: _Front, place: Ints) -> Floats:
        """Front (own, boundary) with the matrix's own rows in it."""
        own, size = front.last - front.first, front.last - front.first + len(front.boundary)
        dense = np.zeros((size, size))
        place[front.first : front.last] = np.arange(own)
        place[front.boundary] = np.arange(own, size)
        indptr = self._matrix.indptr[front.first : front.last + 1]
        columns = self._matrix.indices[indptr[0] : indptr[-1]]
        values = self._matrix.data[indptr[0] : indptr[-1]]
        rows = np.repeat(np.arange(own), np.diff(indptr))
        later = columns >= front.first  # earlier columns were dealt with by the children
        dense[rows[later], place[columns[later]]] = values[later]
        return dense

    def _pivots(self, front: _Front, dense: Floats, smallest: float) -> Floats:
        if not len(dense):
            return dense
        lower, info = scipy.linalg.lapack.dpotrf(dense, lower=1, clean=1)
        pivots = np.diag(lower) ** 2
        failed = info - 1 if info > 0 else int(np.argmin(pivots))
        if info > 0 or pivots[failed] < smallest:
            raise NotPositiveError(int(self._ordering.order[front.first + failed]))
        return np.asarray(lower)

    def solve(self, right: Floats) -> Floats:
        """Solve for (n, m) right-hand sides."""
        x = right[self._ordering.order]
        for front, lower, below in zip(
            self._ordering.fronts, self._lower, self._below, strict=True
        ):
            own = slice(front.first, front.last)
            x[own] = scipy.linalg.solve_triangular(lower, x[own], lower=True, check_finite=False)
            x[front.boundary] -= below.T @ x[own]
        for position in range(len(self._lower) - 1, -1, -1):
            front, lower = self._ordering.fronts[position], self._lower[position]
            own = slice(front.first, front.last)
            x[own] -= self._below[position] @ x[front.boundary]
            x[own] = scipy.linalg.solve_triangular(
                lower, x[own], lower=True, trans=1, check_finite=False
            )
        return x[self._ordering.place]

    def inverse_on_pattern(self, pattern: sp.csr_matrix) -> sp.csr_matrix:
        """Symmetric (n, n) inverse on a pattern, which must be that of the ordering."""
        order, place = self._ordering.order, self._ordering.place
        wanted = pattern[order][:, order].tocsr()
        data = np.zeros(wanted.nnz)
        inside = np.full(len(order), -1)
        fronts = self._ordering.fronts
        pending = np.bincount([f.parent for f in fronts if f.parent >= 0], minlength=len(fronts))
        dense: dict[int, Floats] = {}
        for position in range(len(fronts) - 1, -1, -1):
            front = fronts[position]
            inverse = self._front_inverse(position, dense)
            _scatter(wanted, front, inverse, data, inside)
            if pending[position]:
                dense[position] = inverse
            if front.parent >= 0:
                pending[front.parent] -= 1
                if not pending[front.parent]:
                    del dense[front.parent]
        upper = sp.csr_matrix((data, wanted.indices, wanted.indptr), shape=wanted.shape)
        later = sp.triu(upper, k=1, format="csr")
        whole = sp.triu(upper, format="csr") + later.T
        return whole[place][:, place].tocsr()

    def _front_inverse(self, position: int, dense: dict[int, Floats]) -> Floats:
        """Inverse among the own and boundary unknowns of a front, from that of its parent."""
        front, lower, below = (
            self._ordering.fronts[position],
            self._lower[position],
            self._below[position],
        )
        own = front.last - front.first
        inverse = np.empty((own + len(front.boundary),) * 2)
        root = scipy.linalg.solve_triangular(lower, np.eye(own), lower=True, check_finite=False)
        inverse[:own, :own] = root.T @ root
        if len(front.boundary):
            inside = front.in_parent
            later = dense[front.parent][inside[:, None], inside]
            gain = root.T @ below
            mixed = -gain @ later
            inverse[:own, :own] -= mixed @ gain.T
            inverse[:own, own:], inverse[own:, :own] = mixed, mixed.T
            inverse[own:, own:] = later
        return inverse


def _scatter(
    wanted: sp.csr_matrix, front: _Front, inverse: Floats, data: Floats, place: Ints
) -> None:
    """Copy the own rows of a front's inverse to where they are wanted."""
    own = front.last - front.first
    place[front.first : front.last] = np.arange(own)
    place[front.boundary] = np.arange(own, len(inverse))
    indptr = wanted.indptr[front.first : front.last + 1]
    entries = np.arange(indptr[0], indptr[-1])
    columns = wanted.indices[entries]
    rows = np.repeat(np.arange(own), np.diff(indptr))
    later = columns >= front.first
    data[entries[later]] = inverse[rows[later], place[columns[later]]]
