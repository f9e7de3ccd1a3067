"""Quantities measured between points: values, gradients, and reasons for a missing value.

Every function takes (K, 3) points [m] and returns the value and its gradient (K, 3) by the points.
Where the value has no derivative (coincident points, a flat angle, a point on the line), both are
NaN, as no standard deviation could be given.

The same functions serve as observation equations where such a quantity is known.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import NamedTuple

import numpy as np

from uavgram.geometry.motion.rotation import cross, lengths_of
from uavgram.model.arrays import Bools, Floats
from uavgram.model.observations import MEASUREMENT_FORMS, MeasurementKind

Measured = tuple[float, Floats]

IN_LINE = 1e-12
"""Sine between two directions, or width over length, below which the value is rounding error."""


def distance(points: Floats) -> Measured:
    """Measure the straight 3-D distance [m] of two points.

    Parameters
    ----------
    points
        (2, 3) [m].

    Returns
    -------
    value, gradient
        Metres, and (2, 3) without unit; NaN for coincident points.
    """
    return polyline(require_points(points, exactly=2))


def polyline(points: Floats) -> Measured:
    """Measure the length [m] of a line through points, in 3-D.

    Parameters
    ----------
    points
        (K, 3) [m], K >= 2.

    Returns
    -------
    value, gradient
        Metres, and (K, 3) without unit; NaN where two neighbours coincide.
    """
    points = require_points(points, at_least=2)
    unit, length = _unit(points[1:] - points[:-1])
    gradient = np.zeros_like(points)
    gradient[1:] += unit
    gradient[:-1] -= unit
    return mask_undefined(float(length.sum()), gradient)


def area(points: Floats) -> Measured:
    """Measure the area [m2] that a closed polygon encloses, in 3-D.

    It is the length of the vector area ``1/2 sum p_i x p_(i+1)``: the area as seen along the
    polygon's own normal. Where the outline crosses itself (`polygon_self_intersects`) parts cancel.

    Parameters
    ----------
    points
        (K, 3) corners in order [m], K >= 3.

    Returns
    -------
    value, gradient
        Square metres, and (K, 3) in metres; NaN where the points are on one line.
    """
    points = require_points(points, at_least=3)
    local = points - points.mean(axis=0)  # avoids cancellation far from the origin
    after, before = np.roll(local, -1, axis=0), np.roll(local, 1, axis=0)
    normal, size = _unit(0.5 * cross(local, after).sum(axis=0))
    return mask_undefined(float(size), 0.5 * cross(after - before, normal))


def angle(points: Floats) -> Measured:
    """Measure the angle [rad] at the middle one of three points, in 3-D.

    Parameters
    ----------
    points
        (3, 3) [m]; the vertex is the second.

    Returns
    -------
    value, gradient
        Radians from 0 to pi, and (3, 3) in rad/m; NaN where a leg has no length, and for angles of
        exactly 0 or pi.
    """
    points = require_points(points, exactly=3)
    legs, lengths = _unit(points[[0, 2]] - points[1])
    cosine = float(legs[0] @ legs[1])
    # Kahan: atan2 is accurate where the arc cosine loses digits.
    value = float(np.arctan2(np.linalg.norm(cross(legs[0], legs[1])), cosine))
    across, _ = _unit(legs[::-1] - cosine * legs)  # from each leg towards the other
    ends = -across / lengths[:, None]
    return mask_undefined(value, np.stack([ends[0], -ends.sum(axis=0), ends[1]]))


def line_distance(points: Floats) -> Measured:
    """Measure the perpendicular 3-D distance [m] of a point from a straight line.

    Parameters
    ----------
    points
        (3, 3) [m]: the point, then two points of the line.

    Returns
    -------
    value, gradient
        Metres, and (3, 3) without unit; NaN where the two points coincide, or the first is on the
        line.
    """
    points = require_points(points, exactly=3)
    along, length = _unit(points[2] - points[1])
    offset = points[0] - points[1]
    foot = offset @ along
    normal, value = _unit(offset - foot * along)
    share = foot / length  # 0 where the foot is the line's first point, 1 at its second
    return mask_undefined(float(value), np.stack([normal, (share - 1) * normal, -share * normal]))


def plane_distance(points: Floats) -> Measured:
    """Measure the perpendicular distance [m] of a point from a plane, signed by its side.

    Parameters
    ----------
    points
        (4, 3) [m]: the point, then three points of the plane.

    Returns
    -------
    value, gradient
        Metres, positive on the side from which the three run anticlockwise, and (4, 3) without
        unit; NaN where the three are in line.
    """
    points = require_points(points, exactly=4)
    legs = points[2:] - points[1]
    across = cross(legs[0], legs[1])
    normal, size = _unit(across)
    if not size > IN_LINE * np.linalg.norm(legs, axis=1).prod():
        return mask_undefined(np.nan, np.zeros_like(points))
    offset = points[0] - points[1]
    # Foot of the point on the plane: its coefficients along the two legs (Cramer's rule).
    second = float(cross(offset, legs[1]) @ normal / size)
    third = float(cross(legs[0], offset) @ normal / size)
    weight = np.array([1.0, second + third - 1.0, -second, -third])
    return mask_undefined(float(offset @ normal), weight[:, None] * normal)


def outline_crosses_itself(outline: Floats) -> bool:
    """Return whether an outline (K, 3) crosses itself in the plane that fits it best.

    Points in line count as no crossing.
    """
    local = outline - outline.mean(axis=0)
    _, size, axes = np.linalg.svd(local, full_matrices=False)
    flat = size[1] > IN_LINE * size[0]
    return bool(flat) and polygon_self_intersects(local @ axes[:2].T)


def polygon_self_intersects(points_2d: Floats) -> bool:
    """Return whether the outline of a polygon crosses or touches itself.

    Parameters
    ----------
    points_2d
        (K, 2) corners in order; a corner given twice in a row counts once.
    """
    points = np.asarray(points_2d, np.float64)
    points = points[(points != np.roll(points, 1, axis=0)).any(axis=1)]
    k = len(points)
    if k < 3:
        return k > 0  # a line there and back
    end = np.roll(points, -1, axis=0)
    i, j = np.triu_indices(k, 1)
    # All pairs of edges that are not neighbours.
    apart = (j - i > 1) & (j - i < k - 1)
    i, j = i[apart], j[apart]
    return _folds_back(points) or bool(_share_a_point(points[i], end[i], points[j], end[j]).any())


def _folds_back(points: Floats) -> bool:
    """Return whether an edge runs back over the one before it."""
    edge = np.roll(points, -1, axis=0) - points
    before = np.roll(edge, 1, axis=0)
    straight = edge[:, 0] * before[:, 1] == edge[:, 1] * before[:, 0]
    return bool((straight & (np.sum(edge * before, axis=1) < 0)).any())


def _share_a_point(a: Floats, b: Floats, c: Floats, d: Floats) -> Bools:
    """Mark the pairs of segments ab and cd that have a point in common; (N, 2) each."""

    def side(p: Floats, q: Floats, r: Floats) -> Floats:
        u, v = q - p, r - p
        return np.sign(u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0])

    straddle = (side(a, b, c) * side(a, b, d) <= 0) & (side(c, d, a) * side(c, d, b) <= 0)
    # Segments on one line always pass the test above: their bounding boxes must overlap as well.
    low = np.maximum(np.minimum(a, b), np.minimum(c, d))
    high = np.minimum(np.maximum(a, b), np.maximum(c, d))
    return np.asarray(straddle & (low <= high).all(axis=1))


def require_points(points: Floats, *, exactly: int | None = None, at_least: int = 2) -> Floats:
    """Return the points as an array, after a check of their number.

    Parameters
    ----------
    points
        (K, 3) [m].
    exactly, at_least
        Required number of points.
    """
    points = np.asarray(points, np.float64)
    wanted = exactly if exactly is not None else max(at_least, len(points))
    if points.shape != (wanted, 3):
        count = f"{exactly}" if exactly is not None else f"at least {at_least}"
        raise ValueError(f"expected {count} points of shape (K, 3), got shape {points.shape}")
    return points


def _unit(vector: Floats) -> tuple[Floats, Floats]:
    """Normalise vectors (..., 3) and return their lengths (...); both NaN for the zero vector."""
    length = lengths_of(vector)
    length = np.where(length > 0, length, np.nan)
    return vector / length[..., None], length


def mask_undefined(value: float, gradient: Floats) -> Measured:
    """Return value and gradient; both NaN where either is not finite."""
    if np.isfinite(value) and np.isfinite(gradient).all():
        return value, gradient
    return float("nan"), np.full_like(gradient, np.nan)


LEVEL = np.array([1.0, 1.0, 0.0])
"""Factors that project a vector onto the horizontal plane."""

UPRIGHT = 1e-12
"""Threshold of rounding errors.

