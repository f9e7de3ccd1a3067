"""Factorisation of a survey's normal matrix: points first, then frames by dense fronts.

Duff and Reid 1983, "The multifrontal solution of indefinite sparse symmetric linear equations"; the
inverse on the pattern of the factor after Takahashi, Fagan and Chen 1973, front by front. Each
front is a few dense BLAS calls, so a survey of thousands of frames costs a few hundred.

1. Points without a length to another point are coupled only with frames and shared unknowns. They
   are eliminated by their own small blocks (Schur complement; Brown 1958 for photogrammetry).
2. The remaining unknowns (frames, points with lengths, shared unknowns) are factorised by fronts.
3. Only the part of the inverse on the pattern of the normal matrix is computed.

Reasons for own code: sparse LU (SuperLU) took 4 to 8 times as long and gives no selected inverse, a
dense Schur complement 4 and 15 times as long at 300 and 500 frames, a general bundle adjuster
(Ceres) more than 40 times. With k frames seen per point and F frames along a strip, eliminating the
points costs O(picks * k), the frames O(F); over an area whose frames overlap both ways O(F^1.5), to
which nested dissection reduces O(F^3).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import blas, lapack

from uavgram.estimation.solver.sparse.block_matrix import (
    BLOCK,
    CHUNK_SIZE,
    POINT,
    BlockMatrix,
    GroupedProducts,
    Pairs,
    Pattern,
    Structure,
)
from uavgram.estimation.solver.sparse.fronts import Front, Ordering
from uavgram.model.arrays import Floats, Ints


class NotPositiveError(ValueError):
    """Matrix that is not positive definite; `index` is an unknown without information."""

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
        Ordering of the same pattern.
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
        """Factor all fronts, of which only the upper triangle is valid (lower in Fortran order).

        Fronts come in postorder, so that the updates for a parent are on top of a stack (Duff and
        Reid 1983). Two stacks alternate from one level of the tree to the next: the update of a
        front is written in its place on one stack while those of its children are on the other.
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
            # Assemble the updates of the children into the front.
            children = waiting[1 - turn]
            while children and children[-1].parent == position:
                child = children.pop()
                top[1 - turn] -= len(child.boundary) ** 2
                update = _square(stacks[1 - turn], top[1 - turn], len(child.boundary))
                _extend(rows, corner, child, update)
            lower = self._pivots(front, rows[:, :own], smallest)
            # Eliminate the own unknowns: L of the pivots, L21 = A21 L^-T, update A22 - L21 L21^T.
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
        """Return the natural logarithm of the determinant of the matrix."""
        return 2.0 * sum(float(np.log(np.diag(lower)).sum()) for lower in self._lower if len(lower))

    def solve(self, right: Floats, among: Ints | None = None) -> Floats:
        """Solve for (n, m) right-hand sides.

        Parameters
        ----------
        right
            Right-hand sides.
        among
            Unknowns that contain all nonzero rows of the right-hand sides, and all those whose
            solution is valid; by default all.
        """
        x = right[self._ordering.order]
        fronts = list(zip(self._ordering.fronts, self._lower, self._below, strict=True))
        if among is not None:
            # Other fronts neither change these unknowns nor are changed by the right-hand sides.
            fronts = [fronts[k] for k in self._ordering.find_fronts_and_ancestors(among)]
        # Forward substitution, from the leaves to the root.
        for front, lower, below in fronts:
            if front.own:
                own = slice(front.first, front.first + front.own)
                x[own] = lapack.dtrtrs(lower, x[own], lower=1)[0]
                x[front.boundary] -= below @ x[own]
        # Back substitution, from the root to the leaves.
        for front, lower, below in reversed(fronts):
            if front.own:
                own = slice(front.first, front.first + front.own)
                later = x[own] - below.T @ x[front.boundary]
                x[own] = lapack.dtrtrs(lower, later, lower=1, trans=1)[0]
        solution: Floats = np.empty_like(x)
        solution[self._ordering.order] = x
        return solution

    def inverse_on_pattern(self) -> BlockMatrix:
        """Compute the symmetric inverse on the pattern of the matrix."""
        fronts = self._ordering.fronts
        values = np.empty(self._ordering.stored)
        pending = np.bincount([f.parent for f in fronts if f.parent >= 0], minlength=len(fronts))
        dense: dict[int, Floats] = {}
        # From the root down: each front needs its parent's inverse among its boundary.
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
        """Compute own rows (own, own + boundary) of a front's inverse from that of its boundary."""
        front = self._ordering.fronts[position]
        below, own = self._below[position], front.own
        inverse = np.empty((own, front.size))
        if own:
            root = lapack.dtrtri(self._lower[position], lower=1)[0]
            inverse[:, :own] = root.T @ root
            if len(below):
                # Takahashi: with G = L^-T L21^T, S12 = -G S22 and S11 = L^-T L^-1 + G S22 G^T.
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


