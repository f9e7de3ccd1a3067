"""Measurements that depend on positions only: values, gradients, and reasons for a missing value.

The same functions serve as observation equations where such a quantity is known.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import NamedTuple

import numpy as np

from uavgram.geometry.ground import heights, shapes
from uavgram.model.arrays import Floats
from uavgram.model.observations import MeasurementKind


class UnmeasurableError(ValueError):
    """Reason why a measurement has no value."""


_SHAPES: dict[MeasurementKind, Callable[[Floats], shapes.Measured]] = {
    "distance": shapes.distance,
    "polyline": shapes.polyline,
    "area": shapes.area,
    "angle": shapes.angle,
    "line_distance": shapes.line_distance,
    "plane_distance": shapes.plane_distance,
    "height": heights.vertical_distance,
    "vertical_distance": heights.vertical_distance,
    "horizontal_distance": heights.horizontal_distance,
    "slope": heights.slope,
    "profile": heights.profile_length,
}

_UPRIGHT = "its points lie one above the other"
_UNDEFINED_BECAUSE: dict[MeasurementKind, str] = {
    "horizontal_distance": _UPRIGHT,
    "slope": f"{_UPRIGHT}, and a vertical line has no slope",
    "plane_distance": "the last three points lie in line, and many planes go through them",
    "profile": "its first and last point lie one above the other, and give it no direction",
    "volume": "its points lie in line, seen from above",
}
_IN_LINE = "its points coincide or lie in line"
_CROSSES = "its outline crosses itself: give the points in order around it"


def refers_to_ground(kind: str, count: int, parameters: Mapping[str, float]) -> bool:
    """Return whether a measurement is taken from the ground straight below its points.

    Parameters
    ----------
    kind
        Kind of measurement.
    count
        Number of points.
    parameters
        Parameters by name.
    """
    if kind == "height":
        return count == 1
    return kind == "volume" and not {"level", "plane"} & parameters.keys()


def measure_shape(
    kind: MeasurementKind, points: Floats, parameters: Mapping[str, float]
) -> tuple[float, Floats]:
    """Compute a measurement in its unit, and its gradient by the points.

    Parameters
    ----------
    kind
        Kind that depends on its points only.
    points
        (k, 3) [m].
    parameters
        Parameters by name.

    Returns
    -------
    value, gradient
        In metres, square or cubic metres, or degrees, and (k, 3) in this unit per metre.

    Raises
    ------
    UnmeasurableError
        There is no value, or no derivative.
    """
    if kind == "volume":
        return _volume_over_plane(points, parameters)
    if kind == "area" and shapes.outline_crosses_itself(points):
        raise UnmeasurableError(_CROSSES)
    value, gradient = _SHAPES[kind](points)
    if not np.isfinite(value):
        raise UnmeasurableError(_UNDEFINED_BECAUSE.get(kind, _IN_LINE))
    if kind in {"angle", "slope"}:
        return float(np.rad2deg(value)), np.rad2deg(gradient)
    return value, gradient


class OverGround(NamedTuple):
    """Value measured from the ground, and its gradients (k, 3) by points and feet."""

    value: float
    by_points: Floats
    by_feet: Floats


def measure_over_ground(
    kind: MeasurementKind, points: Floats, feet: Floats, parameters: Mapping[str, float]
) -> OverGround:
    """Compute the height of one point over the ground, or a volume over it.

    Parameters
    ----------
    kind
        Kind for which `refers_to_ground` holds.
    points, feet
        (k, 3), and the places on the ground straight below them [m].
    parameters
        Parameters by name.

    Raises
    ------
    UnmeasurableError
        There is no value, or no derivative.
    """
    if kind == "height":
        up = np.array([[0.0, 0.0, 1.0]])
        return OverGround(float(points[0, 2] - feet[0, 2]), up, -up)
    found = _volume(points, feet[:, 2], parameters)
    return OverGround(found.value, found.by_points, np.outer(found.by_base, [0.0, 0.0, 1.0]))


def _volume_over_plane(points: Floats, parameters: Mapping[str, float]) -> tuple[float, Floats]:
    """Compute the volume over a level plane, or over the plane through the last three points."""
    if "level" in parameters:
        level = np.full(len(points), parameters["level"])
        found = _volume(points, level, parameters)
        return found.value, found.by_points
    upper, three = points[:-3], points[-3:]
    base = heights.plane_below(upper[:, :2], three)
    if not np.isfinite(base.height_m).all():
        raise UnmeasurableError(
            "the last three points lie in line, or their plane is upright: nothing is above it"
        )
    found = _volume(upper, base.height_m, parameters)
    # Chain rule: the base height changes with the places and with the three points of the plane.
    gradient = np.zeros_like(points)
    gradient[:-3] = found.by_points
    gradient[:-3, :2] += found.by_base[:, None] * base.slope
    gradient[-3:] = np.einsum("n,nij->ij", found.by_base, base.by_three)
    return found.value, gradient


def _volume(points: Floats, base_m: Floats, parameters: Mapping[str, float]) -> heights.Volume:
    top = "top" in parameters
    outline = points[:-1] if top else points
    if len(outline) < 3:
        raise UnmeasurableError("its outline has fewer than three points")
    if shapes.outline_crosses_itself(outline * heights.LEVEL):
        raise UnmeasurableError(_CROSSES)
    if top and not heights.sees_all(points):
        raise UnmeasurableError(
            "its last point, the top, has to lie inside the outline and in sight of all its "
            "sides: measure the parts one by one"
        )
    found = heights.volume(points, base_m, top=top)
    if not np.isfinite(found.value):
        raise UnmeasurableError(_UNDEFINED_BECAUSE["volume"])
    return found
