"""First values of tie points: where their rays meet, or where these meet the ground."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from uavgram.estimation.first_poses.free_points import WIDE, in_front, means_of, rays_meet
from uavgram.estimation.first_poses.network import FirstValues
from uavgram.geometry.camera.back_projection import back_project
from uavgram.geometry.ground.plane import intersect_ground
from uavgram.model.arrays import Bools, Floats, Ints
from uavgram.model.survey.survey import Survey
from uavgram.model.survey.ties import Sightings

NEAREST = 0.05
"""Of the flying height: a point whose first value is nearer to its camera than that has none. The
camera itself moves by some of it while it reads its rows."""

FEWEST_LABELS = 3
"""Labels in a frame that give it its pose where its ties say nothing but how it is turned."""


def with_first_ties(survey: Survey, values: FirstValues) -> tuple[Survey, Floats]:
    """The survey without sightings that have no first values, and those of the tie points.

    Parameters
    ----------
    survey
        The observations.
    values
        Of poses and labels.

    Returns
    -------
    survey
        Without sightings of points that are not in front of their cameras, and without ties that
        say no more than the labels in their frames do.
    point_m : (T, 3)
        Of chains of matches east, north and departure; then of tie points east, north, up.
    """
    if not survey.matches.points + survey.ties.points:
        return survey, np.zeros((0, 3))
    chain, tie = _chains(survey, values), _ties(survey, values)
    label = survey.pick_label[survey.matches.pick]
    up = values.height_m + survey.height_above_m[label] + chain[:, 2]
    matches, chains = _in_front(survey.matches, np.column_stack([chain[:, :2], up]), values)
    tie[_from_one_place(survey, values)] = np.nan
    ties, points = _in_front(survey.ties, tie, values)
    usable = replace(survey, matches=matches, ties=ties)
    return usable, np.concatenate([chain[chains], tie[points]])


def _from_one_place(survey: Survey, values: FirstValues) -> Bools:
    """(T,) ties that frames which only turned show, while labels in each of them give its pose.

    They have no depth, and iterations would not come to rest on the way to one.
    """
    ties = survey.ties
    low, high = np.full((ties.points, 3), np.inf), np.full((ties.points, 3), -np.inf)
    np.minimum.at(low, ties.point, values.center[ties.frame])
    np.maximum.at(high, ties.point, values.center[ties.frame])
    labels = np.bincount(seen_labels(survey)[0], minlength=len(survey.frame_id))
    fewest = np.full(ties.points, FEWEST_LABELS)
    np.minimum.at(fewest, ties.point, labels[ties.frame])
    return np.asarray((low == high).all(axis=1) & (fewest == FEWEST_LABELS))


def seen_labels(survey: Survey) -> tuple[Ints, Ints]:
    """Frames and labels, (n,) each, of all pairs of which one shows the other."""
    matches = survey.matches
    own = survey.pick_label[matches.pick][matches.point]
    frame = np.concatenate([survey.pick_frame, matches.frame])
    label = np.concatenate([survey.pick_label, own])
    first, second = np.unique(np.stack([frame, label]), axis=1)
    return first, second


def _chains(survey: Survey, values: FirstValues) -> Floats:
    """(T, 3) east, north and departure of the chains of matches: those of their labels."""
    label = survey.pick_label[survey.matches.pick]
    return np.column_stack([values.point_m[label], values.departure_m[label]])


def _ties(survey: Survey, values: FirstValues) -> Floats:
    """(T, 3) of the tie points: where the rays meet well ahead; else where they meet the ground."""
    ties, camera = survey.ties, survey.calibration
    ray = back_project(camera.model, camera.parameters, ties.pixel_px)
    direction = np.einsum("nij,nj->ni", values.rotation[ties.frame], ray)
    direction /= np.linalg.norm(direction, axis=1)[:, None]
    good = np.isfinite(direction[:, 0]) & np.isfinite(values.center[ties.frame, 0])
    seen, owner = (values.center[ties.frame[good]], direction[good]), ties.point[good]
    met, spread = rays_meet(*seen, ties.sigma_px[good] / camera.parameters[0], owner, ties.points)
    plane = np.array([values.height_m, 0.0, 0.0])
    ground = intersect_ground(*seen, plane, np.zeros(2), np.zeros(len(owner)))
    point = means_of(ground, owner, ties.points)
    meets = in_front(met, *seen, owner) & (spread <= WIDE)
    point[meets] = met[meets]
    return point


def _in_front(sightings: Sightings, world_m: Floats, values: FirstValues) -> tuple[Sightings, Ints]:
    """Sightings of points (T, 3) well in front of their cameras, and which points these are.

    Parameters
    ----------
    sightings
        Which frame shows which point.
    world_m
        (T, 3) first values; NaN of points without.
    values
        Of poses.
    """
    away = world_m[sightings.point] - values.center[sightings.frame]
    forward = values.rotation[sightings.frame][:, :, 2]
    depth = np.einsum("ni,ni->n", away, forward)
    height = np.abs(values.center[sightings.frame, 2] - values.height_m)
    return sightings.without(~(depth > NEAREST * height))
