"""Elimination order of a sparse symmetric system: a tree of separators over its block graph.

George 1973, "Nested dissection of a regular finite element mesh". Only the graph is needed:
distances in it from a few far nodes replace a geometry, and a smallest vertex cover of the edges
between two halves is the separator.

A block-tridiagonal factorisation in the order of the flight would be a tenth of the code. It is as
fast at 100 frames, 2 to 3 times slower at 500 and at 2,000, and its band widens where a flight
crosses its own path: nested dissection is kept while surveys of thousands of frames are a goal. On
a graph of n blocks with separators of O(sqrt(n)) the factor has O(n log n) blocks and costs
O(n^1.5) (George 1973; Lipton, Rose and Tarjan 1979, "Generalized nested dissection").
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import (
    breadth_first_order,
    connected_components,
    dijkstra,
    maximum_bipartite_matching,
)

from uavgram.model.arrays import Bools, Floats, Ints

LEAF_SIZE = 48
"""Number of blocks up to which a part is eliminated as a whole."""

CUT_SHARES = (0.4, 0.5, 0.6)
"""Shares of a part on one side of the cuts that are tried."""

MIN_SHARE = 0.2
"""Smallest share of a part on each side of its separator."""

SMOOTHING_COUNT = 5
"""Number of times that a direction is averaged over neighbours: distances are whole numbers of
edges, cuts need finer ones."""


@dataclass(frozen=True, eq=False)
class Node:
    """Set of blocks that is eliminated together, after its children.

    Attributes
    ----------
    own
        Blocks of the graph.
    parent
        Position of the parent in the list of nodes; -1 for the root.
    """

    own: Ints
    parent: int


def dissect(graph: sp.csr_matrix) -> list[Node]:
    """Compute the elimination tree in postorder: children before parents, the root last.

    Parameters
    ----------
    graph
        (n, n) symmetric adjacency of the blocks, without loops; all its values are 1.

    Returns
    -------
    list of Node
        Every block in exactly one; the root may be empty (a graph in several parts).
    """
    found: list[tuple[Ints, list[int]]] = []
    root = _dissect(graph, np.arange(graph.shape[0]), found)
    parent = np.full(len(found), -1)
    for position, (_, children) in enumerate(found):
        parent[children] = position
    assert root == len(found) - 1  # noqa: S101  (the recursion appends a node after its children)
    return [Node(own, int(parent[i])) for i, (own, _) in enumerate(found)]


def _dissect(graph: sp.csr_matrix, part: Ints, found: list[tuple[Ints, list[int]]]) -> int:
    """Append the nodes of `part` and return the position of its top."""
    separator: Ints = part
    sides: list[Ints] = []
    if len(part) > LEAF_SIZE:
        separator, sides = _split(graph[part][:, part].tocsr(), part)
    children = [_dissect(graph, side, found) for side in sides]
    found.append((separator, children))
    return len(found) - 1


def _split(graph: sp.csr_matrix, part: Ints) -> tuple[Ints, list[Ints]]:
    """Return separator and sides of a part; all of it and no sides if no separator halves it."""
    count, found = connected_components(graph, directed=False)
    member: Ints = found.astype(np.int64)
    if count > 1:
        side = _balance(member, count)
        return part[:0], [part[side], part[~side]]
    row: Ints = np.repeat(np.arange(len(part)), np.diff(graph.indptr))
    column: Ints = graph.indices.astype(np.int64)
    # Of all cuts take the one with the smallest end of crossing edges; its cover separates.
    cuts = []
    for side in _sides(graph):
        crossing = side[row] & ~side[column]
        cuts.append((row[crossing], column[crossing], side))
    left, right, side = min(cuts, key=lambda cut: min(len(np.unique(end)) for end in cut[:2]))
    separator = _cover(left, right)
    rest = np.ones(len(part), dtype=bool)
    rest[separator] = False
    sides = [part[side & rest], part[~side & rest]]
    if min(map(len, sides)) < MIN_SHARE * len(part):
        return part, []
    return part[separator], sides


def _balance(member: Ints, count: int) -> Bools:
    """Assign components to two sides of about one size: the largest first, to the lighter side."""
    sizes = np.bincount(member)
    side = np.zeros(count, dtype=bool)
    weight = np.zeros(2, dtype=int)
    for component in np.argsort(sizes)[::-1]:
        lighter = int(weight[1] < weight[0])
        side[component] = bool(lighter)
        weight[lighter] += int(sizes[component])
    return np.asarray(side[member])


def _sides(graph: sp.csr_matrix) -> Iterator[Bools]:
    """Yield one side each of some cuts through a connected graph.

    The difference of the distances from two opposite ends is a direction. Ends are in corners, so
    that such directions run diagonally; their sum and difference run along the sides.
    """
    far = _distance(graph, int(np.argmin(np.diff(graph.indptr))))
    one = _distance(graph, int(far.argmax()))
    other = _distance(graph, int(one.argmax()))
    middle = _distance(graph, int((one + other).argmax()))
    opposite = _distance(graph, int((middle + np.minimum(one, other)).argmax()))
    neighbours = sp.diags_array(1.0 / np.diff(graph.indptr)) @ graph
    along, across = one - other, middle - opposite
    for direction in (along + across, along - across):
        smooth = direction
        for _ in range(SMOOTHING_COUNT):
            smooth = neighbours @ smooth
        for limit in np.quantile(smooth, CUT_SHARES):
            yield smooth <= limit


def _distance(graph: sp.csr_matrix, start: int) -> Floats:
    """Compute the number of edges from one block to each other."""
    return np.asarray(dijkstra(graph, indices=[start], unweighted=True)[0])


def _cover(left: Ints, right: Ints) -> Ints:
    """Find the fewest blocks that touch all edges from left to right ones.

    König 1931: in a bipartite graph they are as many as the edges of a maximum matching: the left
    nodes that no alternating path from an unmatched left node reaches, and the right ones that one
    does.
    """
    lefts, row = np.unique(left, return_inverse=True)
    rights, column = np.unique(right, return_inverse=True)
    count, source = len(lefts), len(lefts) + len(rights)
    edges = sp.csr_matrix((np.ones(len(row)), (row, column)), shape=(count, len(rights)))
    match = maximum_bipartite_matching(edges, perm_type="column")
    matched, free = np.flatnonzero(match >= 0), np.flatnonzero(match < 0)
    tail = np.concatenate([row, count + match[matched], np.full(len(free), source)])
    head = np.concatenate([count + column, matched, free])
    paths = sp.csr_matrix((np.ones(len(tail)), (tail, head)), shape=(source + 1, source + 1))
    reached = np.zeros(source + 1, dtype=bool)
    reached[breadth_first_order(paths, source, return_predecessors=False)] = True
    return np.concatenate([lefts[~reached[:count]], rights[reached[count:source]]])
