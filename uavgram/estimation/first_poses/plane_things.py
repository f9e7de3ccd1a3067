"""What is known of points on the ground, as one frame sees them: rows that say where its plane is.

The plane is m . X = 1 in the camera frame, m = n / h with the unit normal n towards the ground and
the height h above it, as in `geometry.ground.plane_pose`. Known things that hold on every plane
alike (points in line stay in line from wherever they are seen) say nothing of it and have no row.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from uavgram.geometry.ground import conditions
from uavgram.geometry.ground.conditions import Residuals
from uavgram.geometry.ground.line_axes import unit_vectors
from uavgram.model.arrays import Floats, Ints

_HORIZON = 1e-12
"""Smallest m . v over the length of m: nearer to the horizon a ray meets no ground."""


class PlaneThing(NamedTuple):
    """Something known of points on the ground that one frame sees whole.

    Attributes
    ----------
    kind
        One of `SCALED` or `SHAPED`.
    pick
        Its points, in their order, as rows of the frame's picks.
    value
        Metres, square metres or degrees; of conditions any number.
    sigma
        In the same unit.
    """

    kind: str
    pick: tuple[int, ...]
    value: float
    sigma: float


class PlaneRows(NamedTuple):
    """R rows of the things that C planes should fulfil.

    Attributes
    ----------
    value
        (C, R) what they miss; NaN where a point is not before the camera.
    by_plane
        (C, R, 3) derivatives by m.
    sigma
        (C, R) of the things, with those of the picks as they work there.
    """

    value: Floats
    by_plane: Floats
    sigma: Floats

    def take(self, planes: Ints) -> PlaneRows:
        """Those of some planes, by index."""
        return PlaneRows(*(column[planes] for column in self))


def row_count(kind: str, points: int) -> int:
    """Number of rows that a known thing has; 0 where it says nothing of the plane."""
    if kind == "equal_lengths":
        return points // 2 - 1
    return int(kind in SCALED or kind in SHAPED)


def rows_on_planes(
    plane: Floats, ray: Floats, ray_sigma: Floats, things: tuple[PlaneThing, ...]
) -> PlaneRows:
    """What known things miss on planes.

    Parameters
    ----------
    plane
        (C, 3) m [1/m].
    ray
        (E, 3) undistorted rays of the frame's picks, z = 1.
    ray_sigma
        (E,) of their x and y.
    things
        At least one.
    """
    size = np.linalg.norm(plane, axis=1)
    with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
        depth = plane @ ray.T
        depth[depth <= _HORIZON * size[:, None]] = np.nan
        place = ray / depth[..., None]
        axes = _axes_in(plane / size[:, None])
        found = [_rows(one, plane, (place, depth, axes), ray_sigma) for one in things]
    return PlaneRows(*(np.concatenate(column, axis=1) for column in zip(*found, strict=True)))


def fitting_heights(
    normal: Floats, ray: Floats, ray_sigma: Floats, things: tuple[PlaneThing, ...]
) -> Floats:
    """(C,) heights over planes of given normals that suit what is known in metres.

    The mean of what each length and area says, by their logarithms: where they agree, the height.

    Parameters
    ----------
    normal
        (C, 3) unit vectors.
    ray, ray_sigma
        As for `rows_on_planes`.
    things
        Some of them of a kind in `SCALED`.
    """
    scaled = tuple(one._replace(sigma=0.0) for one in things if one.kind in SCALED)
    rows = rows_on_planes(normal, ray, ray_sigma, scaled)
    wanted = np.array([one.value for one in scaled])
    power = np.array([SCALED[one.kind].power for one in scaled])
    own = np.array([one.sigma for one in things if one.kind in SCALED]) / wanted
    with np.errstate(invalid="ignore", divide="ignore"):
        unit = rows.value + wanted  # over a plane at height 1
        weight = 1.0 / ((rows.sigma / unit) ** 2 + own**2)
        height = np.log(wanted / unit) / power
        return np.asarray(np.exp(np.sum(weight * height, axis=1) / np.sum(weight, axis=1)))


def _rows(
    thing: PlaneThing, plane: Floats, seen: tuple[Floats, Floats, Floats], ray_sigma: Floats
) -> tuple[Floats, Floats, Floats]:
    """(C, r) values, (C, r, 3) derivatives by m, (C, r) sigmas of one thing."""
    pick = list(thing.pick)
    place, depth, axes = seen[0][:, pick], seen[1][:, pick], seen[2]
    plan = place @ axes.swapaxes(1, 2)
    level = np.concatenate([plan, np.zeros((*plan.shape[:2], 1))], axis=2)
    value, gradient = _function(thing.kind)(level)
    if thing.kind in SCALED or thing.kind == "angle":
        value = value - thing.value
    # A point X = v / (m . v) moves by -X (X . dm), and by (dv - X (m . dv)) / (m . v). Axes that
    # turn with the plane shift and turn the whole plan, which changes none of the values.
    within = gradient[..., :2]
    by_plane = -np.einsum("crk,cki->cri", np.sum(within * plan[:, None], axis=3), place)
    by_place = within @ axes[:, None]
    reach = np.einsum("crki,cki->crk", by_place, place)
    by_ray = (by_place - reach[..., None] * plane[:, None, None]) / depth[:, None, :, None]
    of_picks = np.sum(by_ray[..., :2] ** 2, axis=3) @ ray_sigma[pick] ** 2
    return value, by_plane, np.sqrt(thing.sigma**2 + of_picks)


def _axes_in(normal: Floats) -> Floats:
    """(C, 2, 3) two axes within planes of unit normals (C, 3)."""
    least = np.eye(3)[np.abs(normal).argmin(axis=1)]
    first, _ = unit_vectors(np.cross(normal, least))
    return np.stack([first, np.cross(normal, first)], axis=1)


def _length(points: Floats) -> Residuals:
    """Length through points."""
    unit, length = unit_vectors(points[:, 1:] - points[:, :-1])
    gradient = np.zeros_like(points)
    gradient[:, 1:] += unit
    gradient[:, :-1] -= unit
    return Residuals(length.sum(axis=1)[:, None], gradient[:, None])


def _area(points: Floats) -> Residuals:
    """Area of a polygon in plan: the shoelace formula."""
    after, before = np.roll(points, -1, axis=1), np.roll(points, 1, axis=1)
    twice = np.sum(points[..., 0] * after[..., 1] - points[..., 1] * after[..., 0], axis=1)
    across = after - before
    gradient = np.stack([across[..., 1], -across[..., 0], 0 * across[..., 0]], axis=2)
    half = 0.5 * np.where(twice < 0, -1.0, 1.0)
    return Residuals((half * twice)[:, None], (half[:, None, None] * gradient)[:, None])


def _line_distance(points: Floats) -> Residuals:
    """Distance of the first point from the line through the others."""
    offset = conditions.line_offset(points, on_ground=True)
    sign = np.where(offset.value < 0, -1.0, 1.0)
    return Residuals(sign * offset.value, sign[..., None, None] * offset.gradient)


def _angle(points: Floats) -> Residuals:
    """Angle at the middle point."""
    short = conditions.right_angle(points)
    return Residuals(90.0 - short.value, -short.gradient)


def _parallel(points: Floats) -> Residuals:
    return conditions.parallel(points, on_ground=True)


class _Scaled(NamedTuple):
    """A function of points on a plane, and the power of the height that it grows with."""

    function: Callable[[Floats], Residuals]
    power: int


SCALED = {
    "distance": _Scaled(_length, 1),
    "horizontal_distance": _Scaled(_length, 1),
    "polyline": _Scaled(_length, 1),
    "line_distance": _Scaled(_line_distance, 1),
    "area": _Scaled(_area, 2),
}
"""Kinds that say how large things are."""

SHAPED: dict[str, Callable[[Floats], Residuals]] = {
    "angle": _angle,
    "right_angle": conditions.right_angle,
    "parallel": _parallel,
    "equal_lengths": conditions.equal_lengths,
}
"""Kinds that only say which shape they have."""


def _function(kind: str) -> Callable[[Floats], Residuals]:
    return SCALED[kind].function if kind in SCALED else SHAPED[kind]
