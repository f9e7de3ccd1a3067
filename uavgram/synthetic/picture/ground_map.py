"""Scene coordinates of the pixels of a photo, from the true camera and ground."""

from __future__ import annotations

from typing import NamedTuple

import cv2
import numpy as np

from uavgram.geometry.camera.projection import back_project, project
from uavgram.geometry.motion.camera_motion import compute_row_share
from uavgram.imaging.raster import Weights
from uavgram.model.arrays import Floats
from uavgram.synthetic.scene import Surface
from uavgram.synthetic.survey import SimulatedSurvey

# Rays are computed on a coarse grid and interpolated: with f = 2100 px, k1 = -0.1 the map bends by
# 2e-4 px per px^2, so linear interpolation over 8 px is wrong by 2e-3 px.
GRID_PX = 8
PADDING_NODES = 2
RELIEF_ROUNDS = 4
MARGIN_PX = 2
NOWHERE_M = 1e4
"""Coordinate of pixels without a ray in the lens model, and limit of all others [m]."""
READOUT_TIMES = np.array([-0.5, 0.0, 0.5])
"""First, middle and last row, in readout times."""


class PhotoPart(NamedTuple):
    """Columns [left, right) and rows [top, bottom) of a photo."""

    left: int
    top: int
    right: int
    bottom: int

    @property
    def slices(self) -> tuple[slice, slice]:
        """Its rows and columns."""
        return slice(self.top, self.bottom), slice(self.left, self.right)


def get_whole_photo(survey: SimulatedSurvey) -> PhotoPart:
    """Return the part that is the whole photo."""
    return PhotoPart(0, 0, survey.calibration.width_px, survey.calibration.height_px)


def compute_ground_map(
    survey: SimulatedSurvey, index: int, part: PhotoPart, sheet: Surface
) -> tuple[Weights, Weights]:
    """Compute the scene coordinates (x, y) of the pixels of a photo, (H, W) each [m].

    Parameters
    ----------
    survey, index
        The survey, and index of its frame.
    part
        Part of the photo.
    sheet
        Surface that the pixels show.
    """
    # nodes at the centres of blocks: cv2.resize then interpolates without a shift
    first = np.array([part.left, part.top]) // GRID_PX - PADDING_NODES
    last = -(-np.array([part.right, part.bottom]) // GRID_PX) + PADDING_NODES
    u, v = np.meshgrid(
        *((np.arange(a, b) + 0.5) * GRID_PX - 0.5 for a, b in zip(first, last, strict=True))
    )
    scene = survey.scenario.site.in_scene(
        _intersect_sheet(survey, index, np.stack([u, v], axis=-1), sheet)
    )
    whole = (u.shape[1] * GRID_PX, u.shape[0] * GRID_PX)
    scene = np.nan_to_num(np.clip(scene, -NOWHERE_M, NOWHERE_M), nan=NOWHERE_M)
    fine = cv2.resize(scene.astype(np.float32), whole, interpolation=cv2.INTER_LINEAR)
    left, top = (np.array([part.left, part.top]) - first * GRID_PX).tolist()
    cut = fine[top : top + part.bottom - part.top, left : left + part.right - part.left]
    return np.ascontiguousarray(cut[..., 0]), np.ascontiguousarray(cut[..., 1])


def find_part_showing(
    survey: SimulatedSurvey, index: int, corners_m: Floats, sheet: Surface
) -> PhotoPart:
    """Return the part of a photo that may show the area between some corners, or an empty part.

    Parameters
    ----------
    survey, index
        The survey, and index of its frame.
    corners_m
        (K, 2) in the scene.
    sheet
        Surface with the corners.
    """
    truth = survey.truth
    plane = survey.scenario.site.in_world(corners_m)
    up = sheet.up(plane - truth.surface.middle_m)
    center, rotation = _poses(survey, index, READOUT_TIMES)
    away = np.column_stack([plane, up]) - center[:, None]
    camera = survey.calibration
    corner = project(camera.model, truth.intrinsics, away @ rotation).reshape(-1, 2)
    if np.isnan(corner).any():  # behind the camera, or far outside the lens model
        return PhotoPart(0, 0, 0, 0)
    size = [camera.width_px, camera.height_px]
    low = np.maximum(np.floor(corner.min(axis=0)) - MARGIN_PX, 0)
    high = np.minimum(np.ceil(corner.max(axis=0)) + MARGIN_PX + 1, size)
    return PhotoPart(*low.astype(int).tolist(), *high.astype(int).tolist())


def _intersect_sheet(survey: SimulatedSurvey, index: int, pixel: Floats, sheet: Surface) -> Floats:
    """Intersect the rays of pixels (H, W, 2) with a sheet: east and north (H, W, 2)."""
    truth, camera = survey.truth, survey.calibration
    # one pose for each row of nodes
    share = compute_row_share(pixel[:, 0, 1], camera.height_px)
    center, rotation = _poses(survey, index, share)
    center = center[:, None]
    ray = back_project(camera.model, truth.intrinsics, pixel) @ np.swapaxes(rotation, -1, -2)
    falling = ray[..., :2] @ sheet.slope - ray[..., 2]
    from_middle = center[..., :2] - truth.surface.middle_m
    depth = (center[..., 2] - sheet.height_m - from_middle @ sheet.slope) / falling
    # fixed-point iteration for departures from the plane: their slopes of a few per cent are the
    # factor by which the error falls in each round
    for _ in range(0 if sheet.spec.is_plane else RELIEF_ROUNDS):
        up = sheet.up(from_middle + depth[..., None] * ray[..., :2])
        depth = depth + (center[..., 2] + depth * ray[..., 2] - up) / falling
    return np.asarray(center[..., :2] + depth[..., None] * ray[..., :2])


def _poses(survey: SimulatedSurvey, index: int, share: Floats) -> tuple[Floats, Floats]:
    """Return centres (R, 3) and rotations (R, 3, 3) at the times of rows (rolling shutter)."""
    truth = survey.truth
    if truth.rows is not None:
        return truth.rows.at(index, share)
    center = np.broadcast_to(truth.center_world_m[index], (len(share), 3))
    return center, np.broadcast_to(truth.world_from_camera[index], (len(share), 3, 3))
