"""Initial values of points off the ground and of tie points: intersections of their rays."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from uavgram.estimation.first_poses.network import FirstValues
from uavgram.estimation.survey.selection import replace_matches_by_picks
from uavgram.geometry.camera.projection import back_project
from uavgram.geometry.ground.plane import intersect_ground
from uavgram.model.arrays import Bools, Floats, Ints
from uavgram.model.survey import Sightings, Survey

MAX_RELATIVE_SIGMA = 0.1
"""Sigma of an intersection of rays, as a share of its distance, above which it has no meaning:
usually the rays then come from one place."""


def add_free_points(survey: Survey, values: FirstValues) -> FirstValues:
    """Add initial values of the points whose height is free.

    A point gets none (NaN) if its rays do not determine it, unless its coordinates or another known
    thing may do so: such a point starts at its coordinates, or on the ground.

    Parameters
    ----------
    survey
        Observations.
    values
        Initial values with poses.
    """
    free = np.flatnonzero(survey.is_free)
    if not len(free):
        return values
    shown, camera = replace_matches_by_picks(survey), survey.calibration
    frame, label = shown.pick_frame, shown.pick_label
    rows = np.flatnonzero(survey.is_free[label] & np.isfinite(values.center[frame, 0]))
    center, owner = values.center[frame[rows]], label[rows]
    ray = back_project(camera.model, camera.parameters, shown.pixel_px[rows])
    direction = np.einsum("nij,nj->ni", values.rotation[frame[rows]], ray)
    direction /= np.linalg.norm(direction, axis=1)[:, None]
    sigma = shown.pick_sigma_px[rows] / camera.parameters[0]
    # Intersections of the rays; where these fail, the mean intersection with the ground.
    met, spread = intersect_rays(center, direction, sigma, owner, len(survey.label))
    plane = np.array([values.height_m, 0.0, 0.0])
    ground = intersect_ground(center, direction, plane, np.zeros(2), np.zeros(len(rows)))
    point = compute_means(ground, owner, len(survey.label))
    point[survey.control_label] = survey.control_world_m
    anchored = np.zeros(len(survey.label), dtype=np.bool_)
    for known in (survey.control_label, survey.line_start, survey.line_end):
        anchored[known] = True
    for thing in survey.known:
        anchored[list(thing.label)] = True
    point[~anchored & (spread > MAX_RELATIVE_SIGMA)] = np.nan
    good = are_in_front(met, center, direction, owner) & (spread <= MAX_RELATIVE_SIGMA)
    point[good] = met[good]
    point_m, departure_m = values.point_m.copy(), values.departure_m.copy()
    point_m[free] = point[free, :2]
    departure_m[free] = np.nan_to_num(point[free, 2] - values.height_m)
    return values._replace(point_m=point_m, departure_m=departure_m)


def intersect_rays(
    center: Floats, direction: Floats, sigma_rad: Floats, owner: Ints, count: int
) -> tuple[Floats, Floats]:
    """Intersect rays: points (K, 3), and their largest sigma as a share of the distance (K,).

    The point nearest to all rays, in sigmas: minimum of the sum of |(I - d d^T)(x - c)|^2 over
    (sigma times the distance)^2, the distances those of the unweighted one.

    Parameters
    ----------
    center, direction
        (n, 3) origins of the rays, and unit vectors along them.
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
    # First without weights, then with weights by the distances.
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
    """Sum the rows (n, k) of each owner, to (count, k)."""
    return np.stack([np.bincount(owner, column, count) for column in rows.T], axis=1)


def are_in_front(met: Floats, center: Floats, direction: Floats, owner: Ints) -> Bools:
    """Mark the points (K,) that are ahead on all of their rays.

    Parameters
    ----------
    met
        (K, 3) points; NaN for missing ones.
    center, direction
        (n, 3) origins of the rays, and unit vectors along them.
    owner
        (n,) point of each ray.
    """
    ahead = np.einsum("ni,ni->n", met[owner] - center, direction) > 0
    behind = np.bincount(owner[~ahead], minlength=len(met)) > 0
    return np.asarray(np.isfinite(met[:, 0]) & ~behind)


