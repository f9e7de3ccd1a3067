"""Try corrections of the only photo, or of the one with most picks, each with a pose of its own.

Wrong readings distort the pose of a photo that they place, and so all of its points: its present
state does not show which correction is right. All corrections are adjusted together, as if each
were a photo with points and readings of its own (`estimation/first_poses/photo_problem.py`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from uavgram.estimation.first_poses.first_values import estimate_length_poses
from uavgram.estimation.first_poses.known_frames import align_in_plane
from uavgram.estimation.first_poses.known_points import find_known_point_poses
from uavgram.estimation.first_poses.length_poses import move_seed_to_plane
from uavgram.estimation.first_poses.photo_problem import Photos, SharedErrors
from uavgram.estimation.repeated.single_photo import adjust_photos, intersect_ground
from uavgram.model.arrays import Floats, Ints
from uavgram.model.survey import Survey, SurveyCorrection
from uavgram.stages.refine.causes.hypothesis import Diagnosis, correct_survey, find_usable_picks
from uavgram.stages.refine.first_values import add_control_distances

MOST_PHOTOS = 2
"""Number of photos up to which a wrong one, or wrong lengths without a log, distort the points."""

LEAST_ROUGHNESS_M = 0.02
"""Least sigma of coordinates [m]: control points are not exactly on the plane."""

FREE, UNSEEN = 1e-9, 1e-6
"""Information of a pose without a prior; and 1 / sigma of the pick of a point without one."""

LOOKING_DOWN = np.diag([1.0, -1.0, -1.0])
"""Rotation of a camera that looks straight down with the top of its picture to the north."""


def needs_other_poses(diagnosis: Diagnosis) -> bool:
    """Return whether the present state is of no use: lengths place it, or it is no minimum."""
    usable = find_usable_picks(diagnosis.taking)
    photos = len(np.unique(diagnosis.survey.pick_frame[usable]))
    most = 1 if diagnosis.survey.telemetry is not None else MOST_PHOTOS
    return photos <= most or not diagnosis.adjustment.minimum.converged


def find_picks_of_photo(diagnosis: Diagnosis) -> Ints:
    """Find the usable picks (n,) of the photo, or of the one with most picks."""
    frame = diagnosis.survey.pick_frame
    usable = find_usable_picks(diagnosis.taking)
    return np.flatnonzero(usable & (frame == np.bincount(frame[usable]).argmax()))


def compute_decreases(
    diagnosis: Diagnosis, picks: Ints, corrections: Sequence[SurveyCorrection]
) -> Floats:
    """Compute the decrease (C,) of the sum of squares with each correction, in the best pose.

    Parameters
    ----------
    diagnosis
        The survey under diagnosis.
    picks
        (n,) picks of the photo.
    corrections
        C corrections; -inf where no pose fits.
    """
    survey = diagnosis.survey
    each = [correct_survey(survey, one) for one in corrections]
    starts = _find_first_poses(survey, picks, each)
    case = np.array([one.case for one in starts], dtype=np.int64)
    least = np.full(len(each), np.inf)
    if len(case):
        photos = _collect_photos(survey, picks, each).take(case)
        rotation = np.stack([one.rotation for one in starts])
        center = np.stack([one.center for one in starts])
        if survey.seeds is None:
            center, rotation = _align_with_control(survey, photos, center, rotation)
            photos = photos._replace(center=center, rotation=rotation)
        shared = SharedErrors(survey.calibration, ground_root=_find_ground_root(survey))
        adjusted = adjust_photos(shared, photos, (center, rotation), undamped=0, settled=1e-2)
        cost = np.where(adjusted.converged, adjusted.cost, np.inf)
        np.minimum.at(least, case, np.nan_to_num(cost, nan=np.inf))
    return np.asarray(diagnosis.cost - least)


class _FirstPose(NamedTuple):
    """Pose (3,), (3, 3) from which the photo begins with one of the corrections."""

    case: int
    center: Floats
    rotation: Floats


def _find_first_poses(survey: Survey, picks: Ints, each: Sequence[Survey]) -> list[_FirstPose]:
    """Find first poses by the log; without one by control, or by three lengths or distances."""
    if survey.seeds is not None:
        frame = int(survey.pick_frame[picks[0]])
        center = survey.seeds.center_world_m[frame]
        rotation = survey.seeds.world_from_camera[frame]
        return [_FirstPose(k, center, rotation) for k in range(len(each))]
    stacked = _stack(survey, picks, [add_control_distances(one) for one in each])
    found = [
        _FirstPose(int(one.frame_id), center, rotation)
        for one in find_known_point_poses(stacked)
        for center, rotation in zip(one.center_world_m, one.world_from_camera, strict=True)
    ]
    for k, poses in estimate_length_poses(stacked).items():
        for plane in poses.plane[poses.converged]:
            here = move_seed_to_plane(np.zeros(3), LOOKING_DOWN, survey.ground, plane)
            found.append(_FirstPose(k, *here))
    return found


def _align_with_control(
    survey: Survey, photos: Photos, center: Floats, rotation: Floats
) -> tuple[Floats, Floats]:
    """Shift and turn poses (B, 3), (B, 3, 3) about the vertical onto two control points or more."""
    points = photos.placed[:, : photos.placed.shape[1] // 2]
    if points.shape[1] < 2:
        return center, rotation
    center, rotation = center.copy(), rotation.copy()
    place = intersect_ground(survey.calibration, photos, (center, rotation))
    first = photos.line.shape[1]
    world = photos.reading_m[:, first:].reshape(len(center), 2, -1).swapaxes(1, 2)
    for k in range(len(center)):
        here = place[k, points[k]]
        if np.isfinite(here).all():
            turn, shift = align_in_plane(here, world[k])
            center[k], rotation[k] = turn @ center[k] + shift, turn @ rotation[k]
    return center, rotation


def _collect_photos(survey: Survey, picks: Ints, each: Sequence[Survey]) -> Photos:
    """Collect the observations of the photo with each of C corrections.

    Repeated picks of a point count as their mean; a length, or a control point, between points that
    the photo does not show, or at an unknown height, has no weight.
    """
    frame, cases, labels = int(survey.pick_frame[picks[0]]), len(each), len(survey.label)
    # Mean pixels of all labels, with the information of their picks.
    label = np.stack([one.pick_label[picks] for one in each])
    information = np.tile(survey.pick_sigma_px[picks] ** -2.0, (cases, 1))
    total, pixel = np.zeros((cases, labels)), np.zeros((cases, labels, 2))
    row = np.arange(cases)[:, None]
    np.add.at(total, (row, label), information)
    moved = np.stack([one.pixel_px[picks] for one in each])
    np.add.at(pixel, (row, label), information[..., None] * moved)
    is_seen = total > 0.0
    pixel /= np.where(is_seen, total, 1.0)[..., None]
    pixel[~is_seen] = np.median(survey.pixel_px[picks], axis=0)
    # Heights above the ground; control points give theirs.
    control = survey.control_label
    height = survey.height_above_m.copy()
    level = survey.ground.height_m
    if len(control):
        level = float(np.mean(survey.control_world_m[:, 2]))
        height[control] = survey.control_world_m[:, 2] - level
    is_placed = is_seen & ~np.stack([one.is_free for one in each])
    is_placed[:, control] = is_seen[:, control]
    line = np.stack([np.column_stack([one.line_start, one.line_end]) for one in each])
    has_ends = is_placed[row[..., None], line].all(axis=2)
    spread_m = np.hypot(survey.control_sigma_m[:, :2], LEAST_ROUGHNESS_M).T
    weight = [
        has_ends / survey.length_sigma_m,
        *(is_placed[:, control] / sigma_m for sigma_m in spread_m),
    ]
    prior = FREE * np.eye(6)
    center, rotation = np.zeros(3), LOOKING_DOWN
    if survey.seeds is not None:
        prior = np.linalg.inv(survey.seeds.covariance[frame])
        center = survey.seeds.center_world_m[frame]
        rotation = survey.seeds.world_from_camera[frame]
    axes = np.repeat(np.eye(2), len(control), axis=0)
    world = np.tile(survey.control_world_m[:, :2].T.ravel(), (cases, 1))
    return Photos(
        pixel_px=pixel,
        pixel_weight=np.maximum(np.sqrt(total), UNSEEN),
        height_m=np.tile(height, (cases, 1)),
        ground=np.tile([level, 0.0, 0.0], (cases, 1)),
        center=np.tile(center, (cases, 1)),
        rotation=np.tile(rotation, (cases, 1, 1)),
        information=np.tile(prior, (cases, 1, 1)),
        line=line,
        toward=np.tile(axes, (cases, 1, 1)),
        placed=np.tile(np.tile(control, 2), (cases, 1)),
        reading_m=np.column_stack([np.stack([one.length_m for one in each]), world]),
        reading_weight=np.column_stack(weight),
    )


def _find_ground_root(survey: Survey) -> Floats:
    """Return the root (3, 3) of the covariance of the ground's height and slopes."""
    ground = survey.ground
    slope = ground.slope_sigma_rad
    return np.diag([ground.height_sigma_m, slope, slope])


