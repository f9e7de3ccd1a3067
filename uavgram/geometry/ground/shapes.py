"""Quantities measured between ground points, with their gradients.

Every function takes (K, 3) points [m] and returns the value and its gradient (K, 3) by the points.
Where the value has no derivative (coincident points, a flat angle, a point on the line), both are
NaN, as no standard deviation could be given. Quantities that depend on the vertical direction are
in `heights`.
"""

from __future__ import annotations

import numpy as np

from uavgram.geometry.motion.rotation import lengths_of
from uavgram.model.arrays import Bools, Floats

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
    normal, size = _unit(0.5 * np.cross(local, after).sum(axis=0))
    return mask_undefined(float(size), 0.5 * np.cross(after - before, normal))


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
    value = float(np.arctan2(np.linalg.norm(np.cross(legs[0], legs[1])), cosine))
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
    across = np.cross(legs[0], legs[1])
    normal, size = _unit(across)
    if not size > IN_LINE * np.linalg.norm(legs, axis=1).prod():
        return mask_undefined(np.nan, np.zeros_like(points))
    offset = points[0] - points[1]
    # Foot of the point on the plane: its coefficients along the two legs (Cramer's rule).
    second = float(np.cross(offset, legs[1]) @ normal / size)
    third = float(np.cross(legs[0], offset) @ normal / size)
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
