"""Initial poses of single frames from known things on the ground, without a log.

The plane is m . X = 1 in the camera frame, m = n / h with the unit normal n towards the ground and
the height h above it, as in `geometry.ground.plane_pose`. Known things that hold on every plane
alike (points in line stay in line in every view) contain no information on it and have no row.

A pose over the plane has three unknowns, two of tilt and one of height. They need three independent
known things (lengths, angles, parallels, equal lengths), at least one of them in metres. Three
lengths have several exact solutions in about half of all scenes, the sides of a triangle nearly
always. Therefore the hemisphere of plane normals is searched, all candidates are refined together
(`minimise_each`), and every distinct minimum is kept. Frames with lengths alone are searched
together (`search_planes`), a frame with other known things by itself (`search_known_planes`).
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache, lru_cache
from typing import NamedTuple

import numpy as np
from scipy.special import chdtri

from uavgram.estimation.solver.batched import (
    ExplicitProblem,
    Linearisation,
    State,
    compute_normal_equations,
    minimise_each,
)
from uavgram.geometry.ground import conditions
from uavgram.geometry.ground.conditions import Residuals, unit_vectors
from uavgram.geometry.ground.plane import (
    compute_end_components,
    differentiate_by_plane,
    lengths_on_plane,
)
from uavgram.model.arrays import Bools, Floats, Ints

_HORIZON = 1e-12
"""Smallest m . v over the length of m: nearer to the horizon a ray does not meet the ground."""


class PlaneThing(NamedTuple):
    """Known thing about points on the ground, all of which one frame shows.

    Attributes
    ----------
    kind
        One of `SCALED_KINDS` or `SHAPE_KINDS`.
    pick
        Its points, in their order, as rows of the frame's picks.
    value
        Metres, square metres or degrees; for conditions any number.
    sigma
        In the same unit.
    """

    kind: str
    pick: tuple[int, ...]
    value: float
    sigma: float


class PlaneRows(NamedTuple):
    """Rows of known things: R rows for each of C planes.

    Attributes
    ----------
    value
        (C, R) residuals; NaN if a point is not before the camera.
    by_plane
        (C, R, 3) derivatives by m.
    sigma
        (C, R) sigmas of the things, including the effect of the picks' sigmas.
    """

    value: Floats
    by_plane: Floats
    sigma: Floats

    def take(self, planes: Ints) -> PlaneRows:
        """Return the rows of some planes, by index."""
        return PlaneRows(*(column[planes] for column in self))


def count_rows(kind: str, points: int) -> int:
    """Return the number of rows of a known thing; 0 if it does not constrain the plane."""
    if kind == "equal_lengths":
        return points // 2 - 1
    return int(kind in SCALED_KINDS or kind in SHAPE_KINDS)


def compute_rows(
    plane: Floats, ray: Floats, ray_sigma: Floats, things: tuple[PlaneThing, ...]
) -> PlaneRows:
    """Compute the residuals of known things on planes.

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


def fit_heights(
    normal: Floats, ray: Floats, ray_sigma: Floats, things: tuple[PlaneThing, ...]
) -> Floats:
    """Compute (C,) heights over planes of given normals that fit the known things in metres.

    The weighted mean of the logarithms of the heights by each length and area.

    Parameters
    ----------
    normal
        (C, 3) unit vectors.
    ray, ray_sigma
        As for `compute_rows`.
    things
        Known things, some of a kind in `SCALED_KINDS`.
    """
    scaled = tuple(one._replace(sigma=0.0) for one in things if one.kind in SCALED_KINDS)
    rows = compute_rows(normal, ray, ray_sigma, scaled)
    wanted = np.array([one.value for one in scaled])
    power = np.array([SCALED_KINDS[one.kind].power for one in scaled])
    own = np.array([one.sigma for one in things if one.kind in SCALED_KINDS]) / wanted
    with np.errstate(invalid="ignore", divide="ignore"):
        unit = rows.value + wanted  # over a plane at height 1
        weight = 1.0 / ((rows.sigma / unit) ** 2 + own**2)
        height = np.log(wanted / unit) / power
        return np.asarray(np.exp(np.sum(weight * height, axis=1) / np.sum(weight, axis=1)))


