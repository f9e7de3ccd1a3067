"""Known things as rows of numbers that should be zero: functions of their points, with gradients.

They are the functions of the measurements less the known value, and those of the conditions. Where
a value is zero, a distance from a line has no derivative: its offset, a signed number or a vector,
stands for it.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from uavgram.geometry.ground import conditions, shapes
from uavgram.model.arrays import Floats
from uavgram.model.survey.known import KnownThing

_FLAT = {"collinear": conditions.collinear, "parallel": conditions.parallel}
"""Conditions of which on the ground only what is along it counts."""

_CONDITIONS = {
    "right_angle": conditions.right_angle,
    "coplanar": conditions.coplanar,
    "level": conditions.level,
    "vertical": conditions.vertical,
    "equal_lengths": conditions.equal_lengths,
}


class Departures(NamedTuple):
    """Of r rows of a known thing of k points: by how much it is not so.

    Attributes
    ----------
    value
        (r,) function less known value, in the unit of the thing's sigma.
    gradient
        (r, k, 3) by the points.
    """

    value: Floats
    gradient: Floats


def departures(thing: KnownThing, world: Floats, *, on_ground: bool) -> Departures:
    """By how much points are not as is known.

    Parameters
    ----------
    thing
        What is known.
    world
        (k, 3) its points.
    on_ground
        Whether all of its points lie on the ground.

    Returns
    -------
    Departures
        Where there is no derivative (points that coincide), the gradient is zero, and the value
        what it is on the way there.
    """
    if thing.kind in _FLAT:
        value, gradient = _FLAT[thing.kind](world, on_ground=on_ground)
    elif thing.kind in _CONDITIONS:
        value, gradient = _CONDITIONS[thing.kind](world)
    elif thing.kind == "line_distance" and thing.value == 0.0:
        value, gradient = conditions.line_offset(world, on_ground=on_ground)
    else:
        measured, by_points = measured_value(thing, world)
        value, gradient = np.array([measured - thing.value]), by_points[None]
    if np.isfinite(value).all() and np.isfinite(gradient).all():
        return Departures(value, gradient)
    # Points that coincide have no distance, and no way to tell where to move.
    none = 0.0 if thing.is_condition else -thing.value
    return Departures(np.full(value.shape, none), np.zeros(gradient.shape))


def row_count(thing: KnownThing, *, on_ground: bool) -> int:
    """Number of rows of a thing.

    Parameters
    ----------
    thing
        What is known.
    on_ground
        Whether all of its points lie on the ground.
    """
    points, across = len(thing.label), 1 if on_ground else 2
    if thing.kind == "line_distance":
        return across if thing.value == 0.0 else 1
    return {
        "collinear": across * (points - 2),
        "parallel": across,
        "coplanar": points - 3,
        "level": points - 1,
        "vertical": 2,
        "equal_lengths": points // 2 - 1,
    }.get(thing.kind, 1)


def measured_value(thing: KnownThing, world: Floats) -> tuple[float, Floats]:
    """Value of the measurement of a thing's kind, and its gradient (k, 3), in the thing's unit.

    Parameters
    ----------
    thing
        What is known, no condition.
    world
        (k, 3) its points.
    """
    value, gradient = getattr(shapes, thing.kind)(world)
    if thing.kind == "angle":
        return float(np.rad2deg(value)), np.rad2deg(gradient)
    return float(value), gradient
