"""Where each method of finding a pose begins, in many scenes at once."""

from __future__ import annotations

import numpy as np

from uavgram.estimation.first_poses.known_lines import direct_poses, poses_from_lines
from uavgram.estimation.first_poses.length_poses import LengthFrames, search_frames
from uavgram.estimation.first_poses.pose_problem import LineRows
from uavgram.geometry.camera.back_projection import back_project_with_jacobian
from uavgram.geometry.ground.plane_pose import pose_above_plane
from uavgram.imaging.known_point_pose import FEWEST_POINTS, poses_from_points
from uavgram.model.arrays import Floats
from uavgram.pipeline.study.method_scenes import MethodScenes

Starts = tuple[Floats, Floats]
"""Centres (B, S, 3) and rotations (B, S, 3, 3) of S starts of each scene; NaN: no more."""


def on_lines(scenes: MethodScenes) -> LineRows:
    """The picks of the scenes' lines, for a first pose."""
    rows = scenes.rows
    count = len(rows.pixel_px)
    ray, by_pixel, _ = back_project_with_jacobian(
        rows.calibration.model, rows.calibration.parameters, rows.pixel_px.reshape(count, -1, 2)
    )
    along = rows.place_m[:, :, 1] - rows.place_m[:, :, 0]
    along = along / np.linalg.norm(along, axis=-1, keepdims=True)
    return LineRows(
        ray=ray,
        ray_root=by_pixel[..., :2, :] * rows.pick_sigma_px,
        start_m=rows.place_m.reshape(count, -1, 2),
        along=np.repeat(along, 2, axis=1),
        sigma_m=np.full(ray.shape[:2], rows.place_sigma_m),
    )


def line_starts(scenes: MethodScenes) -> Starts:
    """The best poses that the search of lines finds."""
    ends = poses_from_lines(on_lines(scenes))
    some = np.isfinite(ends.cost)[..., None]
    return np.where(some, ends.state[0], np.nan), np.where(some[..., None], ends.state[1], np.nan)


def point_starts(scenes: MethodScenes) -> Starts:
    """Both poses of OpenCV's IPPE; it takes four points."""
    rows = scenes.rows
    count = len(rows.pixel_px)
    center, rotation = np.full((count, 2, 3), np.nan), np.full((count, 2, 3, 3), np.nan)
    start = rows.pixel_px[:, :, 0]
    ray, _, _ = back_project_with_jacobian(
        rows.calibration.model, rows.calibration.parameters, start
    )
    place = rows.place_m[:, :, 0]
    world = np.concatenate([place, np.zeros((*place.shape[:2], 1))], axis=-1)
    for k in range(count if start.shape[1] >= FEWEST_POINTS else 0):
        found = poses_from_points(world[k], ray[k])
        if found is not None:
            some = min(2, len(found[0]))
            center[k, :some], rotation[k, :some] = found[0][:some], found[1][:some]
    return center, rotation


def length_starts(scenes: MethodScenes, most: int = 4) -> Starts:
    """Poses over the planes that explain the lengths, standing over the origin."""
    rows = scenes.rows
    count, lines = rows.pixel_px.shape[:2]
    end = np.broadcast_to(np.arange(2 * lines), (count, 2 * lines))
    frames = LengthFrames(
        pixel_px=rows.pixel_px.reshape(count, -1, 2),
        pixel_sigma_px=np.full((count, 2 * lines), rows.pick_sigma_px),
        start=end[:, ::2],
        end=end[:, 1::2],
        length_m=rows.length_m,
        length_sigma_m=np.full(rows.length_m.shape, rows.length_sigma_m),
    )
    center, rotation = np.full((count, most, 3), np.nan), np.full((count, most, 3, 3), np.nan)
    for k, candidates in enumerate(search_frames(rows.calibration, frames)):
        for j, candidate in enumerate(candidates[:most]):
            center[k, j], rotation[k, j] = pose_above_plane(candidate.plane)
    return center, rotation


def log_starts(scenes: MethodScenes) -> Starts:
    """Where the log has the photos."""
    return scenes.logged.center[:, None], scenes.logged.rotation[:, None]


def direct_starts(scenes: MethodScenes) -> Starts:
    """The direct linear transformation of lines."""
    center, rotation = direct_poses(on_lines(scenes))
    return center[:, None], rotation[:, None]
