"""First poses of frames from four or more points with known coordinates, by OpenCV's solvers.

Points nearly in a plane: IPPE, which gives both poses that such points allow (Collins and Bartoli
2014, "Infinitesimal plane-based pose estimation"). Others: SQPNP (Terzakis and Lourakis 2020, "A
consistently fast and globally optimal solution to the perspective-n-point problem"). The solvers
weight all points equally and use no sigmas: their poses are start values of the adjustment.
"""

from __future__ import annotations

import cv2
import numpy as np

from uavgram.estimation.first_poses.known_lines import estimate_line_poses
from uavgram.geometry.camera.projection import back_project
from uavgram.model.arrays import Floats
from uavgram.model.frames import CandidatePoses
from uavgram.model.survey import Survey

MIN_POINTS = 4
PLANE_RATIO = 0.1
"""Ratio of the points' smallest to second extent up to which they count as one plane."""
LINE_RATIO = 1e-3
"""Ratio of the points' second to largest extent below which they are on one line."""


def find_candidate_poses(survey: Survey) -> tuple[CandidatePoses, ...]:
    """Find first poses of a survey's frames from control, lines of known position, or ties.

    With a log, or without control, only those from ties.
    """
    by_control: tuple[CandidatePoses, ...] = ()
    if survey.telemetry is None and survey.gauge == "world":
        by_points = find_known_point_poses(survey)
        placed = {one.frame_id for one in by_points}
        by_lines = (one for one in estimate_line_poses(survey) if one.frame_id not in placed)
        by_control = (*by_points, *by_lines)
    # Frames that take no part may still have poses from ties.
    others = set(survey.frame_id) - {one.frame_id for one in by_control}
    return (*by_control, *(one for one in survey.candidate_poses if one.frame_id in others))


def find_known_point_poses(survey: Survey) -> tuple[CandidatePoses, ...]:
    """Compute poses of every frame that shows four or more control points, not all in one line.

    The picks are first undistorted by `back_project`.
    """
    # Row of the control points for each label; -1 for others.
    control = np.full(len(survey.label), -1)
    control[survey.control_label] = np.arange(len(survey.control_label))
    ray = back_project(survey.calibration.model, survey.calibration.parameters, survey.pixel_px)
    known = control[survey.pick_label]
    usable = (known >= 0) & np.isfinite(ray).all(axis=1)
    found = []
    for frame, name in enumerate(survey.frame_id):
        picks = np.flatnonzero(usable & (survey.pick_frame == frame))
        if len(np.unique(known[picks])) < MIN_POINTS:  # clicks of one point count once
            continue
        poses = find_poses_from_points(survey.control_world_m[known[picks]], ray[picks])
        if poses is not None:
            center, rotation, misfit = poses
            found.append(
                CandidatePoses(
                    frame_id=name,
                    center_world_m=center,
                    world_from_camera=rotation,
                    misfit=misfit,
                )
            )
    return tuple(found)


def find_poses_from_points(world_m: Floats, ray: Floats) -> tuple[Floats, Floats, Floats] | None:
    """Compute poses of one camera from points (N, 3) and their undistorted rays (N, 3), N >= 4.

    The rays have z = 1.

    Returns
    -------
    center_world_m : (S, 3)
        Best first; S is 2 for points in a plane (1 where one solution is behind the camera).
    world_from_camera : (S, 3, 3)
    misfit : (S,)
        Root mean square distance of the projected points from the rays, both at z = 1.
    None
        The points are on one line, or no solution has them in front of the camera.
    """
    middle = world_m.mean(axis=0)
    # Principal axes of the points: a local frame with the plane of the points, if any, at z = 0.
    _, extent, axes = np.linalg.svd(world_m - middle, full_matrices=False)
    if extent[1] <= LINE_RATIO * extent[0]:
        return None
    axes[2] = np.cross(axes[0], axes[1])
    local = (world_m - middle) @ axes.T  # the plane of the points, if any, is z = 0
    flag: int = cv2.SOLVEPNP_SQPNP
    if extent[2] <= PLANE_RATIO * extent[1]:
        flag, local = cv2.SOLVEPNP_IPPE, local * [1.0, 1.0, 0.0]
    image = np.ascontiguousarray(ray[:, :2])
    _, turns, shifts, _ = cv2.solvePnPGeneric(local, image, np.eye(3), None, flags=flag)
    poses = []
    for turn, shift in zip(turns, shifts, strict=True):
        camera_from_local = cv2.Rodrigues(turn)[0]
        camera = local @ camera_from_local.T + shift.T
        if not np.isfinite(camera).all() or (camera[:, 2] <= 0).any():
            continue
        misfit = np.sqrt(np.mean(np.sum((camera[:, :2] / camera[:, 2:] - image) ** 2, axis=1)))
        center = middle - axes.T @ (camera_from_local.T @ shift[:, 0])
        poses.append((center, (camera_from_local @ axes).T, misfit))
    if not poses:
        return None
    poses.sort(key=lambda pose: pose[2])
    center, rotation, misfit = (np.array(part) for part in zip(*poses, strict=True))
    return center, rotation, misfit