It applies to the horizontal share of a length, or to the area that an outline encloses over the sum
of its squared distances.
"""


def horizontal_distance(points: Floats) -> Measured:
    """Measure the horizontal distance [m] of two points.

    NaN where one is straight above the other.
    """
    value, gradient = distance(require_points(points, exactly=2) * LEVEL)
    return value, gradient * LEVEL


def vertical_distance(points: Floats) -> Measured:
    """Measure the height [m] of the second of two points above the first; negative if below."""
    points = require_points(points, exactly=2)
    return mask_undefined(float(points[1, 2] - points[0, 2]), np.array([[0.0, 0, -1], [0, 0, 1]]))


def slope(points: Floats) -> Measured:
    """Measure the slope [rad] of the line from the first point to the second.

    Parameters
    ----------
    points
        (2, 3) [m].

    Returns
    -------
    value, gradient
        Radians from -pi/2 to pi/2, positive uphill, and (2, 3) in rad/m; NaN where one point is
        straight above the other.
    """
    (across, by_across), (rise, by_rise) = horizontal_distance(points), vertical_distance(points)
    if not across > UPRIGHT * abs(rise):
        return mask_undefined(np.nan, np.asarray(by_rise))
    # d atan(rise / across)
    gradient = (across * by_rise - rise * by_across) / (across**2 + rise**2)
    return mask_undefined(float(np.arctan2(rise, across)), gradient)


class Volume(NamedTuple):
    """Volume [m3] and its gradients; all NaN where it is undefined.

    Attributes
    ----------
    value
        Positive where the points are above their base.
    by_points
        (K, 3) by the points, without the effect of the base height changing when a point moves
        sideways.
    by_base
        (K,) by the heights of the base.
    """

    value: float
    by_points: Floats
    by_base: Floats


def volume(points: Floats, base_m: Floats, *, top: bool = False) -> Volume:
    """Measure the volume between a surface through points and its base straight below.

    Seen from above, triangles fan out from the middle to the sides of the outline. Surface and base
    are flat over each of them; in the middle they have the mean heights of the corners, or those of
    the top. Where both are planes, the volume is exact for any outline.

    Parameters
    ----------
    points
        (K, 3) corners of the outline in order [m], K >= 3; with a top, the top is the last one.
    base_m
        (K,) heights of the base below the points [m].
    top
        Whether the last point is the middle of the fan instead of a corner.

    Notes
    -----
    With the signed area A_i of the triangle of the middle and corners i and i+1, and the heights h
    over the base, the volume is the sum of A_i (h_i + h_(i+1) + h_middle) / 3, which is the
    integral of a function that is linear over each triangle.
    """
    points = require_points(points, at_least=4 if top else 3)
    above = points[:, 2] - base_m
    count = len(points) - top
    share = np.zeros(len(points))  # weight of each point in the middle
    share[count:] = 1.0
    share[:count] = 0.0 if top else 1.0 / count
    corner, height = points[:count, :2] - share @ points[:, :2], above[:count]
    after, middle = np.roll(corner, -1, axis=0), float(share @ above)
    area = 0.5 * (corner[:, 0] * after[:, 1] - corner[:, 1] * after[:, 0])
    mean = (height + np.roll(height, -1) + middle) / 3.0
    # Signed plan area; its sign is the sense of the outline.
    total = float(area.sum())
    sense = np.sign(total) if abs(total) > UPRIGHT * np.sum(corner**2) else np.nan
    # d A_i / d corner_i is half of corner_(i+1), turned by a right angle; d A_i / d corner_(i+1)
    # likewise.
    turned_after = 0.5 * mean[:, None] * np.column_stack([after[:, 1], -after[:, 0]])
    turned_before = 0.5 * mean[:, None] * np.column_stack([-corner[:, 1], corner[:, 0]])
    sideways = turned_after + np.roll(turned_before, 1, axis=0)
    by_points = np.zeros_like(points)
    by_points[:count, :2] = sideways
    by_points[:, :2] -= share[:, None] * sideways.sum(axis=0)
    # Derivative by heights: a third of the adjacent triangles' area.
    by_points[:count, 2] = (area + np.roll(area, 1)) / 3.0
    by_points[:, 2] += share * total / 3.0
    value, by_points = mask_undefined(float(sense * (area @ mean)), sense * by_points)
    return Volume(value, by_points, -by_points[:, 2])


def sees_all(points: Floats) -> bool:
    """Return whether the last point sees every side of the others' outline in plan."""
    corner = points[:-1, :2] - points[-1, :2]
    after = np.roll(corner, -1, axis=0)
    area = corner[:, 0] * after[:, 1] - corner[:, 1] * after[:, 0]
    return bool((area > 0).all() or (area < 0).all())


