"""Draw: the polyline that shows a measurement of each kind."""

from __future__ import annotations

import numpy as np

from uavgram.model.arrays import Floats

ENCLOSED = frozenset({"area", "volume"})
"""Kinds of measurement that are drawn as what their points enclose."""


def shape(kind: str, corners: Floats) -> list[Floats]:
    """(n, 3) polylines of a measurement on its corners (k, 3); one point alone has none."""
    if kind == "coordinate" or len(corners) < 2:
        return []
    if kind in ENCLOSED:
        return [np.concatenate([corners, corners[:1]])]
    if kind == "plane_distance" and len(corners) == 4:
        return [np.stack([corners[0], _foot_on_plane(corners)])]
    if kind == "line_distance" and len(corners) > 2:
        start, end = corners[1], corners[-1]
        along = end - start
        squared = float(along @ along)
        share = float((corners[0] - start) @ along) / squared if squared > 0 else 0.0
        return [np.stack([corners[0], start + share * along])]
    return [corners]


def _foot_on_plane(corners: Floats) -> Floats:
    """(3,) place on the plane through the last three of four points nearest to the first."""
    across = np.cross(corners[2] - corners[1], corners[3] - corners[1])
    squared = float(across @ across)
    share = float((corners[0] - corners[1]) @ across) / squared if squared > 0 else 0.0
    return np.asarray(corners[0] - share * across)


def counterclockwise(ring: Floats) -> Floats:
    """The ring (v, 3), seen from above against the clock (shoelace formula)."""
    east, north = (ring[:, :2] - ring[0, :2]).T
    doubled = float(np.sum(east * np.roll(north, -1) - np.roll(east, -1) * north))
    return ring[::-1].copy() if doubled < 0 else ring