def _rows(
    thing: PlaneThing, plane: Floats, seen: tuple[Floats, Floats, Floats], ray_sigma: Floats
) -> tuple[Floats, Floats, Floats]:
    """Compute (C, r) values, (C, r, 3) derivatives by m, (C, r) sigmas of one thing."""
    pick = list(thing.pick)
    place, depth, axes = seen[0][:, pick], seen[1][:, pick], seen[2]
    plan = place @ axes.swapaxes(1, 2)
    level = np.concatenate([plan, np.zeros((*plan.shape[:2], 1))], axis=2)
    value, gradient = _function(thing.kind)(level)
    if thing.kind in SCALED_KINDS or thing.kind == "angle":
        value = value - thing.value
    # A point X = v / (m . v) moves by -X (X . dm), and by (dv - X (m . dv)) / (m . v). Axes that
    # turn with the plane only shift and turn the plan, which changes none of the values.
    within = gradient[..., :2]
    by_plane = -np.einsum("crk,cki->cri", np.sum(within * plan[:, None], axis=3), place)
    by_place = within @ axes[:, None]
    reach = np.einsum("crki,cki->crk", by_place, place)
    by_ray = (by_place - reach[..., None] * plane[:, None, None]) / depth[:, None, :, None]
    of_picks = np.sum(by_ray[..., :2] ** 2, axis=3) @ ray_sigma[pick] ** 2
    return value, by_plane, np.sqrt(thing.sigma**2 + of_picks)


def _axes_in(normal: Floats) -> Floats:
    """Return (C, 2, 3) two axes within planes of unit normals (C, 3)."""
    least = np.eye(3)[np.abs(normal).argmin(axis=1)]
    first, _ = unit_vectors(np.cross(normal, least))
    return np.stack([first, np.cross(normal, first)], axis=1)


def _length(points: Floats) -> Residuals:
    """Compute the length through points."""
    unit, length = unit_vectors(points[:, 1:] - points[:, :-1])
    gradient = np.zeros_like(points)
    gradient[:, 1:] += unit
    gradient[:, :-1] -= unit
    return Residuals(length.sum(axis=1)[:, None], gradient[:, None])


def _area(points: Floats) -> Residuals:
    """Compute the area of a polygon in plan by the shoelace formula."""
    after, before = np.roll(points, -1, axis=1), np.roll(points, 1, axis=1)
    twice = np.sum(points[..., 0] * after[..., 1] - points[..., 1] * after[..., 0], axis=1)
    across = after - before
    gradient = np.stack([across[..., 1], -across[..., 0], 0 * across[..., 0]], axis=2)
    half = 0.5 * np.where(twice < 0, -1.0, 1.0)
    return Residuals((half * twice)[:, None], (half[:, None, None] * gradient)[:, None])


def _line_distance(points: Floats) -> Residuals:
    """Compute the distance of the first point from the line through the others."""
    offset = conditions.line_offset(points, on_ground=True)
    sign = np.where(offset.value < 0, -1.0, 1.0)
    return Residuals(sign * offset.value, sign[..., None, None] * offset.gradient)


def _angle(points: Floats) -> Residuals:
    """Compute the angle at the middle point."""
    short = conditions.right_angle(points)
    return Residuals(90.0 - short.value, -short.gradient)


def _parallel(points: Floats) -> Residuals:
    return conditions.parallel(points, on_ground=True)


class _Scaled(NamedTuple):
    """Function of points on a plane, and the power of the height that it is proportional to."""

    function: Callable[[Floats], Residuals]
    power: int


SCALED_KINDS = {
    "distance": _Scaled(_length, 1),
    "horizontal_distance": _Scaled(_length, 1),
    "polyline": _Scaled(_length, 1),
    "line_distance": _Scaled(_line_distance, 1),
    "area": _Scaled(_area, 2),
}
"""Kinds that determine the scale."""

SHAPE_KINDS: dict[str, Callable[[Floats], Residuals]] = {
    "angle": _angle,
    "right_angle": conditions.right_angle,
    "parallel": _parallel,
    "equal_lengths": conditions.equal_lengths,
}
"""Kinds that determine only the shape."""


def _function(kind: str) -> Callable[[Floats], Residuals]:
    return SCALED_KINDS[kind].function if kind in SCALED_KINDS else SHAPE_KINDS[kind]


TILT_STEP_DEG = 7.5
MAX_TILT_DEG = 85.0
NEIGHBOUR_COUNT = 8
"""Number of neighbours of a normal of the grid; a minimum must be lower than all of them."""

MAX_LINES_FOR_ALL_STARTS = 4
"""Number of lines up to which every normal of the grid is a start."""

