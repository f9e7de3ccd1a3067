"""Where points with known coordinates should appear in photos: seen before anybody picks them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from uavgram.estimation.measuring.known_pixels import pixels_of_known_points
from uavgram.model.arrays import Floats
from uavgram.model.result.tables import PoseTable
from uavgram.pipeline.measure.compute import known_in_world
from uavgram.pipeline.pick.live import Adjusted, LiveSurvey
from uavgram.pipeline.threads import with_one_blas_thread


@dataclass(frozen=True, eq=False)
class KnownPlaces:
    """N pairs of photo and label with the pixel (N, 2) and its covariance (N, 2, 2) [px^2]."""

    frame_id: tuple[str, ...]
    label: tuple[str, ...]
    pixel_px: Floats
    covariance_px2: Floats


NOWHERE = KnownPlaces((), (), np.empty((0, 2)), np.empty((0, 2, 2)))


@with_one_blas_thread
def known_places(survey: LiveSurvey, last: Adjusted | None) -> KnownPlaces:
    """Pixels of control and check points in the photos that should show them.

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
    found = pixels_of_known_points(survey.inputs.calibration, poses, world, sigma)
    return KnownPlaces(
        tuple(names[k] for k in found.pose),
        tuple(label[k] for k in found.point),
        found.pixel_px,
        found.covariance_px2,
    )


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
