"""Elimination order of a sparse symmetric system: a tree of separators over its block graph.

George 1973, "Nested dissection of a regular finite element mesh"; separators from level sets of a
breadth-first search (George and Liu 1978), so that only the graph is needed, not its geometry.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import connected_components, dijkstra

from uavgram.model.arrays import Floats, Ints

LEAF = 24
"""Blocks up to which a part is eliminated as a whole."""

BALANCE = (0.25, 0.75)
"""Share of a part that may lie on one side of its separator."""


@dataclass(frozen=True, eq=False)
class Node:
    """A set of blocks that is eliminated together, after its children.

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
    """Nodes of the elimination tree, children before parents; the root stands last.

    Parameters
    ----------
    graph
        (n, n) symmetric adjacency of the blocks; its values mean nothing.

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
    if len(part) > LEAF:
        separator, sides = _split(graph[part][:, part], part)
    children = [_dissect(graph, side, found) for side in sides]
    found.append((separator, children))
    return len(found) - 1


def _split(graph: sp.csr_matrix, part: Ints) -> tuple[Ints, list[Ints]]:
    """Separator and sides of a part; all of it and nothing where no level set halves it."""
    count, member = connected_components(graph, directed=False)
    if count > 1:
        order = np.argsort(np.bincount(member))[::-1]
        side = np.zeros(count, dtype=bool)
        sizes = np.zeros(2, dtype=int)
        for component in order:  # largest first onto the lighter side
            lighter = int(sizes[1] < sizes[0])
            side[component] = bool(lighter)
            sizes[lighter] += int(np.sum(member == component))
        return part[:0], [part[side[member]], part[~side[member]]]
    start = int(np.argmin(np.diff(graph.indptr)))
    for _ in range(2):  # from end to end: the second search starts at the farthest block
        distance: Floats = dijkstra(graph, indices=[start], unweighted=True)
        level = distance[0].astype(np.int64)
        start = int(level.argmax())
    sizes = np.bincount(level)
    below = np.cumsum(sizes) - sizes
    share = (below + sizes / 2) / len(part)
    allowed = np.flatnonzero((share > BALANCE[0]) & (share < BALANCE[1]))
    allowed = allowed[(allowed > 0) & (allowed < len(sizes) - 1)]
    if not allowed.size:
        return part, []
    cut = allowed[np.argmin(sizes[allowed])]
    return part[level == cut], [part[level < cut], part[level > cut]]
