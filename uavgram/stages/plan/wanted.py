"""What a plan is to make well known: measurements, or lengths all over the area."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from uavgram.geometry.ground.polygons import contains, long_axis
from uavgram.model.arrays import Floats
from uavgram.model.survey.observations import MeasurementRequest
from uavgram.stages.plan.scene import PlanScene
from uavgram.stages.plan.spots import grid_in

LENGTH_M = 10.0
"""Of the lengths whose standard deviation a map tells; shorter in a small area."""


class Wanted(NamedTuple):
    """Requests, and the points they name: (K,) labels, (K, 2) places."""

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
    wanted: Wanted


def lengths_over(area_m: Floats, cells: int) -> Map:
    """Lengths about the middles of some `cells` cells of an area (V, 2)."""
    _, _, size = long_axis(area_m)
    cell = float(np.sqrt(size.prod() / cells))
    middle = grid_in(area_m, cell, min(0.5 * cell, 0.45 * float(size.min())))
    length = min(LENGTH_M, 0.3 * float(size.min()))
    reach = 0.5 * length * np.array([[-1, 0], [1, 0], [0, -1], [0, 1]])
    names = [(f"cell{i}w", f"cell{i}e", f"cell{i}s", f"cell{i}n") for i in range(len(middle))]
    requests = tuple(
        MeasurementRequest(name=f"{a} {b}", kind="distance", points=(a, b))
        for w, e, s, n in names
        for a, b in ((w, e), (s, n))
    )
    label = tuple(name for four in names for name in four)
    point = _moved_in(area_m, middle[:, None, None] + reach.reshape(2, 2, 2)).reshape(-1, 2)
    return Map(middle, cell, length, Wanted(requests, label, point))


def equal_weights(kind: Sequence[str], unit: Sequence[str]) -> Floats:
    """(M,) weights for a plain mean of lengths' sigmas; of all values where there is no length.

    Coordinates are no lengths: their sigmas are those of the log, metres that no line changes.
    """
    pairs = zip(kind, unit, strict=True)
    counted = np.array([one == "m" and what != "coordinate" for what, one in pairs])
    counted = counted if counted.any() else np.ones(len(counted), dtype=np.bool_)
    return np.asarray(counted / counted.sum())


def _moved_in(area_m: Floats, ends: Floats) -> Floats:
    """Lengths (N, 2, 2, 2) moved along themselves into the area, where they fit into it."""
    along = ends[:, :, 1] - ends[:, :, 0]
    inside = np.zeros(ends.shape[:2], dtype=np.bool_)
    moved = ends.copy()
    for share in (0.0, 0.25, -0.25, 0.5, -0.5):
        tried = ends + share * along[:, :, None]
        fits = contains(area_m, tried.reshape(-1, 2)).reshape(*ends.shape[:2], 2).all(axis=2)
        moved = np.where((fits & ~inside)[..., None, None], tried, moved)
        inside |= fits
    return moved


def wanted_of(scene: PlanScene) -> Wanted:
    """What a scene asks for; lengths all over its area where it asks for nothing."""
    if scene.requests:
        return Wanted(scene.requests, scene.label, scene.point_m)
    return lengths_over(scene.area_m, MOST_CELLS).wanted


MOST_CELLS = 30
"""Of the map that stands for a whole area while lines are chosen."""
