"""Poses of frames from tie points, where neither log nor photos give their places."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from uavgram.estimation.first_poses.first_values import (
    MIN_LABELS,
    estimate_ground_height,
    find_seen_labels,
    has_known_height,
)
from uavgram.estimation.first_poses.known_points import find_candidate_poses
from uavgram.estimation.first_poses.tied.bundle import (
    TiedPoses,
    compute_tied_rays,
    level_scene,
    transform,
)
from uavgram.estimation.first_poses.tied.tied_poses import estimate_tied_poses
from uavgram.estimation.survey.selection import remove_ties
from uavgram.geometry.camera.projection import back_project
from uavgram.geometry.ground.plane import intersect_ground
from uavgram.model.arrays import Floats
from uavgram.model.frames import CandidatePoses
from uavgram.model.survey import Survey


def add_tied_frames(survey: Survey) -> tuple[Survey, frozenset[int]]:
    """Add first poses of frames joined by tie points; also return left-out ties by row.

    The poses are over the plane of most tie points. Their scale is that of the known lengths or of
    the control points; with control points, their axes are those of the control points. Frames that
    already have first poses, or telemetry, keep these. Two sorts of ties are left out: those that
    contradict the poses by far, since the iterations would follow them; and those of frames without
    a pose that have too few labels to get one.
    """
    if survey.telemetry is not None or not survey.ties.points + survey.matches.points:
        return survey, frozenset()
    begun, wrong = _add_first_poses(survey)
    known = {one.frame_id for one in find_candidate_poses(begun)}
    labels = np.bincount(find_seen_labels(begun)[0], minlength=len(begun.frame_id))
    few = zip(begun.frame_id, labels < MIN_LABELS, strict=True)
    return remove_ties(begun, {name for name, lost in few if lost} - known), wrong


def _add_first_poses(survey: Survey) -> tuple[Survey, frozenset[int]]:
    """Add first poses of frames that ties alone place; also return wrong ties by row."""
    rays, row = compute_tied_rays(survey)
    found = estimate_tied_poses(rays)
    level = None if found is None else level_scene(found)
    placed = None if level is None else _scale_to_survey(survey, level)
    if placed is None:
        return survey, frozenset()
    known = {one.frame_id for one in find_candidate_poses(survey)}
    more = [
        CandidatePoses(
            frame_id=survey.frame_id[f],
            center_world_m=placed.center[[f]],
            world_from_camera=placed.rotation[[f]],
            misfit=np.zeros(1),
        )
        for f in np.flatnonzero(placed.placed)
        if survey.frame_id[f] not in known
    ]
    wrong = np.zeros(len(survey.ties.frame), dtype=np.bool_)
    tie = row < len(wrong)
    wrong[row[tie]] = (placed.placed[rays.frame] & ~placed.agrees)[tie]
    ties, _ = survey.ties.remove(wrong)
    begun = replace(survey, candidate_poses=(*survey.candidate_poses, *more), ties=ties)
    return begun, frozenset(survey.ties.row[wrong].tolist())


def _scale_to_survey(survey: Survey, level: TiedPoses) -> TiedPoses | None:
    """Transform level poses to the survey's scale and, with control points, to its axes."""
    camera = survey.calibration
    ray = back_project(camera.model, camera.parameters, survey.pixel_px)
    point = _ground_places(survey, ray, level)
    if survey.gauge == "world":
        return _move_to_control(survey, level, point)
    scale = _length_scale(survey, point)
    return None if scale is None else transform(level, np.eye(3), scale, np.zeros(3))


def _ground_places(survey: Survey, ray: Floats, poses: TiedPoses) -> Floats:
    """Average the intersections (K, 2) of picks with the plane by label; NaN without any."""
    frame, label = survey.pick_frame, survey.pick_label
    center = poses.center[frame]
    direction = np.einsum("nij,nj->ni", poses.rotation[frame], ray)
    flat = np.zeros(len(frame))
    ground = intersect_ground(center, direction, np.zeros(3), np.zeros(2), flat)
    ground[~has_known_height(survey)[label] | (survey.height_above_m[label] != 0.0)] = np.nan
    places = np.full((len(survey.label), 2), np.nan)
    for each in np.unique(label):
        own = ground[label == each, :2]
        own = own[np.isfinite(own[:, 0])]
        if len(own):
            places[each] = np.median(own, axis=0)
    return places


def _length_scale(survey: Survey, point: Floats) -> float | None:
    """Compute the scale of the known lengths against these axes: the median of the ratios."""
    a, b = survey.line_start, survey.line_end
    here = np.linalg.norm(point[a] - point[b], axis=1)
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = survey.length_m / here
    # Median of the ratios: robust against wrong lengths.
    ratio = ratio[np.isfinite(ratio) & (ratio > 0)]
    return float(np.median(ratio)) if len(ratio) else None


def _move_to_control(survey: Survey, level: TiedPoses, point: Floats) -> TiedPoses | None:
    """Rotate poses about up, scale and shift them onto control points (two at least)."""
    label = survey.control_label
    seen = np.isfinite(point[label, 0])
    if seen.sum() < 2:
        return None
    here, there = point[label[seen]] @ [1, 1j], survey.control_world_m[seen, :2] @ [1, 1j]
    away = here - here.mean()
    if not np.any(np.abs(away) > 0):
        return None
    # Similarity in the plane by complex regression: there = factor * here + shift.
    factor = np.vdot(away, there - there.mean()) / np.vdot(away, away)
    scale, cosine, sine = abs(factor), factor.real / abs(factor), factor.imag / abs(factor)
    turn = np.array([[cosine, -sine, 0.0], [sine, cosine, 0.0], [0.0, 0.0, 1.0]])
    shift = there.mean() - factor * here.mean()
    up = estimate_ground_height(survey)
    return transform(level, turn, scale, np.array([shift.real, shift.imag, up]))
