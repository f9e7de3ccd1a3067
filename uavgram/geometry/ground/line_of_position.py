"""Axes of straight lines, and distances of points from a line of known position."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

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
    aside, size = unit_vectors(np.cross(reference, along))
    # Chain rule through the cross products and the normalisation.
    along_by_line = _square_to(along, length)
    across_by_line = np.cross(reference[..., None, :], along_by_line.swapaxes(-1, -2))
    aside_by_line = _square_to(aside, size) @ across_by_line.swapaxes(-1, -2)
    turned = np.cross(along_by_line.swapaxes(-1, -2), aside[..., None, :])
    turned = turned + np.cross(along[..., None, :], aside_by_line.swapaxes(-1, -2))
    upward = np.cross(along, aside)
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
