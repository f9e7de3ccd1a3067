"""First values of points whose height is free: where the rays of their picks meet."""

from __future__ import annotations

import numpy as np

from uavgram.estimation.first_poses.network import FirstValues
from uavgram.geometry.camera.back_projection import back_project
from uavgram.geometry.ground.plane import intersect_ground
from uavgram.model.arrays import Bools, Floats, Ints
from uavgram.model.survey.survey import Survey

WIDE = 0.1
"""Standard deviation of where rays meet, as a share of how far away that is, from which on they say
nothing: as a rule they then come from one place."""


def with_free_points(survey: Survey, ray: Floats, values: FirstValues) -> FirstValues:
    """First values with the places of the points whose height is free.

    A point gets none (NaN) where its rays say nothing, unless its coordinates or something else
    known of it may tell: such a point begins at its coordinates, or on the ground.

    Parameters
    ----------
    survey
        The observations.
    ray
        (P, 3) of its picks, in their cameras.
    values
        With poses.
    """
    free = np.flatnonzero(survey.is_free)
    if not len(free):
        return values
    frame, label, ray, sigma_px = _with_chains(survey, ray)
    rows = np.flatnonzero(survey.is_free[label] & np.isfinite(values.center[frame, 0]))
    center, owner = values.center[frame[rows]], label[rows]
    direction = np.einsum("nij,nj->ni", values.rotation[frame[rows]], ray[rows])
    direction /= np.linalg.norm(direction, axis=1)[:, None]
    sigma = sigma_px[rows] / survey.calibration.parameters[0]
    met, spread = rays_meet(center, direction, sigma, owner, len(survey.label))
    plane = np.array([values.height_m, 0.0, 0.0])
    ground = intersect_ground(center, direction, plane, np.zeros(2), np.zeros(len(rows)))
    point = means_of(ground, owner, len(survey.label))
    point[survey.control_label] = survey.control_world_m
    anchored = np.zeros(len(survey.label), dtype=np.bool_)
    for known in (survey.control_label, survey.line_start, survey.line_end):
        anchored[known] = True
    for thing in survey.known:
        anchored[list(thing.label)] = True
    point[~anchored & (spread > WIDE)] = np.nan
    good = in_front(met, center, direction, owner) & (spread <= WIDE)
    point[good] = met[good]
    point_m, departure_m = values.point_m.copy(), values.departure_m.copy()
    point_m[free] = point[free, :2]
    departure_m[free] = np.nan_to_num(point[free, 2] - values.height_m)
    return values._replace(point_m=point_m, departure_m=departure_m)


def _with_chains(survey: Survey, ray: Floats) -> tuple[Ints, Ints, Floats, Floats]:
    """Frames, labels, rays and sigmas [px] of the picks and of the matches found from them."""
    matches, camera = survey.matches, survey.calibration
    found = back_project(camera.model, camera.parameters, matches.pixel_px)
    return (
        np.concatenate([survey.pick_frame, matches.frame]),
        np.concatenate([survey.pick_label, survey.pick_label[matches.pick][matches.point]]),
        np.concatenate([ray, found]),
        np.concatenate([survey.pick_sigma_px, matches.sigma_px]),
    )


def rays_meet(
    center: Floats, direction: Floats, sigma_rad: Floats, owner: Ints, count: int
) -> tuple[Floats, Floats]:
    """Where rays meet (K, 3), and the largest sigma of that, as a share of its distance (K,).

    The point nearest to all rays, in sigmas: minimum of the sum of |(I - d d^T)(x - c)|^2 over
    (sigma times the distance)^2, the distances those of the unweighted one.

    Parameters
    ----------
    center, direction
        (n, 3) where rays begin, and unit vectors along them.
    sigma_rad
        (n,) standard deviations across them.
    owner
        (n,) point of each, 0 to count - 1.
    count
        Number K of points.
    """
    across = np.eye(3) - direction[:, :, None] * direction[:, None, :]
    onto = np.einsum("nij,nj->ni", across, center)
    weight = np.ones(len(owner))
    met, spread = np.full((count, 3), np.nan), np.full(count, np.inf)
    for _ in range(2):
        normal = _sums(weight[:, None] * across.reshape(-1, 9), owner, count).reshape(-1, 3, 3)
        right = _sums(weight[:, None] * onto, owner, count)
        values = np.linalg.eigvalsh(normal)
        solvable = values[:, 0] > 1e-12 * values[:, 2]
        met[solvable] = np.linalg.solve(normal[solvable], right[solvable, :, None])[..., 0]
        distance = np.linalg.norm(met[owner] - center, axis=1)
        weight = np.nan_to_num(1.0 / np.maximum(sigma_rad * distance, 1e-9) ** 2, nan=1.0)
        mean = np.bincount(owner, distance, count) / np.maximum(np.bincount(owner, None, count), 1)
        with np.errstate(divide="ignore", invalid="ignore"):
            largest = 1.0 / np.sqrt(values[:, 0]) / mean
        spread = np.where(solvable & np.isfinite(largest), largest, np.inf)
    return met, spread


def _sums(rows: Floats, owner: Ints, count: int) -> Floats:
    """(count, k) sum of the rows (n, k) of each owner."""
    return np.stack([np.bincount(owner, column, count) for column in rows.T], axis=1)


def in_front(met: Floats, center: Floats, direction: Floats, owner: Ints) -> Bools:
    """(K,) which points lie ahead on all of their rays.

    Parameters
    ----------
    met
        (K, 3) points; NaN of those without.
    center, direction
        (n, 3) where rays begin, and unit vectors along them.
    owner
        (n,) point of each ray.
    """
    ahead = np.einsum("ni,ni->n", met[owner] - center, direction) > 0
    behind = np.bincount(owner[~ahead], minlength=len(met)) > 0
    return np.asarray(np.isfinite(met[:, 0]) & ~behind)


def means_of(place: Floats, owner: Ints, count: int) -> Floats:
    """(count, 3) mean of the finite rows of each owner; NaN where there is none.

    Parameters
    ----------
    place
        (n, 3) places.
    owner
        (n,) point of each.
    count
        Number of points.
    """
    finite = np.isfinite(place).all(axis=1)
    total = np.zeros((count, 3))
    np.add.at(total, owner[finite], place[finite])
    number = np.bincount(owner[finite], minlength=count)
    return np.where(number[:, None] > 0, total / np.maximum(number, 1)[:, None], np.nan)