@dataclass(frozen=True, eq=False)
class _Views:
    """Eliminated points that are coupled with equal numbers of blocks.

    Attributes
    ----------
    point
        (n,) positions among the eliminated points.
    entry
        (n, m) positions among their couplings.
    pair
        (n, m, m) the table entry of each two of the m blocks in the reduced matrix; the upper
        triangle counts.
    """

    point: Ints
    entry: Ints
    pair: Ints


class Symbolic:
    """Symbolic factorisation of a sparse system, independent of its values.

    Parameters
    ----------
    pattern
        Pattern of the normal matrix.
    """

    def __init__(self, pattern: Pattern) -> None:
        self.pattern = pattern
        structure, (among, seen, between) = pattern.structure, pattern.pairs
        points, blocks = structure.counts
        apart = among.first != among.second
        self.joined = np.unique(np.concatenate([among.first[apart], among.second[apart]]))
        self.alone = np.setdiff1d(np.arange(points), self.joined)
        place = np.zeros(points, dtype=np.int64)
        place[self.alone], place[self.joined] = np.arange(len(self.alone)), -1
        self.entry = np.flatnonzero(place[seen.first] >= 0)
        self.kept_entry = np.flatnonzero(place[seen.first] < 0)
        self.kept_pair = np.flatnonzero(place[among.first] < 0)
        self.point, self.block = place[seen.first[self.entry]], seen.second[self.entry]
        self._reduce(between, blocks)
        rows = np.arange(len(self.entry))
        self.by_block = GroupedProducts(rows, self.point, self.block)
        self.by_point = GroupedProducts(rows, self.block, self.point)
        self.ordering = Ordering(self.reduced)
        self.kept = np.concatenate(
            [
                structure.node_columns(POINT, self.joined).ravel(),
                np.arange(structure.first_block, structure.size),
            ]
        )

    def find_reduced_unknowns(self, among: Ints) -> Ints:
        """Return the kept unknowns among some unknowns, and those of blocks that see their points.

        As positions in the reduced matrix.
        """
        marked = np.zeros((self.pattern.structure.size, 1))
        marked[among] = 1.0
        point = self.pattern.structure.split(marked)[POINT][self.alone].any(axis=(1, 2))
        kept = marked[self.kept]
        self.reduced.structure.split(kept)[BLOCK][self.block[point[self.point]]] = 1.0
        return np.flatnonzero(kept)

    def _reduce(self, between: Pairs, blocks: int) -> None:
        """Compute the reduced pattern: blocks that see the same point are now coupled."""
        structure, (among, seen, _) = self.pattern.structure, self.pattern.pairs
        count = np.bincount(self.point, minlength=len(self.alone))
        first = np.cumsum(count) - count
        entries, keys = [], [between.key]
        # Group the points by their number of blocks: each point couples all pairs of its blocks.
        for views in np.unique(count):
            point = np.flatnonzero(count == views)
            entry = first[point][:, None] + np.arange(views)
            one, other = np.triu_indices(views)
            entries.append((point, entry, one, other))
            keys.append((self.block[entry[:, one]] * blocks + self.block[entry[:, other]]).ravel())
        # Blocks of the reduced matrix: those that were coupled before, and the new pairs.
        merged, place = np.unique(np.concatenate(keys), return_inverse=True)
        self.between = place[: len(between)]
        self.views: list[_Views] = []
        done, left, right = len(between), [self.entry[:0]], [self.entry[:0]]
        for point, entry, one, other in entries:
            pair = np.empty((len(point), entry.shape[1], entry.shape[1]), dtype=np.int64)
            end = done + len(point) * len(one)
            pair[:, one, other] = place[done:end].reshape(len(point), -1)
            pair[:, other, one] = pair[:, one, other]
            self.views.append(_Views(point, entry, pair))
            left.append(entry[:, one].ravel())
            right.append(entry[:, other].ravel())
            done = end
        self.schur = GroupedProducts(
            np.concatenate(left), np.concatenate(right), place[len(between) :]
        )
        # Renumber the points that are kept.
        joined, width = len(self.joined), structure.point_size
        border = structure.first_shared - structure.first_block + joined * width
        renamed = np.searchsorted(self.joined, among.first[self.kept_pair]) * max(joined, 1)
        renamed += np.searchsorted(self.joined, among.second[self.kept_pair])
        viewed = np.searchsorted(self.joined, seen.first[self.kept_entry]) * max(blocks, 1)
        self.reduced = Pattern(
            Structure(
                size=border + structure.border,
                points=joined,
                point_size=width,
                block_size=structure.block_size,
                first_shared=border,
            ),
            (
                Pairs(renamed, joined),
                Pairs(viewed + seen.second[self.kept_entry], blocks),
                Pairs(merged, blocks),
            ),
        )


