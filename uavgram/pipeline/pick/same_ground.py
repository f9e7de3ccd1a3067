"""The same piece of ground in several photos, by the best poses that are known."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from uavgram.geometry.camera.back_projection import back_project
from uavgram.geometry.camera.projection import project
from uavgram.geometry.ground.plane import intersect_ground
from uavgram.model.arrays import Floats
from uavgram.pipeline.pick.live import Adjusted, LiveSurvey

STEP_PX = 8.0
"""By which the scale between two photos is found."""


@dataclass(frozen=True, eq=False)
class _Poses:
    """Poses (F, 3), (F, 3, 3) by photo name, and the ground (3,) with its pivot (2,)."""

    row: dict[str, int]
    center_world_m: Floats
    world_from_camera: Floats
    plane: Floats
    pivot_m: Floats


def same_ground(
    survey: LiveSurvey, last: Adjusted | None, image: str, pixel_px: tuple[float, float]
) -> dict[str, tuple[float, float, float]]:
    """Where the ground under a pixel lies in the other photos.

    Parameters
    ----------
    survey, last
        The project, and its last adjustment: its poses, where a photo has one, are better than
        the telemetry's.
    image, pixel_px
        The photo and the pixel.

    Returns
    -------
    dict
        By photo name: u, v [px] (perhaps outside the photo), and how many pixels of that photo
        are one of `image` there. Nothing where no pose is known.
    """
    poses = _poses(survey, last)
    if poses is None or image not in poses.row:
        return {}
    calibration = survey.inputs.calibration
    near = np.array(pixel_px) + STEP_PX * np.array([[0, 0], [1, 0], [0, 1]])
    ray = back_project(calibration.model, calibration.parameters, near)
    at = poses.row[image]
    world = intersect_ground(
        poses.center_world_m[at],
        ray @ poses.world_from_camera[at].T,
        poses.plane,
        poses.pivot_m,
    )
    from_center = world[None] - poses.center_world_m[:, None]
    camera = np.einsum("fji,fnj->fni", poses.world_from_camera, from_center)
    pixel = project(calibration.model, calibration.parameters, camera)
    along = (pixel[:, 1:] - pixel[:, :1]) / STEP_PX
    with np.errstate(invalid="ignore"):  # NaN where a photo does not see the ground
        scale = np.sqrt(np.abs(np.linalg.det(along)))
    return {
        name: (float(pixel[k, 0, 0]), float(pixel[k, 0, 1]), float(scale[k]))
        for name, k in poses.row.items()
        if name != image and np.isfinite(pixel[k]).all() and scale[k] > 0
    }


def _poses(survey: LiveSurvey, last: Adjusted | None) -> _Poses | None:
    telemetry = None if survey.posed is None else survey.posed.telemetry
    ground = survey.inputs.project.ground
    plane, pivot = np.array([ground.height_m, 0.0, 0.0]), np.zeros(2)
    known: dict[str, tuple[Floats, Floats]] = {}
    if telemetry is not None:
        poses = telemetry.poses
        known = {
            name: (poses.center_world_m[k], poses.world_from_camera[k])
            for k, name in enumerate(poses.frame_id)
        }
    if last is not None:
        state = last.adjustment.state
        plane, pivot = state.plane[:3], last.adjustment.problem.pivot_m[0]
        if last.adjustment.survey.gauge == "plane":
            known = {}
        known |= {
            name: (state.center[k], state.rotation[k])
            for k, name in enumerate(last.adjustment.survey.frame_id)
        }
    if not known:
        return None
    return _Poses(
        {name: k for k, name in enumerate(known)},
        np.stack([center for center, _ in known.values()]),
        np.stack([rotation for _, rotation in known.values()]),
        plane,
        pivot,
    )