LOWEST_COUNT = 40
"""Number of normals of lowest cost that are starts in addition to the local minima over the
grid."""

MIN_PROBABILITY = 1e-4
"""Probability below which a minimum no longer counts as an explanation of the known things."""

BLOCK_SIZE = 200_000
"""Lines times candidates at a time: the temporaries stay in the processor's cache."""

ROUND_STEPS, SAME_RELATIVE_DISTANCE = (5, 5, 10, 10), 0.01
"""Steps of each round; relative distance of candidates within which only the best is continued."""

MAX_LAST_REDUCTION = 1e-4
"""Largest reduction of cost by another step of a converged candidate."""

MAX_RELATIVE_SIGMA = 1.0
"""Sigma of a plane as a share of its size, above which its numbers have no meaning."""


class KnownPlanes(NamedTuple):
    """Distinct planes that explain a frame's known things, best first.

    Attributes
    ----------
    plane
        (n, 3) m = normal / height in the camera frame [1/m].
    cost
        (n,) weighted sum of squared residuals; degrees of freedom: number of rows less three.
    """

    plane: Floats
    cost: Floats


NO_PLANES = KnownPlanes(np.zeros((0, 3)), np.zeros(0))


@cache
def make_normal_grid() -> Floats:
    """Return unit vectors (S, 3) towards the ground, nearly evenly over the visible hemisphere."""
    normals = [np.array([[0.0, 0.0, 1.0]])]
    for tilt in np.deg2rad(np.arange(TILT_STEP_DEG, MAX_TILT_DEG + 1e-9, TILT_STEP_DEG)):
        count = max(6, round(2 * np.pi * np.sin(tilt) / np.deg2rad(TILT_STEP_DEG)))
        azimuth = 2 * np.pi * np.arange(count) / count
        ring = [np.sin(tilt) * np.cos(azimuth), np.sin(tilt) * np.sin(azimuth)]
        normals.append(np.stack([*ring, np.full(count, np.cos(tilt))], axis=-1))
    grid = np.concatenate(normals)
    grid.flags.writeable = False
    return grid


@cache
def _neighbours() -> Ints:
    """Return the (NEIGHBOURS, S) nearest others of each normal of the grid."""
    near = np.argsort(-make_normal_grid() @ make_normal_grid().T, axis=1, kind="stable")
    return np.ascontiguousarray(near[:, 1 : NEIGHBOUR_COUNT + 1].T)


def _apply_step(state: State, step: Floats) -> State:
    """Return planes after steps (b, 3)."""
    return (state[0] + step,)


def _keep_distinct(plane: Floats, cost: Floats, information: Floats, rows: int) -> KnownPlanes:
    """Return the planes that the known things allow, farther than a sigma from any better one.

    Parameters
    ----------
    plane, cost, information
        (C, 3), (C,), (C, 3, 3) minima, the best first.
    rows
        Number of rows of the known things.
    """
    kept: list[int] = []
    limit = float(chdtri(max(rows - 3, 1), MIN_PROBABILITY))
    left = np.flatnonzero(cost <= cost[:1] + limit)
    while len(left):
        best = int(left[0])
        kept.append(best)
        apart = plane[left] - plane[best]
        left = left[np.einsum("ki,ij,kj->k", apart, information[best], apart) > 1.0]
    return KnownPlanes(plane[kept], cost[kept])


