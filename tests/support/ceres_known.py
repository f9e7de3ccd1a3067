"""Known things as residuals, written anew from their description: what Ceres is given."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise
from typing import Any

import numpy as np

from uavgram.model.arrays import Floats
from uavgram.model.observations import KnownThing


def residuals(thing: KnownThing, points: Floats, feet: Floats, *, on_ground: bool) -> Floats:
    """(r,) by how much a thing is not as it is known to be, in its sigmas.

    Where the package has the two components of an offset, here are the three of a cross product:
    the sum of their squares is the same.

    Parameters
    ----------
    thing
        What is known.
    points, feet
        (k, 3) its points, and the ground straight below them.
    on_ground
        Whether all points lie on the ground, where an offset across it means nothing.
    """
    if thing.kind == "collinear":
        first, *between, last = points
        off = [_offset(one, first, last, on_ground=on_ground) for one in between]
        departure = np.concatenate(off)
    elif thing.kind == "line_distance" and thing.value == 0:
        departure = _offset(*points, on_ground=on_ground)
    elif thing.kind in _CONDITIONS:
        departure = np.atleast_1d(_CONDITIONS[thing.kind](points, on_ground))
    else:
        departure = np.atleast_1d(_VALUES[thing.kind](points, feet) - thing.value)
    return np.asarray(departure / thing.sigma)


def _offset(point: Floats, start: Floats, end: Floats, *, on_ground: bool) -> Floats:
    """From the line of two others."""
    line, away = end - start, point - start
    if on_ground:
        across = line[0] * away[1] - line[1] * away[0]
        return np.array([across / np.hypot(line[0], line[1])])
    return np.cross(away, line) / np.linalg.norm(line)


def _angle(points: Floats) -> float:
    one, other = points[0] - points[1], points[2] - points[1]
    return float(np.degrees(np.arctan2(np.linalg.norm(np.cross(one, other)), one @ other)))


def _parallel(points: Floats, on_ground: bool) -> Floats:  # noqa: FBT001
    line, second = points[1] - points[0], points[3] - points[2]
    left = np.cross([0.0, 0.0, 1.0], line)
    upward = np.cross(line, left)
    axes = [left] if on_ground else [left, upward]
    ahead = second @ line / np.linalg.norm(line)
    aside = np.array([second @ axis / np.linalg.norm(axis) for axis in axes])
    return np.asarray(np.degrees(np.arctan(aside / ahead)))


def _heights(points: Floats) -> Floats:
    """Over the plane of the first three, which look upwards."""
    normal = np.cross(points[1] - points[0], points[2] - points[0])
    return np.asarray((points[3:] - points[0]) @ normal / np.linalg.norm(normal))


def _lengths(points: Floats) -> Floats:
    return np.asarray(np.linalg.norm(points[1::2] - points[::2], axis=1))


def _area(points: Floats) -> float:
    sides = np.cross(points, np.roll(points, -1, axis=0))
    return float(np.linalg.norm(sides.sum(axis=0)) / 2)


_CONDITIONS: dict[str, Callable[[Floats, bool], Any]] = {
    "right_angle": lambda p, _: 90.0 - _angle(p),
    "parallel": _parallel,
    "coplanar": lambda p, _: _heights(p),
    "level": lambda p, _: p[1:, 2] - p[0, 2],
    "vertical": lambda p, _: p[1, :2] - p[0, :2],
    "equal_lengths": lambda p, _: _lengths(p)[1:] - _lengths(p)[0],
}

_VALUES: dict[str, Callable[[Floats, Floats], Any]] = {
    "distance": lambda p, _: np.linalg.norm(p[1] - p[0]),
    "polyline": lambda p, _: sum(np.linalg.norm(b - a) for a, b in pairwise(p)),
    "area": lambda p, _: _area(p),
    "azimuth": lambda p, _: np.degrees(np.arctan2(*(p[1] - p[0])[:2])),
    "angle": lambda p, _: _angle(p),
    "line_distance": lambda p, _: np.linalg.norm(_offset(*p, on_ground=False)),
    "height": lambda p, feet: p[0, 2] - feet[0, 2] if len(p) == 1 else p[1, 2] - p[0, 2],
    "horizontal_distance": lambda p, _: np.hypot(*(p[1] - p[0])[:2]),
    "vertical_distance": lambda p, _: p[1, 2] - p[0, 2],
    "slope": lambda p, _: np.degrees(np.arctan2(p[1, 2] - p[0, 2], np.hypot(*(p[1] - p[0])[:2]))),
    "plane_distance": lambda p, _: _heights(np.roll(p, -1, axis=0))[0],
}
