"""Sparse symmetric matrices as dense blocks: among points, among frames, and with the border.

The pattern is computed once; every matrix that has it is assembled by batched products of small
matrices, without an index per number.

An unknown belongs to a point, to a block (a frame) or to the border that all observations share.
Points and blocks are nodes, whose entries are kept in dense matrices of their size.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from uavgram.model.arrays import Floats, Ints

POINT, BLOCK, BORDER = 0, 1, 2


@dataclass(frozen=True)
class Structure:
    """Kinds of the unknowns in their order: points, then blocks, then shared ones.

    Attributes
    ----------
    size
        Number of unknowns.
    points, point_size
        The first points * point_size unknowns.
    block_size
        Unknowns of a frame.
    first_shared
        First of the unknowns that many observations have in common: the border.
    """

    size: int
    points: int
    point_size: int
    block_size: int
    first_shared: int

    @classmethod
    def plain(cls, size: int) -> Structure:
        """Return the structure of unknowns of no known kind: each is a block of its own."""
        return cls(size=size, points=0, point_size=1, block_size=1, first_shared=size)

    @property
    def first_block(self) -> int:
        """First unknown of the first block."""
        return self.points * self.point_size

    @property
    def border(self) -> int:
        """Number of shared unknowns."""
        return self.size - self.first_shared

    @property
    def counts(self) -> tuple[int, int]:
        """Number of points and of blocks."""
        return self.points, (self.first_shared - self.first_block) // self.block_size

    @property
    def sizes(self) -> tuple[int, int]:
        """Unknowns of a point and of a block."""
        return self.point_size, self.block_size

    def node_columns(self, kind: int, node: Ints) -> Ints:
        """Return the (n, size) unknowns of points or blocks."""
        first = (0, self.first_block)[kind]
        return first + node[:, None] * self.sizes[kind] + np.arange(self.sizes[kind])

    def is_border(self, columns: Ints) -> bool:
        """Return whether all of these unknowns belong to the border."""
        return bool((columns >= self.first_shared).all())

    def split(self, vector: Floats) -> tuple[Floats, Floats, Floats]:
        """Return views (K, s, m), (F, b, m), (border, m) of an array (size, m) of unknowns."""
        wide = vector.shape[1]
        return (
            vector[: self.first_block].reshape(self.points, self.point_size, wide),
            vector[self.first_block : self.first_shared].reshape(
                self.counts[BLOCK], self.block_size, wide
            ),
            vector[self.first_shared :],
        )


@dataclass(frozen=True, eq=False)
class Segment:
    """Neighbouring columns that belong to one node in every row.

    Attributes
    ----------
    kind
        POINT or BLOCK.
    node
        (n,) index of the node.
    columns
        Positions of the columns.
    inside
        (n, w) indices among the node's unknowns; None if they are all of them in order.
    size
        Unknowns of the node.
    """

    kind: int
    node: Ints
    columns: slice
    inside: Ints | None
    size: int

    def whole(self, jacobian: Floats) -> Floats:
        """Return the (n, r, size) Jacobian by all unknowns of the node, from rows (n, r, k)."""
        given = jacobian[:, :, self.columns]
        return given if self.inside is None else add_columns(given, self.inside, self.size)


@dataclass(frozen=True, eq=False)
class Part:
    """Rows whose columns are of the same kinds of unknowns.

    Attributes
    ----------
    count
        Number of rows.
    rows
        Indices of the rows of the block.
    segments
        Columns of nodes.
    shared
        (q,) positions of the border's columns.
    used
        (u,) the border's unknowns that occur.
    place
        (n, q) positions of the columns among these; None if they are all of them in order.
    """

    count: int
    rows: slice | Ints
    segments: tuple[Segment, ...]
    shared: Ints
    used: Ints
    place: Ints | None

    def select_border_columns(self, jacobian: Floats) -> Floats:
        """Return the (n, r, u) Jacobian by the border's unknowns that occur."""
        given = jacobian[:, :, self.shared]
        return given if self.place is None else add_columns(given, self.place, len(self.used))


