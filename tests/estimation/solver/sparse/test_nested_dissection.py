"""Separators separate, all of the graph is kept, and on a grid they are about as short as it is."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.sparse as sp
from scipy.sparse import csr_matrix
from scipy.spatial import cKDTree

from uavgram.estimation.solver.sparse.nested_dissection import LEAF_SIZE, dissect
from uavgram.model.arrays import Floats, Ints


def graph_of(points: Floats | Ints, radius: float) -> csr_matrix:
    pairs = cKDTree(points).query_pairs(radius, output_type="ndarray")
    ends = (np.concatenate(pairs.T), np.concatenate(pairs[:, ::-1].T))
    return sp.csr_matrix((np.ones(2 * len(pairs)), ends), shape=(len(points),) * 2)


def grid(width: int, height: int) -> Ints:
    return np.stack(np.meshgrid(np.arange(width), np.arange(height)), -1).reshape(-1, 2)


GRAPHS = {
    "grid": graph_of(grid(30, 20), 1.5),
    "strip": graph_of(grid(300, 2), 1.5),
    "two parts": graph_of(np.concatenate([grid(12, 12), grid(9, 9) + 100]), 1.5),
    "scattered": graph_of(np.random.default_rng(0).uniform(0, 20, (600, 2)), 1.6),
    "complete": sp.csr_matrix(1.0 - np.eye(60)),
    "star": sp.csr_matrix(
        ([1.0] * 118, ([0] * 59 + list(range(1, 60)), [*range(1, 60)] + [0] * 59))
    ),
    "no edges": sp.csr_matrix((50, 50)),
    "nothing": sp.csr_matrix((0, 0)),
}


@pytest.mark.parametrize("graph", GRAPHS.values(), ids=GRAPHS.keys())
def test_every_block_is_in_one_node_and_edges_lead_only_to_ancestors(graph: csr_matrix) -> None:
    nodes = dissect(graph)

    own = np.concatenate([node.own for node in nodes])
    np.testing.assert_array_equal(np.sort(own), np.arange(graph.shape[0]))
    assert nodes[-1].parent == -1
    ancestors: list[set[int]] = [set() for _ in nodes]
    for position in range(len(nodes) - 2, -1, -1):
        above = nodes[position].parent
        assert above > position
        ancestors[position] = ancestors[above] | {above}
    home = np.empty(graph.shape[0], dtype=int)
    for position, node in enumerate(nodes):
        home[node.own] = position
    for one, other in zip(*graph.nonzero(), strict=True):
        a, b = home[one], home[other]
        assert a == b or a in ancestors[b] or b in ancestors[a]


def test_the_first_separator_of_a_grid_is_hardly_longer_than_its_short_side() -> None:
    nodes = dissect(GRAPHS["grid"])
    assert len(nodes[-1].own) <= 1.25 * 20
    assert max(len(node.own) for node in nodes[:-1]) <= max(LEAF_SIZE, 20)


def test_a_strip_falls_apart_at_a_few_blocks() -> None:
    nodes = dissect(GRAPHS["strip"])
    parents = {node.parent for node in nodes}
    assert all(len(nodes[i].own) <= 4 for i in parents if i >= 0)
