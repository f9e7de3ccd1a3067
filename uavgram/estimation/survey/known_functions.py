"""Known things as rows of numbers that should be zero: functions of their points, with gradients.

They are the functions of the measurements less the known value, and those of the conditions. Where
a value is zero, a distance from a line has no derivative: its offset, a signed number or a vector,
stands for it.
"""

from __future__ import annotations

from typing import NamedTuple, cast

import numpy as np

from uavgram.estimation.survey.ground_below import GroundBelow
from uavgram.geometry.ground import conditions, measurable
from uavgram.model.arrays import Floats
from uavgram.model.survey.known import CONDITIONS, KnownThing
from uavgram.model.survey.observations import MeasurementKind

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
    by_feet
        (r, k, 3) by the places on the smooth ground straight below the points.
    rough
        (r,) sigma that the roughness of the ground below adds; in the same unit.
    """

    value: Floats
    gradient: Floats
    by_feet: Floats
    rough: Floats


def departures(
    thing: KnownThing, world: Floats, below: GroundBelow, *, on_ground: bool
) -> Departures:
    """By how much points are not as is known.

    Parameters
    ----------
    thing
        What is known.
    world
        (k, 3) its points.
    below
        The ground below them.
    on_ground
        Whether all of its points lie on the ground.

    Returns
    -------
    Departures
        Where there is no derivative (points that coincide), the gradient is zero, and the value
        what it is on the way there.
    """
    rows = row_count(thing, on_ground=on_ground)
    flat = np.zeros((rows, len(world), 3))
    try:
        if thing.kind in CONDITIONS or is_offset(thing):
            value, gradient = _condition(thing, world, on_ground=on_ground)
            found = Departures(value, gradient, flat, np.zeros(rows))
        else:
            found = _measured(thing, world, below)
        if np.isfinite(found.value).all() and np.isfinite(found.gradient).all():
            return found
    except measurable.UnmeasurableError:
        pass
    # Points that coincide have no distance, and no way to tell where to move.
    off = 0.0 if thing.is_condition else -thing.value
    return Departures(np.full(rows, off), flat, flat, np.zeros(rows))


def _measured(thing: KnownThing, world: Floats, below: GroundBelow) -> Departures:
    """The measurement of a thing's kind, less what is known."""
    kind, parameters = cast("MeasurementKind", thing.kind), dict(thing.parameters)
    if not refers_to_ground(thing):
        value, gradient = measurable.shape_of(kind, world, parameters)
        nothing = np.zeros((1, len(world), 3))
        return Departures(np.array([value - thing.value]), gradient[None], nothing, np.zeros(1))
    value, gradient, by_feet = measurable.over_ground(kind, world, below.feet, parameters)
    told = below.told[:, None]
    return Departures(
        np.array([value - thing.value]),
        (gradient + np.where(told, by_feet, 0.0))[None],
        np.where(told, 0.0, by_feet)[None],
        np.array([np.linalg.norm(by_feet[:, 2] * below.sigma_m)]),
    )


def is_offset(thing: KnownThing) -> bool:
    """Whether a distance from a line is known to be zero."""
    return thing.kind == "line_distance" and thing.value == 0.0


def refers_to_ground(thing: KnownThing) -> bool:
    """Whether a thing is measured from the ground straight below its points."""
    return measurable.refers_to_ground(thing.kind, len(thing.label), dict(thing.parameters))


def _condition(thing: KnownThing, world: Floats, *, on_ground: bool) -> conditions.Residuals:
    if is_offset(thing):
        return conditions.line_offset(world, on_ground=on_ground)
    if thing.kind in _FLAT:
        return _FLAT[thing.kind](world, on_ground=on_ground)
    return _CONDITIONS[thing.kind](world)


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
    if is_offset(thing):
        return across
    return {
        "collinear": across * (points - 2),
        "parallel": across,
        "coplanar": points - 3,
        "level": points - 1,
        "vertical": 2,
        "equal_lengths": points // 2 - 1,
    }.get(thing.kind, 1)
