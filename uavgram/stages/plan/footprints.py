"""What photos will show of the ground, at best and for certain."""

from __future__ import annotations

import numpy as np

from uavgram.geometry.camera.back_projection import back_project
from uavgram.geometry.camera.projection import project_with_jacobian
from uavgram.model.arrays import Floats
from uavgram.stages.plan.cameras import EDGE_PX, Cameras, spread_px
from uavgram.stages.plan.scene import PlanScene

PER_SIDE = 4
"""Vertices on each side of a photo: lenses bend its edges."""


def footprints(scene: PlanScene, cameras: Cameras) -> tuple[Floats, Floats]:
    """Outlines (F, 16, 3) on the ground: of the photos, and of what they show for certain.

    Counterclockwise from above, not closed. What is certain lies off the photo's edge by as much as
    the drone's departure moves the ground there.
    """
    camera = scene.calibration
    share = np.arange(PER_SIDE) / PER_SIDE
    zero, one = np.zeros(PER_SIDE), np.ones(PER_SIDE)
    u = np.concatenate([share, one, 1.0 - share, zero])
    v = np.concatenate([zero, share, one, 1.0 - share])
    size = np.array([camera.width_px, camera.height_px]) - 1.0
    rim = np.column_stack([u, v])[::-1]  # image v runs down: reversed it is counterclockwise
    whole = _on_ground(scene, cameras, np.broadcast_to(rim * size, (len(cameras.center_m), 16, 2)))
    inset = _spread(scene, cameras, whole) + EDGE_PX
    inset = np.minimum(inset, 0.45 * size)
    return whole, _on_ground(scene, cameras, rim * size + np.sign(0.5 - rim) * inset)


def _spread(scene: PlanScene, cameras: Cameras, ground_m: Floats) -> Floats:
    """(F, V, 2) by how much places of the ground move in their photo as the drone departs [px]."""
    from_center = ground_m - cameras.center_m[:, None]
    in_camera = np.einsum("fij,fvi->fvj", cameras.world_from_camera, from_center)
    calibration = scene.calibration
    _, by_point, _ = project_with_jacobian(
        calibration.model, calibration.parameters, in_camera, beyond_fold="extend"
    )
    return spread_px(by_point, in_camera, scene.deviation)


def _on_ground(scene: PlanScene, cameras: Cameras, pixel_px: Floats) -> Floats:
    """(F, V, 3) where pixels (F, V, 2) of each photo lie on the ground."""
    camera = scene.calibration
    ray = back_project(camera.model, camera.parameters, pixel_px)
    direction = np.einsum("fij,fvj->fvi", cameras.world_from_camera, ray)
    normal = np.array([*-scene.slope, 1.0])
    foot = scene.on_ground(cameras.center_m[:, :2])
    above = (cameras.center_m - foot) @ normal
    reach = -above[:, None] / (direction @ normal)
    return np.asarray(cameras.center_m[:, None] + reach[..., None] * direction)
