"""Predicted places in photos by the best known poses, before they are picked."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from uavgram.estimation.measuring.predicted_pixels import predict_known_points
from uavgram.geometry.ground.row_projection import RowPoses
from uavgram.model.arrays import Floats
from uavgram.model.flight.pose import Poses
from uavgram.pipeline.measure.pose import known_in_world
from uavgram.pipeline.pick.live import Adjusted, LiveSurvey
from uavgram.pipeline.pick.places import planned_places
from uavgram.pipeline.threads import with_one_blas_thread
from uavgram.stages.products.map_layers import shown_poses
from uavgram.stages.same_ground import find_same_ground as ground_in_photos


@dataclass(frozen=True, eq=False)
class KnownPlaces:
    """N pairs of photo and label with the pixel (N, 2) and its covariance (N, 2, 2) [px^2]."""

    frame_id: tuple[str, ...]
    label: tuple[str, ...]
    pixel_px: Floats
    covariance_px2: Floats


class ExpectedPlace(NamedTuple):
    """Predicted place of one label: the pixel (2,) and its covariance (2, 2) [px^2]."""

    pixel_px: Floats
    covariance_px2: Floats


NOWHERE = KnownPlaces((), (), np.empty((0, 2)), np.empty((0, 2, 2)))


@with_one_blas_thread
def known_places(survey: LiveSurvey, last: Adjusted | None) -> KnownPlaces:
    """Predict pixels of control, check and planned points in the photos that show them.

    Parameters
    ----------
    survey, last
        The project, and its last adjustment, whose poses are better than the telemetry's.
    """
    posed, best = survey.posed, _best_poses(survey, last)
    if posed is None or posed.telemetry is None or best is None:
        return NOWHERE
    poses, sweep = best
    tables = [
        known_in_world(survey.inputs, points, posed.world)[0]
        for points in (survey.inputs.control, survey.inputs.check)
    ]
    tables.append(planned_places(survey.inputs, posed.world))
    label = tuple(name for table in tables for name in table.label)
    if not label:
        return NOWHERE
    world = np.concatenate([table.world_m for table in tables])
    sigma = np.concatenate([table.sigma_m for table in tables])
    found = predict_known_points(survey.inputs.calibration, poses, sweep, (world, sigma))
    return KnownPlaces(
        tuple(poses.frame_id[k] for k in found.pose),
        tuple(label[k] for k in found.point),
        found.pixel_px,
        found.covariance_px2,
    )


def expected_place(
    survey: LiveSurvey, last: Adjusted | None, image: str, label: str
) -> ExpectedPlace | None:
    """Predict the place of a label that is not picked in a photo; None where it is unknown.

    Parameters
    ----------
    survey, last
        As for `known_places`.
    image, label
        The photo, and the label.
    """
    if last is not None:
        found, names = last.predicted, last.adjustment.survey.label
        for k, (frame, row) in enumerate(zip(found.frame_id, found.label.tolist(), strict=True)):
            if (frame, names[row]) == (image, label):
                return ExpectedPlace(found.pixel_px[k], found.covariance_px2[k])
    known = known_places(survey, last)
    for k, key in enumerate(zip(known.frame_id, known.label, strict=True)):
        if key == (image, label):
            return ExpectedPlace(known.pixel_px[k], known.covariance_px2[k])
    return None


def same_ground(
    survey: LiveSurvey, last: Adjusted | None, image: str, pixel_px: tuple[float, float]
) -> dict[str, tuple[float, float, float]]:
    """Project the ground under a pixel to the other photos.

    Parameters
    ----------
    survey, last
        As for `known_places`.
    image, pixel_px
        The photo and the pixel.

    Returns
    -------
    dict
        By photo name: u, v [px] (perhaps outside the photo), and the number of its pixels for one
        pixel of `image` there. Empty where no pose is known.
    """
    best = _best_poses(survey, last)
    if best is None or image not in best[0].frame_id:
        return {}
    poses, sweep = best
    if last is None:
        plane = np.array([survey.inputs.project.ground.height_m, 0.0, 0.0]), np.zeros(2)
    else:
        plane = last.adjustment.state.plane[:3], last.adjustment.problem.pivot_m[0]
    photo = poses.frame_id.index(image)
    of_rows = RowPoses(poses.center_world_m, poses.world_from_camera, sweep)
    pixel, scale = ground_in_photos(survey.inputs.calibration, of_rows, plane, photo, pixel_px)
    return {
        name: (float(u), float(v), float(ratio))
        for name, (u, v), ratio in zip(poses.frame_id, pixel, scale, strict=True)
        if name != image and np.isfinite([u, v]).all() and ratio > 0
    }


def _best_poses(survey: LiveSurvey, last: Adjusted | None) -> tuple[Poses, Floats] | None:
    """Return each photo's adjusted pose, or else the telemetry's, and its sweep (see `RowPoses`).

    Return None without either.
    """
    if last is not None:
        rows, poses = shown_poses(last.result)
        return poses, last.result.frames.sweep[rows]
    telemetry = None if survey.posed is None else survey.posed.telemetry
    if telemetry is None:
        return None
    return telemetry.poses, np.zeros((len(telemetry.poses.frame_id), 6))