def _stack(survey: Survey, picks: Ints, each: Sequence[Survey]) -> Survey:
    """Return a photo once for each correction, each with points, lengths and control of its own."""
    cases = len(each)
    label = np.stack([one.pick_label[picks] for one in each])
    start = np.stack([one.line_start for one in each])
    end = np.stack([one.line_end for one in each])
    first = len(survey.label) * np.arange(cases)[:, None]
    return replace(
        survey,
        frame_id=tuple(map(str, range(cases))),
        time_s=np.zeros(0),
        time_sigma_s=np.zeros(0),
        label=tuple(map(str, range(cases * len(survey.label)))),
        pick_frame=np.repeat(np.arange(cases), len(picks)),
        pick_label=(label + first).ravel(),
        pixel_px=np.concatenate([one.pixel_px[picks] for one in each]),
        pick_sigma_px=np.tile(survey.pick_sigma_px[picks], cases),
        target_pick=np.zeros(0, dtype=np.int64),
        identification_sigma_m=np.zeros(0),
        line_name=(),
        line_tape=(),
        line_along=(),
        line_start=(start + first).ravel(),
        line_end=(end + first).ravel(),
        length_m=np.concatenate([one.length_m for one in each]),
        length_sigma_m=np.concatenate([one.length_sigma_m for one in each]),
        control_label=(survey.control_label + first).ravel(),
        control_world_m=np.tile(survey.control_world_m, (cases, 1)),
        control_sigma_m=np.tile(survey.control_sigma_m, (cases, 1)),
        area=np.tile(survey.area, cases),
        height_above_m=np.tile(survey.height_above_m, cases),
        height_sigma_m=np.tile(survey.height_sigma_m, cases),
        is_free=np.concatenate([one.is_free for one in each]),
    )
