"""Geometric conditions between points: collinear, coplanar, level, square; lines of known position.

Every function takes points (..., K, 3) in east, north, up [m] and returns residuals (..., m), zero
where the condition holds, and their gradients (..., m, K, 3) by the points. Unlike measured
distances and angles, residuals carry a sign or are components of a vector, so that they have
derivatives at zero too. Where there is no derivative (points that coincide, first three points of a
plane on one line), residuals and gradients of the condition are NaN.

For points on the ground the components across the ground follow from the ground itself: `on_ground`
keeps the components along the ground only.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from uavgram.geometry.motion.rotation import cross
from uavgram.model.arrays import Floats

STEEP_RISE = 0.7
"""Rise of a unit vector above which components are taken east and north.

On steeper lines the directions along the ground and upwards are ill-defined.
"""


class LineAxes(NamedTuple):
    """Three axes of lines: (..., 3) unit vectors, and their derivatives (..., 3, 3) by the line."""

    along: Floats
    aside: Floats
    upward: Floats
    along_by_line: Floats
    aside_by_line: Floats
    upward_by_line: Floats

    def components(self, *, on_ground: bool) -> tuple[Floats, Floats]:
        """Return the (..., c, 3) axes square to the line, and their derivatives (..., c, 3, 3)."""
        if on_ground:
            return self.aside[..., None, :], self.aside_by_line[..., None, :, :]
        axes = np.stack([self.aside, self.upward], axis=-2)
        return axes, np.stack([self.aside_by_line, self.upward_by_line], axis=-3)


def line_axes(line: Floats) -> LineAxes:
    """Compute the axes of lines (..., 3); NaN for a line of zero length."""
    along, length = unit_vectors(line)
    steep = np.abs(along[..., 2]) > STEEP_RISE
    # up x along points to the left. For a steep line north x along is used, which is east of an
    # upward line.
    reference = np.where(steep[..., None], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0])
    aside, size = unit_vectors(cross(reference, along))
    # Chain rule through the cross products and the normalisation.
    along_by_line = _square_to(along, length)
    across_by_line = cross(reference[..., None, :], along_by_line.swapaxes(-1, -2))
    aside_by_line = _square_to(aside, size) @ across_by_line.swapaxes(-1, -2)
    turned = cross(along_by_line.swapaxes(-1, -2), aside[..., None, :])
    turned = turned + cross(along[..., None, :], aside_by_line.swapaxes(-1, -2))
    upward = cross(along, aside)
    return LineAxes(along, aside, upward, along_by_line, aside_by_line, turned.swapaxes(-1, -2))


def unit_vectors(vector: Floats) -> tuple[Floats, Floats]:
    """Normalise vectors (..., 3) and return their lengths (...); both NaN for the zero vector."""
    length = np.linalg.norm(vector, axis=-1)
    length = np.where(length > 0, length, np.nan)
    return vector / length[..., None], length


def _square_to(unit: Floats, size: Floats) -> Floats:
    """Compute derivatives (..., 3, 3) of unit vectors by the vectors of given lengths (...)."""
    outer = unit[..., :, None] * unit[..., None, :]
    return np.asarray((np.eye(3) - outer) / size[..., None, None])


MAX_LEVER = 2.0
"""Largest distance from either end, in lengths of the line, that enters the end derivatives.

