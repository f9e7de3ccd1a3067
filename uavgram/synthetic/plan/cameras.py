"""Planned photos: their poses, and the ground that they show for certain."""

from __future__ import annotations

from typing import Annotated, NamedTuple

import numpy as np

from uavgram.geometry.camera.projection import back_project, project_with_jacobian
from uavgram.geometry.motion.rotation import (
    ENU_FROM_NED,
    GIMBAL_FROM_CAMERA,
    hat,
    matrix_from_ypr,
)
from uavgram.model.arrays import Bools, Floats
from uavgram.model.camera import Calibration
from uavgram.synthetic.plan.scene import Deviation, PlanScene
from uavgram.synthetic.sight import EDGE_PX, find_large_plates, is_inside

MARGIN_SIGMAS = 1.645
"""One-sided 95 % quantile of the normal distribution [sigma]."""


class PlannedCameras(NamedTuple):
    """F photos in the order of the flight.

    Attributes
    ----------
    center_m
        (F, 3) world.
    heading_deg, pitch_deg
        (F,) of the nose, from north, clockwise; of the optical axis, -90 straight down.
    time_s
        (F,) since the first.
    """

    center_m: Annotated[Floats, "f", 3]
    heading_deg: Annotated[Floats, "f"]
    pitch_deg: Annotated[Floats, "f"]
    time_s: Annotated[Floats, "f"]

    @property
    def world_from_body(self) -> Floats:
        """(F, 3, 3) of the drone, level."""
        level = np.zeros(len(self.heading_deg))
        return ENU_FROM_NED @ matrix_from_ypr(np.deg2rad(self.heading_deg), level, level)

    @property
    def world_from_gimbal(self) -> Floats:
        """(F, 3, 3) x along the optical axis, -z up in the image."""
        yaw, pitch = np.deg2rad(self.heading_deg), np.deg2rad(self.pitch_deg)
        return ENU_FROM_NED @ matrix_from_ypr(yaw, pitch, np.zeros(len(yaw)))

    @property
    def world_from_camera(self) -> Floats:
        """(F, 3, 3) rotations of the camera."""
        return np.asarray(self.world_from_gimbal @ GIMBAL_FROM_CAMERA)


class VisiblePoints(NamedTuple):
    """Points in photos: pixels (F, N, 2), and whether they are visible for certain (F, N)."""

    pixel_px: Floats
    certain: Bools


def find_visible(
    calibration: Calibration, cameras: PlannedCameras, point_m: Floats, deviation: Deviation | None
) -> VisiblePoints:
    """Project points to photos, and mark those that are visible despite the drone's deviation.

    Parameters
    ----------
    calibration
        The lens.
    cameras
        The photos.
    point_m
        (N, 3) world.
    deviation
        Deviation of the drone from the plan; None: not at all.
    """
    rotation = cameras.world_from_camera
    from_center = point_m[None] - cameras.center_m[:, None]
    in_camera = np.einsum("fij,fni->fnj", rotation, from_center)
    pixel, by_point, _ = project_with_jacobian(calibration.model, calibration.parameters, in_camera)
    spread = np.zeros(pixel.shape)
    if deviation is not None:
        spread = compute_spread_px(by_point, in_camera, deviation)
    return VisiblePoints(pixel, is_inside(calibration, pixel, spread))


def remove_small_plates(found: VisiblePoints, first: int) -> VisiblePoints:
    """Return the sightings, without those of plates that are too small in a photo to be found.

    Parameters
    ----------
    found
        Sightings of points, and of the corners of plates behind them.
    first
        Index of the first corner, four for each plate.
    """
    certain = found.certain.copy()
    certain[:, first:] &= find_large_plates(found.pixel_px[:, first:])
    return VisiblePoints(found.pixel_px, certain)


def compute_spread_px(by_point: Floats, in_camera: Floats, deviation: Deviation) -> Floats:
    """Compute the (..., 2) shift of pixels, to `MARGIN_SIGMAS` sigmas, by the drone's deviation.

    Parameters
    ----------
    by_point
        (..., 2, 3) derivatives of the pixels by the points.
    in_camera
        (..., 3) the points, in camera axes.
    deviation
        Of the drone.
    """
    place = deviation.position_m * np.linalg.norm(by_point, axis=-1)
    turn = np.linalg.norm(by_point @ hat(in_camera), axis=-1)
    return np.asarray(MARGIN_SIGMAS * np.hypot(place, np.deg2rad(deviation.attitude_deg) * turn))


VERTICES_PER_SIDE = 4
"""Vertices on each side of a photo, whose edges are curved by the lens."""


def compute_footprints(scene: PlanScene, cameras: PlannedCameras) -> tuple[Floats, Floats]:
    """Compute outlines (F, 16, 3) on the ground: of the photos, and of the certain part.

    Counterclockwise from above, not closed. The certain part is inside the photo's edge by the
    shift of the ground under the drone's deviation.
    """
    camera = scene.calibration
    share = np.arange(VERTICES_PER_SIDE) / VERTICES_PER_SIDE
    zero, one = np.zeros(VERTICES_PER_SIDE), np.ones(VERTICES_PER_SIDE)
    u = np.concatenate([share, one, 1.0 - share, zero])
    v = np.concatenate([zero, share, one, 1.0 - share])
    size = np.array([camera.width_px, camera.height_px]) - 1.0
    rim = np.column_stack([u, v])[::-1]  # v points down: reversed is counterclockwise
    whole = _on_ground(scene, cameras, np.broadcast_to(rim * size, (len(cameras.center_m), 16, 2)))
    inset = _spread(scene, cameras, whole) + EDGE_PX
    inset = np.minimum(inset, 0.45 * size)
    return whole, _on_ground(scene, cameras, rim * size + np.sign(0.5 - rim) * inset)


def _spread(scene: PlanScene, cameras: PlannedCameras, ground_m: Floats) -> Floats:
    """Compute the (F, V, 2) shift of ground points in their photo by the drone's deviation [px]."""
    from_center = ground_m - cameras.center_m[:, None]
    in_camera = np.einsum("fij,fvi->fvj", cameras.world_from_camera, from_center)
    calibration = scene.calibration
    _, by_point, _ = project_with_jacobian(
        calibration.model, calibration.parameters, in_camera, beyond_fold="extend"
    )
    return compute_spread_px(by_point, in_camera, scene.deviation)


def _on_ground(scene: PlanScene, cameras: PlannedCameras, pixel_px: Floats) -> Floats:
    """Project pixels (F, V, 2) of each photo to the ground, (F, V, 3)."""
    camera = scene.calibration
    ray = back_project(camera.model, camera.parameters, pixel_px)
    direction = np.einsum("fij,fvj->fvi", cameras.world_from_camera, ray)
    normal = np.array([*-scene.slope, 1.0])
    foot = scene.on_ground(cameras.center_m[:, :2])
    above = (cameras.center_m - foot) @ normal
    reach = -above[:, None] / (direction @ normal)
    return np.asarray(cameras.center_m[:, None] + reach[..., None] * direction)
