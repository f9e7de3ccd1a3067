"""Factorisation of a survey's normal matrix: points first, then frames by nested dissection.

Points that no length joins to another see only frames and what all share: they are eliminated by
their own small blocks (Schur complement; Brown 1958 for photogrammetry). What is left, frames,
points with lengths and the shared border, goes to the multifrontal factorisation. Of the inverse
only the pattern of the normal matrix is computed.

Why no library: sparse LU (SuperLU) took 4 to 8 times as long and gives no selected inverse, a dense
Schur complement 4 and 15 times as long at 300 and 500 frames, a general bundle adjuster (Ceres)
more than 40 times. With k frames seen per point and F frames along a strip, eliminating the points
costs O(picks * k), the frames O(F); over an area whose frames overlap both ways O(F^1.5), which is
what nested dissection leaves of O(F^3).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from uavgram.estimation.solver.sparse.block_matrix import BlockMatrix, Pairs, Pattern
from uavgram.estimation.solver.sparse.fronts import Ordering
from uavgram.estimation.solver.sparse.grouped_products import CHUNK, GroupedProducts
from uavgram.estimation.solver.sparse.multifrontal import Multifrontal, NotPositiveError
from uavgram.estimation.solver.sparse.structure import BLOCK, POINT, Structure
from uavgram.model.arrays import Floats, Ints


@dataclass(frozen=True, eq=False)
class _Views:
    """Eliminated points that are coupled with equally many blocks.

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
    """Everything about a sparse system that its values do not change.

    Parameters
    ----------
    pattern
        Of the normal matrix.
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

    def _reduce(self, between: Pairs, blocks: int) -> None:
        """Pattern of what is left: blocks that see the same point are now coupled."""
        structure, (among, seen, _) = self.pattern.structure, self.pattern.pairs
        count = np.bincount(self.point, minlength=len(self.alone))
        first = np.cumsum(count) - count
        entries, keys = [], [between.key]
        for views in np.unique(count):
            point = np.flatnonzero(count == views)
            entry = first[point][:, None] + np.arange(views)
            one, other = np.triu_indices(views)
            entries.append((point, entry, one, other))
            keys.append((self.block[entry[:, one]] * blocks + self.block[entry[:, other]]).ravel())
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
        reduced.border[:] = scaled.border - _contracted(shared, self._border_gain)
        try:
            self._front = Multifrontal(reduced, symbolic.ordering, smallest)
        except NotPositiveError as error:
            raise NotPositiveError(int(symbolic.kept[error.index])) from None

    def log_determinant(self) -> float:
        """Natural logarithm of the determinant of the matrix."""
        return self._front.log_determinant() - float(np.linalg.slogdet(self._inverse)[1].sum())

    def solve(self, right: Floats) -> Floats:
        """Solve for (n, m) right-hand sides."""
        symbolic = self._symbolic
        structure = symbolic.pattern.structure
        point = structure.split(right)[POINT][symbolic.alone]
        reduced = right[symbolic.kept]
        _, block, border = symbolic.reduced.structure.split(reduced)
        symbolic.by_block.add(block, self._gain, -point)
        border -= _contracted(self._border_gain, point)
        found = self._front.solve(reduced)
        _, block, border = symbolic.reduced.structure.split(found)
        own = self._inverse @ point - self._border_gain @ border
        symbolic.by_point.add(own, np.swapaxes(self._gain, 1, 2), -block)
        solution = np.empty_like(right)
        solution[symbolic.kept] = found
        structure.split(solution)[POINT][symbolic.alone] = own
        return solution

    def inverse_on_pattern(self) -> BlockMatrix:
        """Symmetric inverse on the pattern of the normal matrix."""
        symbolic, structure = self._symbolic, self._symbolic.pattern.structure
        reduced = self._front.inverse_on_pattern()
        inverse = symbolic.pattern.zeros()
        inverse.tables[0][symbolic.kept_pair] = reduced.tables[0]
        inverse.tables[1][symbolic.kept_entry] = reduced.tables[1]
        inverse.tables[2][:] = reduced.tables[2][symbolic.between]
        inverse.coupling[POINT][symbolic.joined] = reduced.coupling[POINT]
        inverse.coupling[BLOCK][:] = reduced.coupling[BLOCK]
        inverse.border[:] = reduced.border
        own = symbolic.pattern.own(POINT)[symbolic.alone]
        inverse.tables[0][own] = self._inverse
        for views in symbolic.views:
            step = 1 + CHUNK // (1 + views.entry.shape[1] * structure.block_size) ** 2
            for start in range(0, len(views.point), step):
                part = slice(start, start + step)
                some = _Views(views.point[part], views.entry[part], views.pair[part])
                self._eliminated(some, reduced, inverse)
        return inverse

    def _eliminated(self, views: _Views, reduced: BlockMatrix, inverse: BlockMatrix) -> None:
        """Covariances of eliminated points with what they are coupled with, and of their own.

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


def _contracted(left: Floats, right: Floats) -> Floats:
    """Sum of left[i]^T right[i] over (n, s, a) and (n, s, b)."""
    return np.asarray(np.tensordot(left, right, axes=([0, 1], [0, 1])))


def _inverse_blocks(blocks: Floats, first: Ints, smallest: float) -> Floats:
    """Inverses of (n, s, s); `first` (n,) are the blocks' first unknowns."""
    if not len(blocks):
        return blocks
    value = np.linalg.eigvalsh(blocks)[:, 0]
    worst = int(np.argmin(value))
    if value[worst] < smallest:
        raise NotPositiveError(int(first[worst]))
    return np.asarray(np.linalg.inv(blocks), dtype=np.float64)