Points farther out keep this lever: otherwise an adjustment could run away along a line to where its
direction has no weight.
"""


class LineOffsets(NamedTuple):
    """Offsets of k points in m axes: across the line in plan, to the left; then, if requested, up.

    Attributes
    ----------
    value
        (k, m) offsets [m].
    gradient
        (k, m, 3) by the points.
    by_ends
        (k, m, 2, 3) by the coordinates of the line's start and end.
    """

    value: Floats
    gradient: Floats
    by_ends: Floats


def compute_line_offsets(points: Floats, ends: Floats, *, upwards: bool) -> LineOffsets:
    """Compute the offsets of points from a line.

    Parameters
    ----------
    points
        (k, 3) east, north, up [m].
    ends
        (2, 3) start and end of the line, apart in plan.
    upwards
        Whether to include the vertical offset above the line.

    Notes
    -----
    With the plan direction d (a unit vector), its normal n and the share t of the way from start A
    to end B at which P projects: across = n.(P - A), up = P_u - A_u - t (B_u - A_u). An error of A
    turns the line about B, so it moves the line at P by 1 - t of it; one of B by t. These relations
    hold for points on the line, to first order; so do the derivatives by the ends.
    """
    start, ahead = ends[0], ends[1] - ends[0]
    length = float(np.hypot(*ahead[:2]))
    along = ahead[:2] / length
    across = np.array([-along[1], along[0], 0.0])
    away = points - start
    share = away[:, :2] @ along / length
    rise = ahead[2] / length
    up = np.array([*(-rise * along), 1.0])
    axes = np.stack([across, up])[: 1 + upwards]
    value = away @ axes.T
    lever = np.clip(share, -MAX_LEVER + 1.0, MAX_LEVER)
    levers = np.stack([1.0 - lever, lever], axis=1)
    gradient = np.broadcast_to(axes, (len(points), *axes.shape))
    return LineOffsets(value, gradient, -levers[:, None, :, None] * axes[None, :, None, :])


def compute_joint_covariance(by_ends: Floats, sigma_m: Floats, own_m: float) -> Floats:
    """Compute the covariance (k m, k m) of all offsets from one line, which share its end errors.

    Parameters
    ----------
    by_ends
        (k, m, 2, 3) from `compute_line_offsets`.
    sigma_m
        (2, 3) sigmas of start and end: east, north, up.
    own_m
        Sigma of the independent error of each offset.
    """
    rows = (by_ends * sigma_m).reshape(len(by_ends) * by_ends.shape[1], -1)
    return np.asarray(rows @ rows.T + own_m**2 * np.eye(len(rows)))


def compute_inverse_root(covariance: Floats) -> Floats:
    """Compute the symmetric matrix W with W W = covariance^-1.

    Among all whitening matrices it keeps each row closest to the original observation (Kessy, Lewin
    and Strimmer 2018, "Optimal whitening and decorrelation"), so that a row can still be attributed
    to its point.
    """
    values, vectors = np.linalg.eigh(covariance)
    return np.asarray((vectors / np.sqrt(values)) @ vectors.T)


class Residuals(NamedTuple):
    """Residuals (..., m), and their gradients (..., m, K, 3) by the points."""

    value: Floats
    gradient: Floats


def right_angle(points: Floats) -> Residuals:
    """Compute 90 degrees minus the angle at the middle one of three points.

    Parameters
    ----------
    points
        (..., 3, 3) [m]; the vertex is the second.

    Returns
    -------
    Residuals
        One [deg; deg/m]; NaN where a leg has no length, and for angles of exactly 0 or 180.
    """
    points = _check_points(points, 3, 3)
    legs, length = unit_vectors(points[..., [0, 2], :] - points[..., [1], :])
    cosine = np.sum(legs[..., 0, :] * legs[..., 1, :], axis=-1)
    sine = np.linalg.norm(cross(legs[..., 0, :], legs[..., 1, :]), axis=-1)
    # d angle / d end: unit vector square to the leg, over the leg's length.
    towards, _ = unit_vectors(legs[..., ::-1, :] - cosine[..., None, None] * legs)
    ends = towards / length[..., None]  # towards the other leg, where the angle decreases
    gradient = np.stack([ends[..., 0, :], -ends.sum(axis=-2), ends[..., 1, :]], axis=-2)
    return _scale_defined(
        np.arctan2(cosine, sine)[..., None], gradient[..., None, :, :], np.degrees(1.0)
    )


def collinear(points: Floats, *, on_ground: bool = False) -> Residuals:
    """Compute the offsets of points from the line through the first and the last of them [m].

    Parameters
    ----------
    points
        (..., K, 3) [m], K >= 3; preferably the first and the last are farthest apart.
    on_ground
        Only offsets along the ground.

    Returns
    -------
    Residuals
        For each point between: its offset along the ground, to the left as seen from the first
        point; and, unless `on_ground`, its upward offset (square to both). For a line steeper than
        `STEEP_RISE`: east and north. NaN where first and last coincide.
    """
    points = _check_points(points, 3)
    between = list(range(1, points.shape[-2] - 1))
    return _offsets(points, between, (0, points.shape[-2] - 1), on_ground=on_ground)


def line_offset(points: Floats, *, on_ground: bool = False) -> Residuals:
    """Compute the signed offset of the first of three points from the line through the others [m].

    This is the distance of `measurements.line_distance` with a sign, or as a vector, for a distance
    that is known to be zero or may be zero within its uncertainty.

    Parameters
    ----------
    points
        (..., 3, 3) [m]: the point, then two of the line.
    on_ground
        Only the offset along the ground.

    Returns
    -------
    Residuals
        As in `collinear`: to the left as seen from the line's first point, then upwards.
    """
    return _offsets(_check_points(points, 3, 3), [0], (1, 2), on_ground=on_ground)


def parallel(points: Floats, *, on_ground: bool = False) -> Residuals:
    """Compute the angle from one line to another that is parallel to it [deg].

    Parameters
    ----------
    points
        (..., 4, 3) [m]: two points of one line, two of the other; the order within a line is free.
    on_ground
        Only the angle along the ground.

    Returns
    -------
    Residuals
        The angle along the ground, anticlockwise from above, from -90 to 90; and, unless
        `on_ground`, the upward angle. For a first line steeper than `STEEP_RISE`: towards east
        and north. NaN where a line has no length, and for lines square to each other.
    """
    points = _check_points(points, 4, 4)
    axes = line_axes(points[..., 1, :] - points[..., 0, :])
    second = points[..., 3, :] - points[..., 2, :]
    ahead = np.sum(second * axes.along, axis=-1)
    ahead = np.where(ahead == 0, np.nan, ahead)
    across, across_by_line = axes.components(on_ground=on_ground)
    aside = np.sum(second[..., None, :] * across, axis=-1)
    # d atan(aside / ahead) = (ahead d aside - aside d ahead) / (ahead^2 + aside^2)
    size = (ahead**2)[..., None] + aside**2
    by_aside, by_ahead = ahead[..., None] / size, -aside / size
    by_second = by_aside[..., None] * across
    by_second = by_second + by_ahead[..., None] * axes.along[..., None, :]
    by_first = by_aside[..., None] * _times(second, across_by_line)
    by_first = by_first + by_ahead[..., None] * _times(second, axes.along_by_line[..., None, :, :])
    gradient = np.stack([-by_first, by_first, -by_second, by_second], axis=-2)
    return _scale_defined(np.arctan(aside / ahead[..., None]), gradient, np.degrees(1.0))


def coplanar(points: Floats) -> Residuals:
    """Compute the distances of the fourth and further points from the plane of the first three [m].

    Parameters
    ----------
    points
        (..., K, 3) [m], K >= 4.

    Returns
    -------
    Residuals
        For each further point, positive on the side from which the first three run anticlockwise.
        NaN where the first three are on one line.
    """
    points = _check_points(points, 4)
    first = points[..., 0, :]
    a, b = points[..., 1, :] - first, points[..., 2, :] - first
    normal, size = unit_vectors(cross(a, b))
    offset = points[..., 3:, :] - first[..., None, :]
    value = np.sum(offset * normal[..., None, :], axis=-1)
    # The normal turns with a and b: dn = (I - n n^T) (da x b + a x db) / |a x b|, and only the
    # offset's part within the plane, o, sees it: o . (da x b) = da . (b x o).
    within = (offset - value[..., None] * normal[..., None, :]) / size[..., None, None]
    by_a, by_b = cross(b[..., None, :], within), cross(within, a[..., None, :])
    count = points.shape[-2]
    gradient = np.zeros((*value.shape, count, 3))
    gradient[..., 1, :], gradient[..., 2, :] = by_a, by_b
    for row in range(count - 3):
        gradient[..., row, row + 3, :] = normal
    gradient[..., 0, :] = -(by_a + by_b + normal[..., None, :])
    return _scale_defined(value, gradient)


def level(points: Floats) -> Residuals:
    """Compute the heights of the second and further points above the first [m].

    Parameters
    ----------
    points
        (..., K, 3) [m], K >= 2.

    Returns
    -------
    Residuals
        For the second and each further point.
    """
    points = _check_points(points, 2)
    further = points.shape[-2] - 1
    gradient = np.zeros((*points.shape[:-2], further, further + 1, 3))
    rows = np.arange(further)
    gradient[..., rows, rows + 1, 2] = 1.0
    gradient[..., 0, 2] = -1.0
    return _scale_defined(points[..., 1:, 2] - points[..., :1, 2], gradient)


def vertical(points: Floats) -> Residuals:
    """Compute the offsets east and north of the second of two points from the first [m].

    Parameters
    ----------
    points
        (..., 2, 3) [m], one above the other where the condition holds.

    Returns
    -------
    Residuals
        East and north.
    """
    points = _check_points(points, 2, 2)
    gradient = np.zeros((*points.shape[:-2], 2, 2, 3))
    for axis in range(2):
        gradient[..., axis, :, axis] = [-1.0, 1.0]
    return _scale_defined(points[..., 1, :2] - points[..., 0, :2], gradient)


def equal_lengths(points: Floats) -> Residuals:
    """Compute the lengths of the second and further lines, less the length of the first [m].

    Parameters
    ----------
    points
        (..., 2 n, 3) [m], n >= 2: both ends of the first line, then of the second, and so on.

    Returns
    -------
    Residuals
        For the second and each further line; NaN where a line has no length.
    """
    points = _check_points(points, 4)
    if points.shape[-2] % 2:
        raise ValueError(f"expected two points for each line, got {points.shape[-2]} points")
    unit, length = unit_vectors(points[..., 1::2, :] - points[..., ::2, :])
    further = length.shape[-1] - 1
    gradient = np.zeros((*points.shape[:-2], further, 2 * further + 2, 3))
    gradient[..., 0, :], gradient[..., 1, :] = unit[..., :1, :], -unit[..., :1, :]
    for row in range(further):
        own = unit[..., row + 1, :]
        gradient[..., row, 2 * row + 2, :], gradient[..., row, 2 * row + 3, :] = -own, own
    return _scale_defined(length[..., 1:] - length[..., :1], gradient)


def _offsets(
    points: Floats, rows: list[int], line: tuple[int, int], *, on_ground: bool
) -> Residuals:
    """Compute offsets of r points (`rows`) from the line through two others, c components each."""
    start, end = line
    axes, by_line = line_axes(points[..., end, :] - points[..., start, :]).components(
        on_ground=on_ground
    )
    offset = points[..., rows, :] - points[..., [start], :]
    value = offset @ axes.swapaxes(-1, -2)
    # Product rule: the offset changes with the points, and the axes with the line.
    moved = np.einsum("...ri,...cij->...rcj", offset, by_line)
    gradient = np.zeros((*value.shape, points.shape[-2], 3))
    gradient[..., end, :] = moved
    gradient[..., start, :] = -moved - axes[..., None, :, :]
    for place, row in enumerate(rows):
        gradient[..., place, :, row, :] = axes
    flat = value.shape[-2] * value.shape[-1]
    return _scale_defined(
        value.reshape(*value.shape[:-2], flat),
        gradient.reshape(*gradient.shape[:-4], flat, *gradient.shape[-2:]),
    )


def _times(vector: Floats, by_line: Floats) -> Floats:
    """Compute v^T D of vectors (..., 3) and derivatives (..., c, 3, 3); (..., c, 3)."""
    return np.asarray(np.einsum("...i,...cij->...cj", vector, by_line))


def _check_points(points: Floats, least: int, most: int | None = None) -> Floats:
    points = np.asarray(points, np.float64)
    if (
        points.ndim < 2
        or points.shape[-1] != 3
        or points.shape[-2] < least
        or (most is not None and points.shape[-2] > most)
    ):
        count = f"{least}" if least == most else f"at least {least}"
        raise ValueError(f"expected {count} points of shape (..., K, 3), got shape {points.shape}")
    return points


def _scale_defined(value: Floats, gradient: Floats, unit: float = 1.0) -> Residuals:
    """Scale residuals and gradients to another unit; all NaN where any of them is not finite."""
    known = np.isfinite(value).all(axis=-1) & np.isfinite(gradient).all(axis=(-3, -2, -1))
    scale = np.asarray(np.where(known, unit, np.nan))
    return Residuals(scale[..., None] * value, scale[..., None, None, None] * gradient)
