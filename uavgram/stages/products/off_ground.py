"""Draw: how high points and shapes stand over the ground."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from uavgram.model.arrays import Floats
from uavgram.model.maps.layers import Layer
from uavgram.model.result.tables import PointResults

HEIGHT_COLUMNS = ("height_above_ground_m", "height_sigma_m")
"""Numbers of a point's height that maps and drawings carry."""


def ground_below(points: PointResults) -> Floats:
    """(K, 3) places on the ground straight below the points; their own where they stand on it."""
    feet = np.array(points.position_world_m)
    feet[:, 2] -= np.nan_to_num(points.height_above_ground_m)
    return feet


def over_ground(
    points: PointResults, shapes: Sequence[Floats], labels: Sequence[Sequence[str]]
) -> tuple[Floats, ...]:
    """How high the vertices of shapes stand over the ground; empty where all lie on it.

    A vertex that is no point of the shape, such as a foot, is taken to have the ground of the
    nearest one.

    Parameters
    ----------
    points
        All points.
    shapes
        (v, 3) vertices of each shape; v = 0 where it has no place.
    labels
        Points of each shape.

    Returns
    -------
    (v,)
        For each shape [m].
    """
    rows = {label: k for k, label in enumerate(points.label)}
    off, feet = points.is_off_ground, ground_below(points)
    if not any(off[rows[label]] for names in labels for label in names if label in rows):
        return ()
    above = []
    for vertices, names in zip(shapes, labels, strict=True):
        if not len(vertices):
            above.append(np.zeros(0))
            continue
        below = feet[[rows[label] for label in names]]
        apart = np.linalg.norm(vertices[:, None, :2] - below[None, :, :2], axis=2)
        above.append(vertices[:, 2] - below[apart.argmin(axis=1), 2])
    return tuple(above)


def verticals(points: PointResults) -> Layer:
    """From the ground up to each point that stands off it."""
    rows, feet = np.flatnonzero(points.is_off_ground), ground_below(points)
    return Layer(
        name="verticals",
        kind="line",
        vertices_m=tuple(np.stack([feet[k], points.position_world_m[k]]) for k in rows),
        attributes={
            "label": tuple(points.label[k] for k in rows),
            **{name: tuple(getattr(points, name)[rows].tolist()) for name in HEIGHT_COLUMNS},
            "height_source": tuple(points.height_source[k] for k in rows),
        },
        above_ground_m=tuple(np.array([0.0, points.height_above_ground_m[k]]) for k in rows),
    )
