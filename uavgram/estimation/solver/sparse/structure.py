"""Structure of the unknowns of a survey, and the kinds of unknowns of a Jacobian's columns.

An unknown belongs to a point, to a block (a frame) or to the border that all observations share.
Points and blocks are nodes, whose entries are kept in dense matrices of their size.
"""

from __future__ import annotations

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