def add_columns(given: Floats, place: Ints, size: int) -> Floats:
    """Add the columns of `given` (n, r, w) at `place` (n, w) of an array (n, r, size).

    Parameters
    ----------
    given
        (n, r, w).
    place
        (n, w) column of the result for each; one may occur twice in a row.
    size
        Number of columns of the result.
    """
    whole = np.zeros((*given.shape[:2], size))
    rows = np.arange(len(given))
    for column in range(place.shape[1]):  # one at a time: a row may name an unknown twice
        whole[rows, :, place[:, column]] += given[:, :, column]
    return whole


def split_into_parts(columns: Ints, structure: Structure) -> list[Part]:
    """Divide rows (n, k) of columns into parts of the same kinds."""
    kind = np.searchsorted([structure.first_block, structure.first_shared], columns, side="right")
    if (kind == kind[:1]).all():
        return [_part(slice(None), columns, kind[0], structure)] if len(kind) else []
    kinds, member = np.unique(kind, axis=0, return_inverse=True)
    rows = [np.flatnonzero(member.ravel() == i) for i in range(len(kinds))]
    return [_part(r, columns[r], k, structure) for r, k in zip(rows, kinds, strict=True)]


def _part(rows: slice | Ints, columns: Ints, kind: Ints, structure: Structure) -> Part:
    shared = np.flatnonzero(kind == BORDER)
    segments: list[Segment] = []
    position = 0
    while position < len(kind):
        here = int(kind[position])
        if here == BORDER:
            position += 1
            continue
        size, first = structure.sizes[here], (0, structure.first_block)[here]
        node = (columns[:, position] - first) // size
        # Extend the segment while the columns belong to the same node in every row.
        end = position + 1
        while end < len(kind) and kind[end] == here:
            if not np.array_equal((columns[:, end] - first) // size, node):
                break
            end += 1
        inside = columns[:, position:end] - first - node[:, None] * size
        complete = end - position == size and bool((inside == np.arange(size)).all())
        segments.append(
            Segment(here, node, slice(position, end), None if complete else inside, size)
        )
        position = end
    used, place = _border(columns[:, shared] - structure.first_shared)
    return Part(len(columns), rows, tuple(segments), shared, used, place)


def _border(columns: Ints) -> tuple[Ints, Ints | None]:
    if (columns == columns[:1]).all() and (np.diff(columns[0]) > 0).all():
        return columns[0], None
    used, place = np.unique(columns, return_inverse=True)
    return used, place.reshape(columns.shape)


CHUNK_SIZE = 250_000
"""Numbers gathered at a time: they stay in the processor's cache between gathering and use."""


class GroupedProducts:
    """Sums over groups g of left[i]^T right[j], for fixed triples (i, j, g).

    Groups with equal numbers of members form one batch of matrix products, so that only the
    gathered factors are in memory beside the result.

    Parameters
    ----------
    left, right
        (n,) indices of the matrices that are multiplied.
    group
        (n,) index of the sum that the product belongs to.
    """

    def __init__(self, left: Ints, right: Ints, group: Ints) -> None:
        order = np.argsort(group, kind="stable")
        target, start, count = np.unique(group[order], return_index=True, return_counts=True)
        self._batches: list[tuple[Ints, Ints, Ints]] = []
        for members in np.unique(count):
            chosen = np.flatnonzero(count == members)
            one = order[start[chosen][:, None] + np.arange(members)]
            self._batches.append((target[chosen], left[one], right[one]))

    def add(self, out: Floats, left: Floats, right: Floats) -> None:
        """Add each sum to its place in `out`.

        Parameters
        ----------
        out
            (groups, a, b), changed in place.
        left, right
            (n, r, a), (m, r, b).
        """
        rows, a, b = left.shape[1], left.shape[2], right.shape[2]
        for target, one, other in self._batches:
            step = max(1, CHUNK_SIZE // (one.shape[1] * rows * (a + b)))
            for start in range(0, len(target), step):
                part = slice(start, start + step)
                some = one[part]  # explicit sizes, as b may be zero
                first = left[some].reshape(len(some), one.shape[1] * rows, a)
                second = right[other[part]].reshape(len(some), one.shape[1] * rows, b)
                out[target[part]] += np.swapaxes(first, 1, 2) @ second


TABLE_KINDS = ((POINT, POINT), (POINT, BLOCK), (BLOCK, BLOCK))
"""Kinds of the two nodes of each table of pairs."""


class Pairs:
    """Stored blocks of a table.

    Attributes
    ----------
    first, second
        (n,) nodes, sorted by the first, then by the second; within one kind first <= second.

    Parameters
    ----------
    key
        Distinct first * width + second, sorted.
    width
        Number of nodes of the second kind.
    """

    def __init__(self, key: Ints, width: int) -> None:
        self._key = key
        self._width = max(width, 1)
        self.first, self.second = np.divmod(key, self._width)

    def __len__(self) -> int:
        return len(self._key)

    @property
    def key(self) -> Ints:
        """(n,) sorted first * width + second."""
        return self._key

    def find(self, first: Ints, second: Ints) -> Ints:
        """Return the positions of pairs.

        Raises
        ------
        LookupError
            One is not stored: its nodes share no observation.
        """
        key = first * self._width + second
        place = np.searchsorted(self._key, key)
        if len(key) and (place.max() == len(self._key) or (self._key[place] != key).any()):
            raise LookupError("unknowns that share no observation: use Factor.joint")
        return np.asarray(place)


@dataclass(frozen=True, eq=False)
class Pattern:
    """Pattern of a symmetric matrix, with all nodes' own blocks and all of the border.

    Attributes
    ----------
    structure
        Structure of the unknowns.
    pairs
        Stored blocks of the three tables.
    """

    structure: Structure
    pairs: tuple[Pairs, Pairs, Pairs]

    def own(self, kind: int) -> Ints:
        """Return the positions of the nodes' own blocks in their table."""
        node = np.arange(self.structure.counts[kind])
        return self.pairs[2 * kind].find(node, node)

    def zeros(self) -> BlockMatrix:
        """Return a zero matrix."""
        structure = self.structure
        size, count, border = structure.sizes, structure.counts, structure.border
        tables = tuple(
            np.zeros((len(pairs), size[one], size[other]))
            for pairs, (one, other) in zip(self.pairs, TABLE_KINDS, strict=True)
        )
        coupling = tuple(np.zeros((count[k], size[k], border)) for k in (POINT, BLOCK))
        return BlockMatrix(self, tables, coupling, np.zeros((border, border)))


@dataclass(frozen=True, eq=False)
class BlockMatrix:
    """Symmetric matrix on a pattern.

    Attributes
    ----------
    pattern
        Stored blocks.
    tables
        Of each pair, the block (n, a, b) with rows of the first and columns of the second node.
    coupling
        (K, s, border), (F, b, border): rows of points and of blocks, columns of the border.
    border
        (border, border).
    """

    pattern: Pattern
    tables: tuple[Floats, ...]
    coupling: tuple[Floats, ...]
    border: Floats

    def diagonal(self) -> Floats:
        """Return the (size,) diagonal."""
        own = [
            np.einsum("nii->ni", self.tables[2 * kind][self.pattern.own(kind)]).ravel()
            for kind in (POINT, BLOCK)
        ]
        return np.concatenate([*own, np.diag(self.border)])

    def scale_and_damp(self, scale: Floats, damping: float = 0.0) -> BlockMatrix:
        """Compute diag(scale) A diag(scale), with `damping` added to its diagonal."""
        point, block, border = (s[..., 0] for s in self.pattern.structure.split(scale[:, None]))
        node = (point, block)
        # Scale rows and columns of every block.
        tables = tuple(
            table * node[one][pairs.first][:, :, None] * node[other][pairs.second][:, None, :]
            for table, pairs, (one, other) in zip(
                self.tables, self.pattern.pairs, TABLE_KINDS, strict=True
            )
        )
        coupling = tuple(
            c * s[:, :, None] * border for c, s in zip(self.coupling, node, strict=True)
        )
        if damping:
            for kind in (POINT, BLOCK):
                size = self.pattern.structure.sizes[kind]
                tables[2 * kind][self.pattern.own(kind)] += damping * np.eye(size)
        corner = self.border * np.outer(border, border) + damping * np.eye(len(border))
        return BlockMatrix(self.pattern, tables, coupling, corner)

    def inner(self, other: BlockMatrix) -> float:
        """Sum the products of all entries, in both triangles, with those of another matrix.

        Parameters
        ----------
        other
            On the same pattern.
        """
        total = float(np.vdot(self.border, other.border))
        for mine, theirs in zip(self.coupling, other.coupling, strict=True):
            total += 2.0 * float(np.vdot(mine, theirs))
        for mine, theirs in zip(self.tables, other.tables, strict=True):
            total += 2.0 * float(np.vdot(mine, theirs))
        for kind in (POINT, BLOCK):
            own = self.pattern.own(kind)
            total -= float(np.vdot(self.tables[2 * kind][own], other.tables[2 * kind][own]))
        return total

    def gather(self, columns: Ints) -> Floats:
        """Return (n, k, k) dense parts, rows and columns given as (n, k) indices of unknowns.

        Raises
        ------
        LookupError
            Two of a group's unknowns are not on the pattern.
        """
        out = np.empty((*columns.shape, columns.shape[1]))
        for part in split_into_parts(columns, self.pattern.structure):
            out[part.rows] = self._gather(part, columns.shape[1])
        return out

    def _gather(self, part: Part, width: int) -> Floats:
        out = np.empty((part.count, width, width))
        for i, one in enumerate(part.segments):
            for other in part.segments[i:]:
                block = self._between(one, other)
                out[:, one.columns, other.columns] = block
                out[:, other.columns, one.columns] = np.swapaxes(block, 1, 2)
            rows = self.coupling[one.kind][:, :, part.used][one.node]
            block = _choose(rows, one.inside, part.place)
            out[:, one.columns, part.shared] = block
            out[:, part.shared, one.columns] = np.swapaxes(block, 1, 2)
        corner = self.border[part.used[:, None], part.used][None]
        if part.place is not None:
            corner = corner[0][part.place[:, :, None], part.place[:, None, :]]
        out[:, part.shared[:, None], part.shared] = corner
        return out

    def _between(self, one: Segment, other: Segment) -> Floats:
        """Return the (n, w, v) blocks between the unknowns of two segments."""
        if one.kind > other.kind:
            return np.swapaxes(self._between(other, one), 1, 2)
        number = one.kind + other.kind
        first, second, swapped = one.node, other.node, None
        if one.kind == other.kind:
            swapped = first > second
            first, second = np.minimum(first, second), np.maximum(first, second)
        block = self.tables[number][self.pattern.pairs[number].find(first, second)]
        if swapped is not None and swapped.any():
            block[swapped] = np.swapaxes(block[swapped], 1, 2)
        return _choose(block, one.inside, other.inside)


def add_weighted(weight: Floats, matrices: Sequence[BlockMatrix]) -> BlockMatrix:
    """Add matrices on one pattern, each times its weight (m,)."""

    def added(parts: Iterable[Floats]) -> Floats:
        return np.asarray(sum(w * part for w, part in zip(weight, parts, strict=True)))

    return BlockMatrix(
        matrices[0].pattern,
        tuple(map(added, zip(*(one.tables for one in matrices), strict=True))),
        tuple(map(added, zip(*(one.coupling for one in matrices), strict=True))),
        added(one.border for one in matrices),
    )


def _choose(block: Floats, rows: Ints | None, columns: Ints | None) -> Floats:
    if rows is not None:
        block = np.take_along_axis(block, rows[:, :, None], axis=1)
    return block if columns is None else np.take_along_axis(block, columns[:, None, :], axis=2)


@dataclass(frozen=True, eq=False)
class _Term:
    """Product of two segments of one part, and its position."""

    one: Segment
    other: Segment
    table: int
    sums: GroupedProducts


class Assembly:
    """Assembly of J^T J for groups of rows with fixed columns.

    Parameters
    ----------
    columns
        For each group, (n, k) the unknown of each Jacobian column.
    structure
        Structure of the unknowns.
    """

    def __init__(self, columns: list[Ints], structure: Structure) -> None:
        self._columns = columns
        self._parts = [split_into_parts(c, structure) for c in columns]
        self.pattern = _make_pattern([p for parts in self._parts for p in parts], structure)
        self._terms = [[_make_terms(part, self.pattern) for part in parts] for parts in self._parts]
        self._coupling = [
            [[_group_by_node(segment) for segment in part.segments] for part in parts]
            for parts in self._parts
        ]

    def serves(self, columns: list[Ints]) -> bool:
        """Return whether these are the columns that it was made for."""
        return len(columns) == len(self._columns) and all(
            mine is theirs or np.array_equal(mine, theirs)
            for mine, theirs in zip(self._columns, columns, strict=True)
        )

    def normal(self, jacobians: Sequence[Floats | None]) -> BlockMatrix:
        """Compute J^T J of the groups' Jacobians (n, r, k); None for groups that add nothing."""
        matrix = self.pattern.zeros()
        for jacobian, parts, terms, by_node in zip(
            jacobians, self._parts, self._terms, self._coupling, strict=True
        ):
            if jacobian is None:
                continue
            for part, products, coupled in zip(parts, terms, by_node, strict=True):
                rows = jacobian[part.rows]
                for term in products:
                    one, other = term.one.whole(rows), term.other.whole(rows)
                    term.sums.add(matrix.tables[term.table], one, other)
                if len(part.shared):
                    _add_border(matrix, part, rows, coupled)
        return matrix


def _add_border(
    matrix: BlockMatrix, part: Part, rows: Floats, coupled: list[GroupedProducts]
) -> None:
    used, border = part.used, part.select_border_columns(rows)
    flat = border.reshape(-1, len(used))
    matrix.border[used[:, None], used] += flat.T @ flat
    for segment, sums in zip(part.segments, coupled, strict=True):
        coupling = matrix.coupling[segment.kind]
        added = np.zeros((*coupling.shape[:2], len(used)))
        sums.add(added, segment.whole(rows), border)
        coupling[:, :, used] += added


def _group_by_node(segment: Segment) -> GroupedProducts:
    rows = np.arange(len(segment.node))
    return GroupedProducts(rows, rows, segment.node)


def _make_pattern(parts: list[Part], structure: Structure) -> Pattern:
    count = structure.counts
    keys: list[list[Ints]] = [[], [], []]
    for kind in (POINT, BLOCK):
        node = np.arange(count[kind])
        keys[2 * kind].append(node * max(count[kind], 1) + node)
    # Every two nodes that occur in one row are coupled.
    for part in parts:
        for i, one in enumerate(part.segments):
            for other in part.segments[i + 1 :]:
                first, second = (one, other) if one.kind <= other.kind else (other, one)
                a, b = first.node, second.node
                if one.kind == other.kind:
                    a, b = np.minimum(a, b), np.maximum(a, b)
                keys[one.kind + other.kind].append(a * max(count[second.kind], 1) + b)
    merged = [np.unique(np.concatenate(k)) if k else np.zeros(0, dtype=np.int64) for k in keys]
    return Pattern(
        structure,
        (Pairs(merged[0], count[0]), Pairs(merged[1], count[1]), Pairs(merged[2], count[1])),
    )


def _make_terms(part: Part, pattern: Pattern) -> list[_Term]:
    terms = []
    for i, one in enumerate(part.segments):
        for other in part.segments[i:]:
            if one is other:
                rows = np.arange(len(one.node))
                terms.append(_make_term(one, other, rows, pattern))
            elif one.kind != other.kind:
                first, second = (one, other) if one.kind < other.kind else (other, one)
                terms.append(_make_term(first, second, np.arange(len(one.node)), pattern))
            else:  # both orders, as a row may name one node twice: symmetric sum
                for first, second in ((one, other), (other, one)):
                    rows = np.flatnonzero(first.node <= second.node)
                    terms.append(_make_term(first, second, rows, pattern))
    return terms


def _make_term(one: Segment, other: Segment, rows: Ints, pattern: Pattern) -> _Term:
    table = one.kind + other.kind
    group = pattern.pairs[table].find(one.node[rows], other.node[rows])
    return _Term(one, other, table, GroupedProducts(rows, rows, group))
