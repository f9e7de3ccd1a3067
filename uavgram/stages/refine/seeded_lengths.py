"""What the seeds say of lengths and points before anything is adjusted, and how well they know."""

from __future__ import annotations

import numpy as np

from uavgram.estimation.first_poses.network import seen_lines
from uavgram.geometry.camera.back_projection import back_project
from uavgram.geometry.ground.plane import intersect_ground, intersect_ground_with_jacobian
from uavgram.geometry.motion.rotation import hat
from uavgram.model.arrays import Bools, Floats, Ints
from uavgram.model.survey.survey import Survey

POSE, OWN = 6, 8
"""Of a point's derivatives the first are by its pose, those up to here by its pose and its pixel;
the rest is common to all points."""


def seeded_lengths(survey: Survey, keep: Bools) -> tuple[Floats, Floats]:
    """Known lengths as the seed poses see them, each where they see it best.

    Parameters
    ----------
    survey
        With telemetry.
    keep
        (P,) picks that may be used.

    Returns
    -------
    length_m, relative_sigma : (L,)
        NaN where no two picks tell. The sigmas hold the seeds' marginal covariances (with all that
        the log may have wrong in common), those of the ground, of the focal length, and of the
        picks; from frame to frame the seeds count as independent.
    """
    line, start, end = _pairs(survey, keep)
    pick, row = np.unique(np.concatenate([start, end]), return_inverse=True)
    point, by_unknowns = _on_ground(survey, pick)
    first, second = row[: len(line)], row[len(line) :]
    along = point[second] - point[first]
    length = np.linalg.norm(along, axis=1)
    unit = along / np.where(length > 0, length, 1.0)[:, None]
    by_start = -np.einsum("ni,nik->nk", unit, by_unknowns[first])
    by_end = np.einsum("ni,nik->nk", unit, by_unknowns[second])
    together = by_start + by_end
    variance = np.sum(by_start[:, POSE:OWN] ** 2 + by_end[:, POSE:OWN] ** 2, axis=1)
    variance += np.sum(together[:, OWN:] ** 2, axis=1)
    # One frame's pose moves both ends at once.
    frame, other = survey.pick_frame[start], survey.pick_frame[end]
    apart = _by_pose(survey, frame, by_start) + _by_pose(survey, other, by_end)
    variance += np.where(frame == other, _by_pose(survey, frame, together), apart)
    relative = np.sqrt(variance) / np.where(length > 0, length, np.nan)
    return _best(len(survey.line_start), line, length, relative)


def _by_pose(survey: Survey, frame: Ints, gradient: Floats) -> Floats:
    """(n,) variance that the seeds of some frames bring."""
    assert survey.seeds is not None  # noqa: S101  (the caller asked)
    by_pose = gradient[:, :POSE]
    covariance = survey.seeds.covariance[frame]
    return np.asarray(np.einsum("ni,nij,nj->n", by_pose, covariance, by_pose))


def _pairs(survey: Survey, keep: Bools) -> tuple[Ints, Ints, Ints]:
    """Lines (n,), and picks of their ends: in one frame where there is one, else the first ones."""
    seen = seen_lines(survey)
    usable = keep[seen.start] & keep[seen.end]
    line, start, end = seen.line[usable], seen.start[usable], seen.end[usable]
    first = _first_picks(survey, keep)
    rest = np.setdiff1d(np.arange(len(survey.line_start)), line)
    begin, finish = first[survey.line_start[rest]], first[survey.line_end[rest]]
    there = (begin >= 0) & (finish >= 0)
    return (
        np.concatenate([line, rest[there]]),
        np.concatenate([start, begin[there]]),
        np.concatenate([end, finish[there]]),
    )


def _first_picks(survey: Survey, keep: Bools) -> Ints:
    """(K,) the first usable pick of each label; -1 where none is, or where its height is free."""
    first = np.full(len(survey.label), -1)
    picks = np.flatnonzero(keep & ~survey.is_free[survey.pick_label])[::-1]
    first[survey.pick_label[picks]] = picks
    return first


def seeded_points(survey: Survey, keep: Bools, label: Ints) -> tuple[Floats, Floats]:
    """Points (n, 3) of labels as the first seed that shows them has them, and covariances.

    NaN where none does; parameters as for `seeded_lengths`.

    Parameters
    ----------
    survey
        With telemetry.
    keep
        (P,) picks that may be used.
    label
        (n,) rows of labels.
    """
    pick = _first_picks(survey, keep)[label]
    point, covariance = np.full((len(label), 3), np.nan), np.full((len(label), 3, 3), np.nan)
    there = pick >= 0
    found, by_unknowns = _on_ground(survey, pick[there])
    assert survey.seeds is not None  # noqa: S101  (the caller asked)
    own = survey.seeds.covariance[survey.pick_frame[pick[there]]]
    by_pose, rest = by_unknowns[:, :, :POSE], by_unknowns[:, :, POSE:]
    point[there] = found
    covariance[there] = by_pose @ own @ by_pose.swapaxes(1, 2) + rest @ rest.swapaxes(1, 2)
    return point, covariance


def _on_ground(survey: Survey, pick: Ints) -> tuple[Floats, Floats]:
    """Points (n, 3) of picks, and their derivatives (n, 3, 12).

    By the pose (6: δcentre world [m], δθ camera [rad]); then, in units of their sigmas, by the
    pixel (2), the plane's height and slopes (3) and the focal length (1).
    """
    seeds, calibration, ground = survey.seeds, survey.calibration, survey.ground
    assert seeds is not None  # noqa: S101  (the caller asked)
    frame, label = survey.pick_frame[pick], survey.pick_label[pick]
    center, rotation = seeds.center_world_m[frame], seeds.world_from_camera[frame]
    ray = back_project(calibration.model, calibration.parameters, survey.pixel_px[pick])
    direction = np.einsum("nij,nj->ni", rotation, ray)
    priors = [(each.height_m, each.height_sigma_m, each.slope_sigma_rad) for each in survey.grounds]
    height, rise, tilt = np.array(priors)[survey.area[label]].T
    above = survey.height_above_m[label] + height - ground.height_m
    plane = np.array([ground.height_m, 0.0, 0.0])
    level = intersect_ground(center, direction, plane, np.zeros(2), above)
    met = np.isfinite(level[:, 0])
    pivot = level[met, :2].mean(axis=0) if met.any() else np.zeros(2)
    point, by_center, by_direction, by_plane = intersect_ground_with_jacobian(
        center, direction, plane, pivot, above
    )
    by_ray = by_direction @ rotation
    by_pose = np.concatenate([by_center, -by_ray @ hat(ray)], axis=2)
    focal = calibration.parameters[:2]
    by_pixel = by_ray[:, :, :2] * (survey.pick_sigma_px[pick][:, None, None] / focal)
    by_ground = by_plane * np.column_stack([rise, tilt, tilt])[:, None, :]
    zoom = np.sqrt(np.diag(calibration.covariance)[:2]) / focal
    by_focal = -by_ray[:, :, :2] @ (ray[:, :2] * zoom)[..., None]
    return point, np.concatenate([by_pose, by_pixel, by_ground, by_focal], axis=2)


def _best(lines: int, line: Ints, length: Floats, relative: Floats) -> tuple[Floats, Floats]:
    """(lines,) the length with the smallest sigma of each line; NaN where there is none."""
    order = np.lexsort((relative, line))
    order = order[np.isfinite(relative[order])]
    found, first = np.unique(line[order], return_index=True)
    best = np.full((2, lines), np.nan)
    best[:, found] = length[order[first]], relative[order[first]]
    return best[0], best[1]