def compute_means(place: Floats, owner: Ints, count: int) -> Floats:
    """Compute (count, 3) means of the finite rows of each owner; NaN if there is none.

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


MIN_RELATIVE_DISTANCE = 0.05
"""Smallest distance of an initial point from its camera, as a share of the flying height. The
camera itself moves by part of it during the readout."""

MIN_LABELS = 3
"""Number of labels in a frame that determine its pose if its ties determine only its rotation."""


def add_first_ties(survey: Survey, values: FirstValues) -> tuple[Survey, Floats]:
    """Remove sightings without initial values, and return those of the remaining tie points.

    Parameters
    ----------
    survey
        Observations.
    values
        Initial values of poses and labels.

    Returns
    -------
    survey
        Without sightings of points that are not in front of their cameras, and without ties that
        are redundant to the labels in their frames.
    point_m : (T, 3)
        For chains of matches east, north and departure; then for tie points east, north, up.
    """
    if not survey.matches.points + survey.ties.points:
        return survey, np.zeros((0, 3))
    chain, tie = _chains(survey, values), _ties(survey, values)
    label = survey.pick_label[survey.matches.pick]
    up = values.height_m + survey.height_above_m[label] + chain[:, 2]
    matches, chains = _keep_in_front(survey.matches, np.column_stack([chain[:, :2], up]), values)
    tie[_are_from_one_place(survey, values)] = np.nan
    ties, points = _keep_in_front(survey.ties, tie, values)
    usable = replace(survey, matches=matches, ties=ties)
    return usable, np.concatenate([chain[chains], tie[points]])


def _are_from_one_place(survey: Survey, values: FirstValues) -> Bools:
    """Mark ties (T,) of frames that only turned, while labels in each of them give its pose.

    They have no depth, and iterations on it would not converge.
    """
    ties = survey.ties
    low, high = np.full((ties.points, 3), np.inf), np.full((ties.points, 3), -np.inf)
    np.minimum.at(low, ties.point, values.center[ties.frame])
    np.maximum.at(high, ties.point, values.center[ties.frame])
    labels = np.bincount(find_seen_labels(survey)[0], minlength=len(survey.frame_id))
    fewest = np.full(ties.points, MIN_LABELS)
    np.minimum.at(fewest, ties.point, labels[ties.frame])
    return np.asarray((low == high).all(axis=1) & (fewest == MIN_LABELS))


def find_seen_labels(survey: Survey) -> tuple[Ints, Ints]:
    """Return frames and labels, (n,) each, of all pairs in which the frame shows the label."""
    shown = replace_matches_by_picks(survey)
    first, second = np.unique(np.stack([shown.pick_frame, shown.pick_label]), axis=1)
    return first, second


def _chains(survey: Survey, values: FirstValues) -> Floats:
    """Return (T, 3) east, north and departure of chains of matches: those of their labels."""
    label = survey.pick_label[survey.matches.pick]
    return np.column_stack([values.point_m[label], values.departure_m[label]])


def _ties(survey: Survey, values: FirstValues) -> Floats:
    """Intersect the rays of tie points (T, 3) if well ahead; else the rays and the ground."""
    ties, camera = survey.ties, survey.calibration
    ray = back_project(camera.model, camera.parameters, ties.pixel_px)
    direction = np.einsum("nij,nj->ni", values.rotation[ties.frame], ray)
    direction /= np.linalg.norm(direction, axis=1)[:, None]
    good = np.isfinite(direction[:, 0]) & np.isfinite(values.center[ties.frame, 0])
    seen, owner = (values.center[ties.frame[good]], direction[good]), ties.point[good]
    met, spread = intersect_rays(
        *seen, ties.sigma_px[good] / camera.parameters[0], owner, ties.points
    )
    plane = np.array([values.height_m, 0.0, 0.0])
    ground = intersect_ground(*seen, plane, np.zeros(2), np.zeros(len(owner)))
    point = compute_means(ground, owner, ties.points)
    meets = are_in_front(met, *seen, owner) & (spread <= MAX_RELATIVE_SIGMA)
    point[meets] = met[meets]
    return point


def _keep_in_front(
    sightings: Sightings, world_m: Floats, values: FirstValues
) -> tuple[Sightings, Ints]:
    """Keep sightings of points (T, 3) well in front of their cameras; return these points, too.

    Parameters
    ----------
    sightings
        Sightings: frame and point of each.
    world_m
        (T, 3) initial values; NaN for points without.
    values
        Initial values of poses.
    """
    away = world_m[sightings.point] - values.center[sightings.frame]
    forward = values.rotation[sightings.frame][:, :, 2]
    depth = np.einsum("ni,ni->n", away, forward)
    height = np.abs(values.center[sightings.frame, 2] - values.height_m)
    return sightings.without(~(depth > MIN_RELATIVE_DISTANCE * height))