class SparseFactor:
    """Factor of one scaled normal matrix (unit diagonal, plus damping).

    Raises
    ------
    NotPositiveError
        An unknown is not determined; its index is that of the whole system.
    """

    def __init__(self, scaled: BlockMatrix, symbolic: Symbolic, smallest: float) -> None:
        self._symbolic = symbolic
        alone, size = symbolic.alone, symbolic.pattern.structure.point_size
        # Schur complement: eliminate the points without lengths, C - B^T A^-1 B.
        own = scaled.tables[0][symbolic.pattern.own(POINT)[alone]]
        self._inverse = _inverse_blocks(own, alone * size, smallest)
        views = scaled.tables[1][symbolic.entry]
        self._gain = self._inverse[symbolic.point] @ views
        shared = scaled.coupling[POINT][alone]
        self._border_gain = self._inverse @ shared
        reduced = symbolic.reduced.zeros()
        reduced.tables[0][:] = scaled.tables[0][symbolic.kept_pair]
        reduced.tables[1][:] = scaled.tables[1][symbolic.kept_entry]
        reduced.tables[2][symbolic.between] = scaled.tables[2]
        np.negative(views, out=views)
        symbolic.schur.add(reduced.tables[2], views, self._gain)
        reduced.coupling[POINT][:] = scaled.coupling[POINT][symbolic.joined]
        reduced.coupling[BLOCK][:] = scaled.coupling[BLOCK]
        symbolic.by_block.add(reduced.coupling[BLOCK], views, self._border_gain)
        reduced.border[:] = scaled.border - _contract(shared, self._border_gain)
        try:
            self._front = Multifrontal(reduced, symbolic.ordering, smallest)
        except NotPositiveError as error:
            raise NotPositiveError(int(symbolic.kept[error.index])) from None

    def log_determinant(self) -> float:
        """Return the natural logarithm of the determinant of the matrix."""
        return self._front.log_determinant() - float(np.linalg.slogdet(self._inverse)[1].sum())

    def solve(self, right: Floats, among: Ints | None = None) -> Floats:
        """Solve for (n, m) right-hand sides; `among` as in `Multifrontal.solve`."""
        symbolic = self._symbolic
        structure = symbolic.pattern.structure
        point = structure.split(right)[POINT][symbolic.alone]
        reduced = right[symbolic.kept]
        _, block, border = symbolic.reduced.structure.split(reduced)
        # Reduced right-hand side: b_c - B^T A^-1 b_p.
        symbolic.by_block.add(block, self._gain, -point)
        border -= _contract(self._border_gain, point)
        found = self._front.solve(
            reduced, None if among is None else symbolic.find_reduced_unknowns(among)
        )
        _, block, border = symbolic.reduced.structure.split(found)
        # Back substitution of the points: A^-1 (b_p - B x_c).
        own = self._inverse @ point - self._border_gain @ border
        symbolic.by_point.add(own, np.swapaxes(self._gain, 1, 2), -block)
        solution = np.empty_like(right)
        solution[symbolic.kept] = found
        structure.split(solution)[POINT][symbolic.alone] = own
        return solution

    def inverse_on_pattern(self) -> BlockMatrix:
        """Compute the symmetric inverse on the pattern of the normal matrix."""
        symbolic, structure = self._symbolic, self._symbolic.pattern.structure
        reduced = self._front.inverse_on_pattern()
        inverse = symbolic.pattern.zeros()
        inverse.tables[0][symbolic.kept_pair] = reduced.tables[0]
        inverse.tables[1][symbolic.kept_entry] = reduced.tables[1]
        inverse.tables[2][:] = reduced.tables[2][symbolic.between]
        inverse.coupling[POINT][symbolic.joined] = reduced.coupling[POINT]
        inverse.coupling[BLOCK][:] = reduced.coupling[BLOCK]
        inverse.border[:] = reduced.border
        # Eliminated points: start from A^-1, and add the part by their blocks and the border.
        own = symbolic.pattern.own(POINT)[symbolic.alone]
        inverse.tables[0][own] = self._inverse
        for views in symbolic.views:
            step = 1 + CHUNK_SIZE // (1 + views.entry.shape[1] * structure.block_size) ** 2
            for start in range(0, len(views.point), step):
                part = slice(start, start + step)
                some = _Views(views.point[part], views.entry[part], views.pair[part])
                self._compute_eliminated_covariances(some, reduced, inverse)
        return inverse

    def _compute_eliminated_covariances(
        self, views: _Views, reduced: BlockMatrix, inverse: BlockMatrix
    ) -> None:
        """Compute covariances of eliminated points, their own and with the coupled nodes.

        With G = A^-1 B: S_pc = -G S_cc, S_pp = A^-1 + G S_cc G^T.
        """
        symbolic, structure = self._symbolic, self._symbolic.pattern.structure
        (count, m), size = views.entry.shape, structure.block_size
        joint = reduced.tables[2][views.pair]
        lower = np.tril_indices(m, -1)
        joint[:, *lower] = np.swapaxes(joint[:, *lower], 2, 3)
        joint = np.swapaxes(joint, 2, 3).reshape(count, m * size, m * size)
        gain = np.swapaxes(self._gain[views.entry], 1, 2)  # (n, s, m, b)
        gain = gain.reshape(count, structure.point_size, m * size)
        shared = self._border_gain[views.point]
        block = symbolic.block[views.entry]
        coupling = reduced.coupling[BLOCK][block].reshape(count, m * size, structure.border)
        mixed = -(gain @ joint + shared @ np.swapaxes(coupling, 1, 2))
        border = -(gain @ coupling + shared @ reduced.border)
        each = mixed.reshape(count, structure.point_size, m, size)
        inverse.tables[1][symbolic.entry[views.entry]] = np.swapaxes(each, 1, 2)
        inverse.coupling[POINT][symbolic.alone[views.point]] = border
        own = symbolic.pattern.own(POINT)[symbolic.alone[views.point]]
        inverse.tables[0][own] -= mixed @ np.swapaxes(gain, 1, 2)
        inverse.tables[0][own] -= border @ np.swapaxes(shared, 1, 2)


def _contract(left: Floats, right: Floats) -> Floats:
    """Sum left[i]^T right[i] over (n, s, a) and (n, s, b)."""
    return np.asarray(np.tensordot(left, right, axes=([0, 1], [0, 1])))


def _inverse_blocks(blocks: Floats, first: Ints, smallest: float) -> Floats:
    """Invert blocks (n, s, s); `first` (n,) are the blocks' first unknowns."""
    if not len(blocks):
        return blocks
    value = np.linalg.eigvalsh(blocks)[:, 0]
    worst = int(np.argmin(value))
    if value[worst] < smallest:
        raise NotPositiveError(int(first[worst]))
    return np.asarray(np.linalg.inv(blocks), dtype=np.float64)
