"""Elimination order and fronts of a sparse matrix: the symbolic part, independent of its values."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import scipy.sparse as sp

from uavgram.estimation.solver.sparse.block_matrix import (
    BLOCK,
    POINT,
    TABLE_KINDS,
    BlockMatrix,
    Pattern,
)
from uavgram.model.arrays import Floats, Ints


@dataclass(frozen=True, eq=False)
class Front:
    """Symbolic part of one front, in elimination order.

    Attributes
    ----------
    first, own
        Its own unknowns: the first, and their number.
    boundary
        Later unknowns that the own ones, or their descendants, are coupled with; sorted.
    parent
        Position of the parent front; -1 for the root.
    level
        Number of fronts between it and the root.
    in_parent
        Positions of the boundary's unknowns among the parent's (own, boundary).
    runs
        The same as runs of neighbours: start and end in the boundary, start in the parent. No run
        contains both own unknowns of the parent and unknowns of its boundary.
    flat, source
        Positions of stored values in the front (own, boundary), row by row, upper triangle; and the
        indices of these values.
    """

    first: int
    own: int
    boundary: Ints
    parent: int
    level: int
    in_parent: Ints
    runs: list[tuple[int, int, int]]
    flat: Ints
    source: Ints

    @property
    def size(self) -> int:
        """Number of rows of the front."""
        return self.own + len(self.boundary)


class Ordering:
    """Elimination order and fronts of a pattern, for every matrix that has it.

    Attributes
    ----------
    order
        (size,) unknowns in the order of their elimination.
    fronts
        Children before parents.
    stored
        Number of values that a matrix of that pattern stores.
    stacks
        (2,) largest size of the two stacks on which updates wait for the front of their parent:
        that of the even levels of the tree, and that of the odd ones.
    """

    def __init__(self, pattern: Pattern) -> None:
        # Imported here: small surveys do not need it, and scipy's graph functions load all its
        # sparse solvers.
        from uavgram.estimation.solver.sparse.nested_dissection import dissect  # noqa: PLC0415

        self._pattern = pattern
        structure = pattern.structure
        points, blocks = structure.counts
        sizes = np.repeat(structure.sizes, structure.counts)
        trees = dissect(_make_graph(pattern))
        own = [node.own for node in trees]
        nodes = np.concatenate(own).astype(np.int64)
        rank = np.empty(points + blocks, dtype=np.int64)
        rank[nodes] = np.arange(len(nodes))
        width = sizes[nodes]
        self._start = np.cumsum(width) - width
        self._width = width
        first = np.concatenate([np.cumsum(sizes) - sizes, [structure.first_shared]])
        self.order = np.concatenate(
            [
                np.repeat(first[nodes] - self._start, width) + np.arange(structure.first_shared),
                np.arange(structure.first_shared, structure.size),
            ]
        )
        self.stored = sum(v.size for v in _find_stored(pattern.zeros()))
        self.fronts = self._fronts(own, [node.parent for node in trees], rank)
        self.stacks = _make_stacks(self.fronts)

    def find_fronts_and_ancestors(self, unknowns: Ints) -> list[int]:
        """Return the positions of the fronts that own these unknowns, and of their ancestors."""
        wanted = np.zeros(len(self.order), dtype=np.bool_)
        wanted[unknowns] = True
        place = np.flatnonzero(wanted[self.order])  # in the order of elimination
        ends = np.array([front.first + front.own for front in self.fronts])
        found = set[int]()
        for position in np.unique(np.searchsorted(ends, place, side="right")).tolist():
            while position >= 0 and position not in found:
                found.add(position)
                position = self.fronts[position].parent  # noqa: PLW2901 - up to the root
        return sorted(found)

    def values(self, matrix: BlockMatrix) -> Floats:
        """Return the (stored,) values of a matrix."""
        return np.concatenate([v.ravel() for v in _find_stored(matrix)])

    def matrix(self, values: Floats) -> BlockMatrix:
        """Return the matrix with these values."""
        matrix, done = self._pattern.zeros(), 0
        for part in _find_stored(matrix):
            part[...] = values[done : done + part.size].reshape(part.shape)
            done += part.size
        return matrix

    def _fronts(self, own: list[Ints], parent: list[int], rank: Ints) -> list[Front]:
        inner, size = self._pattern.structure.first_shared, self._pattern.structure.size
        last = np.cumsum([len(o) for o in own])
        starts = np.append(self._start, inner)[np.append(0, last)]
        ends = [size if above < 0 else int(e) for above, e in zip(parent, starts[1:], strict=True)]
        shared = np.arange(inner, size)
        boundaries = [
            np.concatenate([self._unknowns(nodes), shared]) if above >= 0 else shared[:0]
            for nodes, above in zip(self._later(last, parent, rank), parent, strict=True)
        ]
        # Depth of each front in the tree, from the root down.
        level = np.zeros(len(parent), dtype=np.int64)
        for node in range(len(parent) - 2, -1, -1):
            level[node] = level[parent[node]] + 1
        place = np.empty(size, dtype=np.int64)
        fronts = []
        entries = self._entries(last, rank)
        for node, (first, end, boundary) in enumerate(
            zip(starts[:-1].tolist(), ends, boundaries, strict=True)
        ):
            above, count = parent[node], end - first
            inside, runs = boundary, []
            if above >= 0:
                outer = np.concatenate([np.arange(starts[above], ends[above]), boundaries[above]])
                inside = np.searchsorted(outer, boundary)
                runs = _find_runs(inside, ends[above] - int(starts[above]))
            place[first:end] = np.arange(count)
            place[boundary] = count + np.arange(len(boundary))
            rows, columns, source = entries[node]
            flat = (place[rows] * (count + len(boundary)) + place[columns]).astype(np.int32)
            fronts.append(
                Front(
                    first=first,
                    own=count,
                    boundary=boundary,
                    parent=above,
                    level=int(level[node]),
                    in_parent=inside,
                    runs=runs,
                    flat=flat,
                    source=source.astype(np.int32),
                )
            )
        return fronts

    def _unknowns(self, nodes: Ints) -> Ints:
        """Return the unknowns of nodes given by their rank, in elimination order."""
        width = self._width[nodes]
        ends = np.cumsum(width)
        return np.repeat(self._start[nodes] - ends + width, width) + np.arange(width.sum())

    def _later(self, last: Ints, parent: list[int], rank: Ints) -> list[Ints]:
        """Return the ranks of the nodes on the boundary of each front."""
        one, other = _find_edges(self._pattern)
        low, high = np.minimum(rank[one], rank[other]), np.maximum(rank[one], rank[other])
        front = np.searchsorted(last, low, side="right")
        order = np.argsort(front, kind="stable")
        ends = np.cumsum(np.bincount(front, minlength=len(last)))
        coupled = np.split(high[order], ends[:-1])
        # Boundary: nodes coupled with the front or on its children's boundaries, and eliminated
        # later.
        boundary: list[Ints] = []
        children: list[list[int]] = [[] for _ in parent]
        for node, above in enumerate(parent):
            reached = np.concatenate([coupled[node], *(boundary[c] for c in children[node])])
            nodes = np.unique(reached)
            boundary.append(nodes[nodes >= last[node]])
            if above >= 0:
                children[above].append(node)
        return boundary

    def _entries(self, last: Ints, rank: Ints) -> list[tuple[Ints, Ints, Ints]]:
        """Return the values of each front: rows and columns in elimination order, and indices."""
        structure = self._pattern.structure
        shared = np.arange(structure.first_shared, structure.size)
        rows, columns, fronts = [], [], []
        for pairs, kinds in zip(self._pattern.pairs, TABLE_KINDS, strict=True):
            one, other = (
                rank[node + (0, structure.counts[0])[kind]]
                for node, kind in zip((pairs.first, pairs.second), kinds, strict=True)
            )
            a, b = (structure.sizes[kind] for kind in kinds)
            row = np.broadcast_to(
                (self._start[one, None] + np.arange(a))[:, :, None], (len(one), a, b)
            )
            column = np.broadcast_to(
                (self._start[other, None] + np.arange(b))[:, None, :], (len(one), a, b)
            )
            # Entries are kept in the upper triangle of the elimination order.
            turned = (one > other)[:, None, None]
            rows.append(np.where(turned, column, row).ravel())
            columns.append(np.where(turned, row, column).ravel())
            fronts.append(np.repeat(np.searchsorted(last, np.minimum(one, other), "right"), a * b))
        for kind in (POINT, BLOCK):
            count, size = structure.counts[kind], structure.sizes[kind]
            here = rank[np.arange(count) + (0, structure.counts[0])[kind]]
            row = (self._start[here, None] + np.arange(size)).ravel()
            rows.append(np.repeat(row, len(shared)))
            columns.append(np.tile(shared, len(row)))
            front = np.searchsorted(last, here, "right")
            fronts.append(np.repeat(front, size * len(shared)))
        rows.append(np.repeat(shared, len(shared)))
        columns.append(np.tile(shared, len(shared)))
        fronts.append(np.full(len(shared) ** 2, len(last) - 1))
        member = np.concatenate(fronts)
        source = np.argsort(member, kind="stable")
        cuts = np.cumsum(np.bincount(member, minlength=len(last)))[:-1]
        row, column = np.concatenate(rows)[source], np.concatenate(columns)[source]
        return list(
            zip(np.split(row, cuts), np.split(column, cuts), np.split(source, cuts), strict=True)
        )


def _find_stored(matrix: BlockMatrix) -> tuple[Floats, ...]:
    return (*matrix.tables, *matrix.coupling, matrix.border)


def _find_edges(pattern: Pattern) -> tuple[Ints, Ints]:
    """Return pairs of nodes that are coupled, points numbered before blocks."""
    first = (0, pattern.structure.counts[0])
    one = [
        pairs.first + first[kind]
        for pairs, (kind, _) in zip(pattern.pairs, TABLE_KINDS, strict=True)
    ]
    other = [
        pairs.second + first[kind]
        for pairs, (_, kind) in zip(pattern.pairs, TABLE_KINDS, strict=True)
    ]
    return np.concatenate(one), np.concatenate(other)


def _make_graph(pattern: Pattern) -> sp.csr_matrix:
    one, other = _find_edges(pattern)
    apart = one != other
    one, other = one[apart], other[apart]
    count = sum(pattern.structure.counts)
    ends = (np.concatenate([one, other]), np.concatenate([other, one]))
    return sp.csr_matrix((np.ones(2 * len(one)), ends), shape=(count, count))


def _find_runs(inside: Ints, own: int) -> list[tuple[int, int, int]]:
    """Return runs of neighbours in sorted places, also cut at `own`."""
    cuts = np.flatnonzero(np.diff(inside) != 1) + 1
    bounds = np.unique(np.concatenate([[0], cuts, [np.searchsorted(inside, own), len(inside)]]))
    return [(a, b, int(inside[a])) for a, b in pairwise(bounds.tolist())]


def _make_stacks(fronts: list[Front]) -> tuple[int, int]:
    most, top = [0, 0], [0, 0]
    waiting: list[list[Front]] = [[], []]
    for position, front in enumerate(fronts):
        turn = front.level % 2
        top[turn] += len(front.boundary) ** 2
        most[turn] = max(most[turn], top[turn])
        children = waiting[1 - turn]
        while children and children[-1].parent == position:
            top[1 - turn] -= len(children.pop().boundary) ** 2
        waiting[turn].append(front)
    return most[0], most[1]
