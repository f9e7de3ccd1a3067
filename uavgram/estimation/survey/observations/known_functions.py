"""Known things as rows of numbers that should be zero: functions of their points, with gradients.

They are the functions of the measurements less the known value, and those of the conditions. Where
a value is zero, a distance from a line has no derivative: its offset, a signed number or a vector,
stands for it.
"""

from __future__ import annotations

from typing import NamedTuple, cast

import numpy as np

from uavgram.estimation.survey.ground_below import ground_below
from uavgram.geometry.ground import conditions, measurable
from uavgram.geometry.ground.line_of_position import beside_line, joint_covariance
from uavgram.model.arrays import Floats
from uavgram.model.survey.known import KnownThing
from uavgram.model.survey.observations import MeasurementKind
from uavgram.model.survey.survey import Survey

_FLAT = {"collinear": conditions.collinear, "parallel": conditions.parallel}
"""Conditions of which on the ground only what is along it counts."""

_CONDITIONS = {
    "right_angle": conditions.right_angle,
    "coplanar": conditions.coplanar,
    "level": conditions.level,
    "vertical": conditions.vertical,
    "equal_lengths": conditions.equal_lengths,
}


class Departure(NamedTuple):
    """By how much a measured value is not what is known.

    Attributes
    ----------
    value
        Measured less known value, in the unit of the thing's sigma.
    gradient
        (k, 3) by the points.
    by_feet
        (k, 3) by the places on the smooth ground straight below the points.
    rough
        Sigma that the roughness of the ground below adds, in the same unit.
    """

    value: float
    gradient: Floats
    by_feet: Floats
    rough: float


def measured_departure(thing: KnownThing, world: Floats, survey: Survey, feet: Floats) -> Departure:
    """By how much what is measured between points is not what is known.

    Where there is no derivative (points that coincide), the gradient is zero, and the value what
    it is on the way there: there is no way to tell where to move.

    Parameters
    ----------
    thing
        No condition.
    world
        (k, 3) its points.
    survey
        Which of them stand on the ground.
    feet
        (k, 3) the places on the ground below them.
    """
    kind, parameters = cast("MeasurementKind", thing.kind), dict(thing.parameters)
    nothing = np.zeros((len(world), 3))
    try:
        if not refers_to_ground(thing):
            value, gradient = measurable.shape_of(kind, world, parameters)
            return Departure(value - thing.value, gradient, nothing, 0.0)
        below = ground_below(survey, np.array(thing.label), world, feet)
        value, gradient, by_feet = measurable.over_ground(kind, world, below.feet, parameters)
    except measurable.UnmeasurableError:
        return Departure(-thing.value, nothing, nothing, 0.0)
    told = below.told[:, None]
    return Departure(
        value - thing.value,
        gradient + np.where(told, by_feet, 0.0),
        np.where(told, 0.0, by_feet),
        float(np.linalg.norm(by_feet[:, 2] * below.sigma_m)),
    )


def condition_departures(
    thing: KnownThing, world: Floats, *, on_ground: bool
) -> conditions.Residuals:
    """By how much a condition is not met, of n things that are alike.

    Parameters
    ----------
    thing
        One of them.
    world
        (n, k, 3) points of each.
    on_ground
        Whether all of their points lie on the ground.

    Returns
    -------
    Residuals
        (n, m) of the m rows of each, and their gradients (n, m, k, 3). Zero where there is no
        derivative: there is no way to tell where to move.
    """
    if is_offset(thing):
        value, gradient = conditions.line_offset(world, on_ground=on_ground)
    elif thing.kind in _FLAT:
        value, gradient = _FLAT[thing.kind](world, on_ground=on_ground)
    else:
        value, gradient = _CONDITIONS[thing.kind](world)
    return conditions.Residuals(np.nan_to_num(value), np.nan_to_num(gradient))


def line_departures(thing: KnownThing, world: Floats) -> tuple[conditions.Residuals, Floats]:
    """By how much points lie beside their line of known position.

    Parameters
    ----------
    thing
        With a position.
    world
        (k, 3) its points.

    Returns
    -------
    Residuals
        (m,) point by point, and their gradients (m, k, 3).
    covariance : (m, m)
        Of what is known of them: all points share the errors of the line's ends.
    """
    line = thing.position
    assert line is not None  # noqa: S101  (the caller asked)
    beside = beside_line(world, line.ends_m, upwards=line.has_height)
    k, axes = beside.value.shape
    gradient = np.zeros((k, axes, k, 3))
    gradient[np.arange(k), :, np.arange(k)] = beside.gradient
    joint = joint_covariance(beside.by_ends, line.sigma_m, line.straightness_m)
    residuals = conditions.Residuals(beside.value.ravel(), gradient.reshape(k * axes, k, 3))
    return residuals, joint * (thing.sigma / line.across_m) ** 2


def is_offset(thing: KnownThing) -> bool:
    """Whether a distance from a line is known to be zero."""
    return thing.kind == "line_distance" and thing.value == 0.0


def is_condition(thing: KnownThing) -> bool:
    """Whether its rows are those of a condition."""
    return thing.is_condition or is_offset(thing)


def refers_to_ground(thing: KnownThing) -> bool:
    """Whether a thing is measured from the ground straight below its points."""
    return measurable.refers_to_ground(thing.kind, len(thing.label), dict(thing.parameters))


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
    if thing.position is not None:
        return points * (1 + thing.position.has_height)
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