class PlaneBelow(NamedTuple):
    """Heights of a plane below (or above) n places; NaN where the plane is vertical.

    Attributes
    ----------
    height_m
        (n,) up.
    slope
        (2,) d up / d east, d up / d north.
    by_three
        (n, 3, 3) by the three points of the plane.
    """

    height_m: Floats
    slope: Floats
    by_three: Floats


def plane_below(east_north_m: Floats, three: Floats) -> PlaneBelow:
    """Compute the plane through three points (3, 3) at places (n, 2), with derivatives."""
    three = require_points(three, exactly=3)
    legs = three[1:] - three[0]
    twice = legs[0, 0] * legs[1, 1] - legs[0, 1] * legs[1, 0]
    sizes = np.linalg.norm(legs, axis=1)
    if not abs(twice) > UPRIGHT * sizes.prod():
        n = len(east_north_m)
        return PlaneBelow(np.full(n, np.nan), np.full(2, np.nan), np.full((n, 3, 3), np.nan))
    inverse = np.array([[legs[1, 1], -legs[1, 0]], [-legs[0, 1], legs[0, 0]]]) / twice
    # Barycentric weights of the three points at each place.
    of_legs = (east_north_m - three[0, :2]) @ inverse.T
    weight = np.column_stack([1.0 - of_legs.sum(axis=1), of_legs])
    slope_of = inverse.T @ legs[:, 2]
    # A point that moves by d lifts the plane at its place by d_up - slope . d_plan.
    return PlaneBelow(
        weight @ three[:, 2], slope_of, weight[:, :, None] * np.array([*-slope_of, 1.0])
    )


