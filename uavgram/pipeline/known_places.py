"""Where points with known coordinates should appear in photos: seen before anybody picks them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from uavgram.geometry.projection import project, project_with_jacobian
from uavgram.geometry.rotation import hat
from uavgram.model.arrays import Floats
from uavgram.model.result_tables import PoseTable
from uavgram.pipeline.compute import known_in_world
from uavgram.pipeline.live import Adjusted, LiveSurvey


@dataclass(frozen=True, eq=False)
class KnownPlaces:
    """N pairs of photo and label with the pixel (N, 2) and its covariance (N, 2, 2) [px^2]."""

    frame_id: tuple[str, ...]
    label: tuple[str, ...]
    pixel_px: Floats
    covariance_px2: Floats


NOWHERE = KnownPlaces((), (), np.empty((0, 2)), np.empty((0, 2, 2)))


def known_places(survey: LiveSurvey, last: Adjusted | None) -> KnownPlaces:
    """Pixels of control and check points in the photos that should show them.

    The covariance is that of the pose and of the known point, taken as independent of each other:
    good enough to look there, which is all that it is for.

    Parameters
    ----------
    survey, last
        The project, and its last adjustment: its poses, where a photo has one, are better than
        the telemetry's.
    """
    posed = survey.posed
    if posed is None or posed.telemetry is None:
        return NOWHERE
    tables = [
        known_in_world(survey.inputs, points, posed.world)[0]
        for points in (survey.inputs.control, survey.inputs.check)
    ]
    label = tuple(name for table in tables for name in table.label)
    if not label:
        return NOWHERE
    world = np.concatenate([table.world_m for table in tables])
    sigma = np.concatenate([table.sigma_m for table in tables])
    names, poses = _poses(survey, last)
    return _seen(survey, (label, world, sigma), names, poses)


def _poses(survey: LiveSurvey, last: Adjusted | None) -> tuple[tuple[str, ...], PoseTable]:
    """The best pose of each photo that has one."""
    if last is not None:
        frames = last.result.frames
        refined = np.isfinite(frames.refined.center_world_m).all(axis=1)
        chosen = [
            np.where(refined.reshape(-1, *[1] * (now.ndim - 1)), now, before)
            for now, before in (
                (frames.refined.center_world_m, frames.seed.center_world_m),
                (frames.refined.world_from_camera, frames.seed.world_from_camera),
                (frames.refined.covariance, frames.seed.covariance),
            )
        ]
        known = np.flatnonzero(np.isfinite(chosen[0]).all(axis=1))
        names = tuple(frames.frame_id[k] for k in known)
        center, rotation, covariance = (table[known] for table in chosen)
        return names, _table(center, rotation, covariance)
    telemetry = None if survey.posed is None else survey.posed.telemetry
    if telemetry is None:
        raise TypeError("there is no pose without telemetry")
    poses = telemetry.poses
    return poses.frame_id, _table(poses.center_world_m, poses.world_from_camera, poses.covariance)


def _table(center: Floats, rotation: Floats, covariance: Floats) -> PoseTable:
    return PoseTable(center_world_m=center, world_from_camera=rotation, covariance=covariance)


def _seen(
    survey: LiveSurvey,
    points: tuple[tuple[str, ...], Floats, Floats],
    names: tuple[str, ...],
    poses: PoseTable,
) -> KnownPlaces:
    """Those pairs of photo and point whose pixel lies in the photo."""
    label, world, sigma = points
    calibration = survey.inputs.calibration
    frame, point = (
        grid.ravel()
        for grid in np.meshgrid(np.arange(len(names)), np.arange(len(label)), indexing="ij")
    )
    from_world = np.swapaxes(poses.world_from_camera, 1, 2)[frame]
    camera = np.einsum("nij,nj->ni", from_world, world[point] - poses.center_world_m[frame])
    pixel = project(calibration.model, calibration.parameters, camera)
    size = np.array([calibration.width_px, calibration.height_px])
    with np.errstate(invalid="ignore"):
        inside = (pixel >= -0.5).all(axis=1) & (pixel <= size - 0.5).all(axis=1)
    frame, point = frame[inside], point[inside]
    camera, from_world = camera[inside], from_world[inside]
    pixel, d_camera, _ = project_with_jacobian(calibration.model, calibration.parameters, camera)
    d_world = d_camera @ from_world
    d_pose = np.concatenate([-d_world, d_camera @ hat(camera)], axis=2)
    variance = sigma[point] ** 2
    covariance = d_pose @ poses.covariance[frame] @ np.swapaxes(d_pose, 1, 2)
    covariance = covariance + np.einsum("nij,nj,nkj->nik", d_world, variance, d_world)
    return KnownPlaces(
        tuple(names[k] for k in frame), tuple(label[k] for k in point), pixel, covariance
    )