def search_planes(
    start_ray: Floats, end_ray: Floats, length_m: Floats, sigma_m: Floats
) -> list[KnownPlanes]:
    """Search all distinct planes that explain the lengths of each of many frames, best first.

    Parameters
    ----------
    start_ray, end_ray
        (B, L, 3) undistorted rays of the lines' ends, z = 1, camera frame.
    length_m, sigma_m
        (B, L) lengths, and the sigma of each with that of its two picks; an infinite sigma marks a
        line that a frame does not have (its rays and length are any numbers).

    Returns
    -------
    list of KnownPlanes
        Per frame: always the best one, and every other minimum that the lengths allow; empty if no
        plane of the hemisphere is in front of all rays, or there are fewer than three lines.
    """
    weight = 1.0 / sigma_m
    there = weight > 0
    count = there.sum(axis=1)
    # A missing line becomes a copy of the first present one, without weight.
    stand_in = np.where(there, np.arange(there.shape[1]), there.argmax(axis=1)[:, None])
    take = stand_in[..., None]
    start_ray = np.take_along_axis(start_ray, take, axis=1)
    end_ray = np.take_along_axis(end_ray, take, axis=1)
    length_m = np.take_along_axis(length_m, stand_in, axis=1)
    found: list[KnownPlanes] = []
    step = max(1, BLOCK_SIZE // (len(make_normal_grid()) * max(1, there.shape[1])))
    for first in range(0, len(length_m), step):
        part = slice(first, first + step)
        ends = np.stack([start_ray[part], end_ray[part]]).transpose(3, 0, 1, 2)
        observed = length_m[part] * weight[part], weight[part]
        found += _find_minima(np.ascontiguousarray(ends), observed, count[part])
    return found


def _find_minima(ends: Floats, observed: tuple[Floats, Floats], count: Ints) -> list[KnownPlanes]:
    """Find distinct minima of scenes: rays (3, 2, B, L), weighted lengths and weights (B, L)."""
    start, scene = _starts(ends, observed, count)

    def rows(which: Ints, state: State) -> tuple[Floats, Floats]:
        own = scene[which]
        wanted, weight = observed[0][own], observed[1][own]
        lengths = lengths_on_plane(np.ascontiguousarray(state[0].T)[:, :, None], ends[:, :, own])
        by = differentiate_by_plane(lengths, compute_end_components(lengths)) * weight
        return lengths.length * weight - wanted, np.moveaxis(by, 0, 2)

    minima = minimise_each(ExplicitProblem(rows, _apply_step), (start,))
    # Minima of each scene by cost; keep the distinct ones within the limit.
    order = np.lexsort((minima.cost, scene))
    bounds = np.searchsorted(scene[order], np.arange(len(count) + 1))
    found = []
    for k, number in enumerate(count.tolist()):
        own = order[bounds[k] : bounds[k + 1]]
        own = own[np.isfinite(minima.cost[own])]
        found.append(
            _keep_distinct(minima.state[0][own], minima.cost[own], minima.normal[own], number)
        )
    return found


def _starts(ends: Floats, observed: tuple[Floats, Floats], count: Ints) -> tuple[Floats, Ints]:
    """Compute initial planes (C, 3) and their scenes (C,) from the grid, all or promising ones.

    The height over a normal follows in closed form: lengths are proportional to it. With it, the
    cost over the hemisphere has the same minima as that over all planes: each local minimum of the
    grid is a start. Few lines may have several minima within one step of the grid; then the
    direction of the start decides which of them is reached, and all normals are starts.
    """
    normal = make_normal_grid()
    unit = lengths_on_plane(np.ascontiguousarray(normal.T)[:, None, :, None], ends[:, :, :, None])
    wanted, weight = observed[0][:, None], observed[1][:, None]
    # Height by linear least squares, h = (u . l) / (u . u), and the cost of its residuals.
    scaled = unit.length * weight
    square, mixed = np.sum(scaled * scaled, axis=-1), np.sum(scaled * wanted, axis=-1)
    height = mixed / square
    cost = np.sum(wanted * wanted, axis=-1) - mixed * height
    usable = np.isfinite(cost) & (count >= 3)[:, None]
    cost = np.where(usable, cost, np.inf)
    lowest: Bools = np.ones(cost.shape, bool)
    for near in _neighbours():
        lowest &= cost <= cost[:, near]
    lowest |= cost <= np.partition(cost, LOWEST_COUNT, axis=1)[:, [LOWEST_COUNT]]
    scene, place = np.nonzero(usable & (lowest | (count <= MAX_LINES_FOR_ALL_STARTS)[:, None]))
    return normal[place] / height[scene, place, None], scene


def search_known_planes(
    ray: Floats, ray_sigma: Floats, things: tuple[PlaneThing, ...]
) -> KnownPlanes:
    """Search all distinct planes that explain the known things of a frame.

    Parameters
    ----------
    ray
        (E, 3) undistorted rays of its picks, z = 1.
    ray_sigma
        (E,) of their x and y: those of the pixels over the focal length.
    things
        Known things about its points.

    Returns
    -------
    KnownPlanes
        Empty if the things do not determine a plane: fewer than three rows, none in metres, or all
        of them dependent.
    """
    if count_all_rows(things) < 3 or not any(one.kind in SCALED_KINDS for one in things):
        return NO_PLANES
    used = sorted({k for one in things for k in one.pick})
    at = {pick: k for k, pick in enumerate(used)}
    things = tuple(one._replace(pick=tuple(at[k] for k in one.pick)) for one in things)
    return _search(ray[used].tobytes(), ray_sigma[used].tobytes(), things)


class _Things:
    """Least-squares problem of planes and known things, with sigmas that depend on the planes.

    The state consists of the planes, and the sigmas at the start of the step to them.
    """

    axis = 0

    def __init__(self, ray: Floats, ray_sigma: Floats, things: tuple[PlaneThing, ...]) -> None:
        self._known = ray, ray_sigma, things

    def linearise(self, which: Ints, state: State) -> Linearisation:  # noqa: ARG002
        """Compute normal equations at planes; costs are compared by the sigmas before the step."""
        rows = compute_rows(state[0], *self._known)
        here = compute_normal_equations(
            rows.value / rows.sigma, rows.by_plane / rows.sigma[..., None]
        )
        compared = np.sum((rows.value / state[1]) ** 2, axis=1)
        return here._replace(rest=(rows.sigma,), compared=compared)

    def move(self, state: State, linear: Linearisation, step: Floats) -> State:
        """Apply steps (b, 3) to planes."""
        return state[0] + step, linear.rest[0]

    def minima(self, plane: Floats) -> Floats:
        """Return converged planes (c, 3) from starts (C, 3)."""
        rows = count_all_rows(self._known[2])
        for steps in ROUND_STEPS:
            ends = minimise_each(self, (plane, np.ones((len(plane), rows))), steps)
            plane = ends.state[0][_best_of_neighbours(ends.state[0], ends.cost)]
        return plane


@lru_cache(maxsize=256)
def _search(rays: bytes, sigmas: bytes, things: tuple[PlaneThing, ...]) -> KnownPlanes:
    """Search the planes; cached, because an adjustment begins many times."""
    ray, ray_sigma = np.frombuffer(rays).reshape(-1, 3), np.frombuffer(sigmas)
    normal = make_normal_grid()
    height = fit_heights(normal, ray, ray_sigma, things)
    problem = _Things(ray, ray_sigma, things)
    plane = problem.minima((normal / height[:, None])[np.isfinite(height)])
    rows = count_all_rows(things)
    cost, information, gradient, *_ = problem.linearise(
        np.arange(len(plane)), (plane, np.ones((len(plane), rows)))
    )
    covariance, determined = _covariances(plane, information, cost)
    # Newton decrement g^T N^-1 g: reduction of the cost by another step.
    gain = np.einsum("ci,cij,cj->c", gradient, covariance, gradient)
    resting = np.flatnonzero(gain < MAX_LAST_REDUCTION)
    # Where two solutions merge the remaining one is undetermined; it may be the true one.
    order = resting[np.lexsort((cost[resting], ~determined[resting]))]
    if not determined[order[:1]].any():
        return NO_PLANES
    found = _keep_distinct(plane[order], cost[order], information[order], rows)
    for column in found:
        column.flags.writeable = False
    return found


def count_all_rows(things: tuple[PlaneThing, ...]) -> int:
    """Return the number of rows that known things have together."""
    return sum(count_rows(one.kind, len(one.pick)) for one in things)


def _best_of_neighbours(plane: Floats, cost: Floats) -> Ints:
    """Return indices of the planes of least cost among those within a hundredth of each other."""
    size = np.linalg.norm(plane, axis=1)
    cell = np.round(np.column_stack([plane / size[:, None], np.log(size)]) / SAME_RELATIVE_DISTANCE)
    order = np.argsort(cost, kind="stable")[: np.isfinite(cost).sum()]
    _, first = np.unique(cell[order], axis=0, return_index=True)
    return np.sort(order[first])


def _covariances(plane: Floats, information: Floats, cost: Floats) -> tuple[Floats, Bools]:
    """Compute (C, 3, 3) inverses with sigmas up to `MAX_RELATIVE_SIGMA`, (C,) if none is larger.

    Parameters
    ----------
    plane, information, cost
        (C, 3), (C, 3, 3), (C,); no information where the cost is NaN.
    """
    size = np.linalg.norm(plane, axis=1)
    relative = information * (size**2)[:, None, None]
    relative[~np.isfinite(cost)] = 0.0
    value, vector = np.linalg.eigh(relative)
    turned = vector / np.maximum(value, MAX_RELATIVE_SIGMA**-2)[:, None]
    return turned @ vector.swapaxes(1, 2) * (size**2)[:, None, None], value[
        :, 0
    ] > MAX_RELATIVE_SIGMA**-2