class Profile(NamedTuple):
    """Points in the coordinates of the plan line from the first to the last of them.

    Attributes
    ----------
    value
        (K, 3) station from the first point, offset to the right of the line, height over the first
        point [m].
    gradient
        (K, 3, K, 3) of each by the points. All NaN where the last point is straight above the
        first.
    """

    value: Floats
    gradient: Floats


def profile(points: Floats) -> Profile:
    """Measure points (K, 3) along a line: stations, offsets, heights, with derivatives."""
    points = require_points(points, at_least=2)
    count = len(points)
    length, by_ends = horizontal_distance(points[[0, -1]])
    along = by_ends[1]
    right = np.array([along[1], -along[0], 0.0])
    away = points - points[0]
    value = np.column_stack([away @ along, away @ right, away[:, 2]])
    gradient = np.zeros((count, 3, count, 3))
    own = np.arange(count)
    axes = np.array([along, right, np.array([0.0, 0.0, 1.0])])
    gradient[own, :, own] += axes
    gradient[:, :, 0] -= axes
    # Rotation of the line: a sideways shift of the last point turns it by shift / length.
    turn = np.einsum("n,i->ni", value[:, 1] / length, right)
    tilt = np.einsum("n,i->ni", value[:, 0] / length, right)
    gradient[:, 0, -1] += turn
    gradient[:, 0, 0] -= turn
    gradient[:, 1, -1] -= tilt
    gradient[:, 1, 0] += tilt
    value[[0, -1], 1] = 0.0  # zero by definition: remove rounding errors
    gradient[[0, -1], 1] = 0.0
    if not np.isfinite(length):
        return Profile(np.full_like(value, np.nan), np.full_like(gradient, np.nan))
    return Profile(value, gradient)


def profile_length(points: Floats) -> Measured:
    """Measure the horizontal distance [m] of the last of (K, 3) points from the first."""
    points = require_points(points, at_least=2)
    gradient = np.zeros_like(points)
    value, gradient[[0, -1]] = horizontal_distance(points[[0, -1]])
    return mask_undefined(value, gradient)


class UnmeasurableError(ValueError):
    """Reason why a measurement has no value."""


_SHAPES: dict[MeasurementKind, Callable[[Floats], Measured]] = {
    "distance": distance,
    "polyline": polyline,
    "area": area,
    "angle": angle,
    "line_distance": line_distance,
    "plane_distance": plane_distance,
    "height": vertical_distance,
    "vertical_distance": vertical_distance,
    "horizontal_distance": horizontal_distance,
    "slope": slope,
    "profile": profile_length,
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
    if kind == "area" and outline_crosses_itself(points):
        raise UnmeasurableError(_CROSSES)
    value, gradient = _SHAPES[kind](points)
    if not np.isfinite(value):
        raise UnmeasurableError(_UNDEFINED_BECAUSE.get(kind, _IN_LINE))
    if MEASUREMENT_FORMS[kind].unit == "deg":
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
    base = plane_below(upper[:, :2], three)
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


def _volume(points: Floats, base_m: Floats, parameters: Mapping[str, float]) -> Volume:
    top = "top" in parameters
    outline = points[:-1] if top else points
    if len(outline) < 3:
        raise UnmeasurableError("its outline has fewer than three points")
    if outline_crosses_itself(outline * LEVEL):
        raise UnmeasurableError(_CROSSES)
    if top and not sees_all(points):
        raise UnmeasurableError(
            "its last point, the top, has to lie inside the outline and in sight of all its "
            "sides: measure the parts one by one"
        )
    found = volume(points, base_m, top=top)
    if not np.isfinite(found.value):
        raise UnmeasurableError(_UNDEFINED_BECAUSE["volume"])
    return found
