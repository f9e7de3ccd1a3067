"""Assign labels to the picks of a photo, regardless of their present labels.

The pose of the photo is the one that most picks agree on, each with the nearest label. With a log
it begins at the logged pose, shifted, rotated and scaled by two picks (Fischler & Bolles 1981);
without one, at the pose by those labels that are right.
"""

from __future__ import annotations

import numpy as np

from uavgram.estimation.first_poses.resection import (
    AGREEMENT_SIGMAS,
    MIN_PICKS,
    find_consensus,
    project_points,
    resect_in_space,
)
from uavgram.geometry.camera.projection import back_project, project
from uavgram.model.arrays import Floats, Ints
from uavgram.stages.refine.causes.hypothesis import Diagnosis
from uavgram.stages.refine.causes.stray_picks import labels_of

MAX_DISTANCE_BY_LOG = 0.2
"""Largest distance of a pick from its label's place by the log, as a share of the photo's width."""

MAX_DISTANCE = 0.02
"""Largest such distance once the photo is shifted, rotated and scaled."""

MAX_SCALE_ERROR, MAX_ROTATION_RAD = 0.15, 0.3
"""Largest errors of the log's pose: relative scale, and rotation [rad]."""

MAX_PICKS, MAX_PAIRS = 12, 4000
"""Largest numbers of picks of which pairs are tried, and of pairs of picks with labels."""

MAX_ROUNDS = 4
"""Rounds of alternating pose and labels."""


def assign_labels(diagnosis: Diagnosis, frame: int, picks: Ints) -> Ints:
    """Find the labels (n,) of the survey that belong to picks of a photo; -1 where none is near.

    Parameters
    ----------
    diagnosis
        The survey, adjusted without the photo.
    frame, picks
        Photo of the survey, and (n,) its picks.
    """
    survey = diagnosis.survey
    at = labels_of(diagnosis)
    label = np.flatnonzero((at >= 0) & ~survey.is_free)
    adjustment = diagnosis.adjustment
    world, _, _ = adjustment.problem.world_points(adjustment.state, at[label])
    camera = survey.calibration
    ray = back_project(camera.model, camera.parameters, survey.pixel_px[picks])
    near = AGREEMENT_SIGMAS * survey.pick_sigma_px[picks] / camera.parameters[0]
    none = np.full(len(picks), -1)
    if not len(label) or not np.isfinite(ray).all():
        return none
    if survey.seeds is None:
        # Without a log: begin with the picks whose own labels agree on a pose.
        own = np.searchsorted(label, survey.pick_label[picks])
        own = np.minimum(own, len(label) - 1)
        own[label[own] != survey.pick_label[picks]] = -1
        there = np.flatnonzero(own >= 0)
        agree = find_consensus(world[own[there]], ray[there], near[there] / AGREEMENT_SIGMAS)
        if agree is None:
            return none
        found = none.copy()
        found[there[agree]] = own[there[agree]]
    else:
        # With a log: project all labels by its pose, and match picks by pairs.
        pose = survey.seeds.center_world_m[frame], survey.seeds.world_from_camera[frame]
        place = project(camera.model, camera.parameters, (world - pose[0]) @ pose[1])
        found = _labels_by_pairs(survey.pixel_px[picks], place, float(camera.width_px))
    found = _alternate(world, ray, near, found)
    return np.where(found >= 0, label[found], -1)


def _labels_by_pairs(pixel: Floats, place: Floats, width_px: float) -> Ints:
    """Find the label (n,) of each pick by consensus of similarities; -1 where none is near.

    Parameters
    ----------
    pixel, place
        (n, 2), (k, 2) picks, and places of the labels by the log [px].
    width_px
        Width of the photo.
    """
    z, q = pixel @ np.array([1.0, 1.0j]), place @ np.array([1.0, 1.0j])
    distance = np.abs(z[:, None] - q[None])
    pick, label = np.nonzero(distance[:MAX_PICKS] < MAX_DISTANCE_BY_LOG * width_px)
    first, second = np.triu_indices(len(pick), 1)
    use = (pick[first] != pick[second]) & (label[first] != label[second])
    first, second = first[use], second[use]
    # Scale and rotation of each pair as a complex factor.
    ratio = (z[pick[first]] - z[pick[second]]) / (q[label[first]] - q[label[second]])
    like = (np.abs(np.abs(ratio) - 1.0) < MAX_SCALE_ERROR) & (
        np.abs(np.angle(ratio)) < MAX_ROTATION_RAD
    )
    first, ratio = first[like], ratio[like]
    if len(first) > MAX_PAIRS:
        some = np.random.default_rng(0).choice(len(first), MAX_PAIRS, replace=False)
        first, ratio = first[some], ratio[some]
    best, most = np.full(len(pixel), -1), 0
    for start, factor in zip(first.tolist(), ratio.tolist(), strict=True):
        moved = z[pick[start]] + factor * (q - q[label[start]])
        found = _mutually_nearest(
            np.abs(z[:, None] - moved[None]), np.full(len(z), MAX_DISTANCE * width_px)
        )
        if (found >= 0).sum() > most:
            best, most = found, int((found >= 0).sum())
    return best


def _mutually_nearest(distance: Floats, limit: Floats) -> Ints:
    """Return the nearest (n,) of k where both are each other's nearest within limits (n,)."""
    distance = np.nan_to_num(distance, nan=np.inf)
    column = distance.argmin(axis=1)
    mutual = distance.argmin(axis=0)[column] == np.arange(len(distance))
    near = distance[np.arange(len(distance)), column] < limit
    return np.where(mutual & near, column, -1)


def _alternate(world: Floats, ray: Floats, near: Floats, found: Ints) -> Ints:
    """Alternate labels and pose; all -1 where too few agree.

    Parameters
    ----------
    world
        (k, 3) places of the labels.
    ray, near
        (n, 3), (n,) rays of the picks, and their largest distances from a label.
    found
        (n,) initial labels, -1 where unknown.
    """
    for _ in range(MAX_ROUNDS):
        used = np.flatnonzero(found >= 0)
        if len(used) < MIN_PICKS:
            return np.full(len(ray), -1)
        pose = resect_in_space(world[found[used]], ray[used], near[used] / AGREEMENT_SIGMAS)
        if not np.isfinite(pose[0]).all():
            return np.full(len(ray), -1)
        apart = np.linalg.norm(ray[:, None, :2] - project_points(world, pose)[None], axis=2)
        found = _mutually_nearest(apart, near)
    return found
