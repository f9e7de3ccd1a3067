"""Wanted measurements of a plan, and possible ends of reference lines."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from uavgram.geometry.ground.figures import contains, crosses, find_long_axis
from uavgram.model.arrays import Bools, Floats, Ints
from uavgram.model.observations import MeasurementRequest
from uavgram.synthetic.plan.scene import PlanScene

MAX_SPOTS = 340
STEP_M = 2.0
MIN_CELLS_IN_LINE = 3.0
"""Smallest length of the longest line in grid steps; else hardly any line would be that long."""

RING, RIM = 8, 0.97
"""Number of points on a ring, and its diameter relative to the longest line."""

EDGE_DISTANCE_M = 1.2
"""Distance of line ends from the edge of a scene, where taping is impractical [m]."""


def make_grid(area_m: Floats, step_m: float, from_edge_m: float = 0.0) -> Floats:
    """Return a (N, 2) square grid in a polygon, along its longer side, centred between its edges.

    Parameters
    ----------
    area_m
        (V, 2) the polygon.
    step_m
        Largest distance from node to node.
    from_edge_m
        Margin at the edges of its smallest rectangle.
    """
    middle, axis, size = find_long_axis(area_m)
    room = np.maximum(size - 2.0 * from_edge_m, 0.0)
    count = np.maximum(np.ceil(room / step_m - 1e-9).astype(int), 1)
    along, across = (np.linspace(-r / 2, r / 2, n + 1) for r, n in zip(room, count, strict=True))
    x, y = (part.ravel() for part in np.meshgrid(along, across, indexing="ij"))
    point = middle + x[:, None] * axis + y[:, None] * np.array([-axis[1], axis[0]])
    return np.asarray(point[contains(area_m, point)])


def make_spots(
    area_m: Floats, no_go_m: tuple[Floats, ...], longest_m: float, most: int = MAX_SPOTS
) -> Floats:
    """Return (N, 2) possible line ends: a grid; in a large area, rings about the nodes of one.

    Parameters
    ----------
    area_m, no_go_m
        (V, 2), (v, 2) polygons: the area, and no-go areas.
    longest_m
        Longest line.
    most
        Approximate number of ends.
    """
    size = find_long_axis(area_m)[2]
    edge = min(EDGE_DISTANCE_M, 0.1 * float(size.min()))
    step = max(min(STEP_M, 0.2 * float(size.min())), float(np.sqrt(size.prod() / most)))
    if step * MIN_CELLS_IN_LINE <= longest_m:
        point = make_grid(area_m, step, edge)
    else:
        turn = 2.0 * np.pi * np.arange(RING) / RING
        ring = 0.5 * RIM * longest_m * np.column_stack([np.cos(turn), np.sin(turn)])
        middle = make_grid(area_m, step * float(np.sqrt(RING)), 0.5 * longest_m)
        point = (middle[:, None] + ring).reshape(-1, 2)
        point = point[contains(area_m, point)]
    for polygon in no_go_m:
        point = point[~contains(polygon, point)]
    return point


def join_spots(
    spot_m: Floats,
    no_go_m: tuple[Floats, ...],
    seen_together: Bools,
    lengths_m: tuple[float, float],
) -> Ints:
    """Return (N, 2) pairs of ends that a line can join.

    Parameters
    ----------
    spot_m
        (K, 3) points on the ground, along which the tape is laid.
    no_go_m
        Polygons that no tape may cross.
    seen_together
        (K, K) whether a photo shows both for certain.
    lengths_m
        Shortest and longest line.
    """
    first, second = np.triu_indices(len(spot_m), k=1)
    length = np.linalg.norm(spot_m[second] - spot_m[first], axis=1)
    fits = (length >= lengths_m[0]) & (length <= lengths_m[1]) & seen_together[first, second]
    first, second = first[fits], second[fits]
    for polygon in no_go_m:
        free = ~crosses(polygon, spot_m[first, :2], spot_m[second, :2])
        first, second = first[free], second[free]
    return np.stack([first, second], axis=1)


LENGTH_M = 10.0
"""Length whose standard deviation is mapped; shorter in a small area."""


class WantedValues(NamedTuple):
    """Requests, and their points: (K,) labels, (K, 2) positions."""

    requests: tuple[MeasurementRequest, ...]
    label: tuple[str, ...]
    point_m: Floats


class Map(NamedTuple):
    """Lengths over an area: two requests for each cell, to the east and to the north.

    Attributes
    ----------
    middle_m
        (N, 2) of the cells.
    cell_m, length_m
        Side of a cell; length of each.
    wanted
        2N requests, those of a cell one after the other.
    """

    middle_m: Floats
    cell_m: float
    length_m: float
    wanted: WantedValues


def make_lengths(area_m: Floats, cells: int) -> Map:
    """Return lengths centred on about `cells` cells of an area (V, 2)."""
    _, _, size = find_long_axis(area_m)
    cell = float(np.sqrt(size.prod() / cells))
    middle = make_grid(area_m, cell, min(0.5 * cell, 0.45 * float(size.min())))
    length = min(LENGTH_M, 0.3 * float(size.min()))
    reach = 0.5 * length * np.array([[-1, 0], [1, 0], [0, -1], [0, 1]])
    names = [(f"cell{i}w", f"cell{i}e", f"cell{i}s", f"cell{i}n") for i in range(len(middle))]
    requests = tuple(
        MeasurementRequest(name=f"{a} {b}", kind="distance", points=(a, b))
        for w, e, s, n in names
        for a, b in ((w, e), (s, n))
    )
    label = tuple(name for four in names for name in four)
    point = _move_inside(area_m, middle[:, None, None] + reach.reshape(2, 2, 2)).reshape(-1, 2)
    return Map(middle, cell, length, WantedValues(requests, label, point))


def compute_equal_weights(kind: Sequence[str], unit: Sequence[str]) -> Floats:
    """Return (M,) weights for a plain mean of lengths' sigmas; of all values without lengths.

    Coordinates are not lengths: their sigmas are those of the log, metres that no line changes.
    """
    pairs = zip(kind, unit, strict=True)
    counted = np.array([one == "m" and what != "coordinate" for what, one in pairs])
    counted = counted if counted.any() else np.ones(len(counted), dtype=np.bool_)
    return np.asarray(counted / counted.sum())


def _move_inside(area_m: Floats, ends: Floats) -> Floats:
    """Shift lengths (N, 2, 2, 2) along themselves into the area, where they fit into it."""
    along = ends[:, :, 1] - ends[:, :, 0]
    inside = np.zeros(ends.shape[:2], dtype=np.bool_)
    moved = ends.copy()
    for share in (0.0, 0.25, -0.25, 0.5, -0.5):
        tried = ends + share * along[:, :, None]
        fits = contains(area_m, tried.reshape(-1, 2)).reshape(*ends.shape[:2], 2).all(axis=2)
        moved = np.where((fits & ~inside)[..., None, None], tried, moved)
        inside |= fits
    return moved


def list_wanted(scene: PlanScene) -> WantedValues:
    """Return the requests of a scene; lengths all over its area if it has none."""
    if scene.requests:
        return WantedValues(scene.requests, scene.label, scene.point_m)
    return make_lengths(scene.area_m, MAX_CELLS).wanted


MAX_CELLS = 30
"""Number of map cells that represent an area while lines are chosen."""
