"""Measurements that depend on the vertical direction, with their gradients.

As in `shapes`: (K, 3) points [m] give a value and its gradient (K, 3); both are NaN where there is
no derivative.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from uavgram.geometry.ground.shapes import Measured, distance, mask_undefined, require_points
from uavgram.model.arrays import Floats

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
