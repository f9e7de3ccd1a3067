"""Predicted places in photos: of picks, known points, planned lines, and the same ground."""

from __future__ import annotations

from collections.abc import Collection
from typing import NamedTuple

import numpy as np

from uavgram.errors import UavgramError
from uavgram.estimation.measuring.predicted_pixels import PredictedPixels, predict_known_points
from uavgram.estimation.solver.normal_equations import SingularError
from uavgram.estimation.survey.adjustment import Adjustment
from uavgram.estimation.survey.observed import NO_CONTROL
from uavgram.geometry.geodesy import enu_from_geodetic, geodetic_from_enu
from uavgram.geometry.ground.plane import intersect_ground
from uavgram.geometry.ground.row_projection import RowPoses, project_rows, sight_lines
from uavgram.model.arrays import Floats
from uavgram.model.camera import Calibration
from uavgram.model.frames import Poses
from uavgram.model.observations import KnownWorldPoints, Picks
from uavgram.model.survey import World
from uavgram.pipeline.match.adjustment import MIN_ROUGHNESS_M
from uavgram.pipeline.match.height_evidence import predict_candidates
from uavgram.pipeline.measure.inputs import Inputs
from uavgram.pipeline.measure.pose import transform_known
from uavgram.pipeline.pick.live_survey import LiveAdjustment, LiveSurvey
from uavgram.pipeline.threads import limit_blas_threads
from uavgram.stages.match import Candidates, Pair, compute_stretches
from uavgram.stages.products.map_layers import select_shown_poses
from uavgram.stages.products.planned_layers import find_planned_origin
from uavgram.stages.refine.readjustment import MorePicks, add_picks

STEP_PX = 8.0
"""Pixel step for the scale between two photos."""


def find_same_ground(
    calibration: Calibration,
    poses: RowPoses,
    plane: tuple[Floats, Floats],
    photo: int,
    pixel_px: tuple[float, float],
) -> tuple[Floats, Floats]:
    """Project the ground under a pixel of one photo to all photos.

    Parameters
    ----------
    calibration
        Calibration of the camera.
    poses
        (F,) poses of the photos.
    plane
        Height [m] and slopes (3,) of the ground, and the pivot (2,) of the slopes [m].
    photo
        Row of the photo in `poses`.
    pixel_px
        The pixel in it.

    Returns
    -------
    pixel_px : (F, 2)
        Perhaps outside the photo; NaN where it does not see the ground.
    scale : (F,)
        Number of pixels of each photo for one pixel of the first.
    """
    near = np.array(pixel_px) + STEP_PX * np.array([[0, 0], [1, 0], [0, 1]])
    lens = calibration.parameters
    here = RowPoses(*(part[photo] for part in poses))
    world = intersect_ground(*sight_lines(calibration, lens, here, near), *plane)
    pixel = project_rows(
        calibration, lens, RowPoses(*(part[:, None] for part in poses)), world[None]
    )
    along = (pixel[:, 1:] - pixel[:, :1]) / STEP_PX
    with np.errstate(invalid="ignore"):  # NaN where a photo does not see the ground
        return pixel[:, 0], np.sqrt(np.abs(np.linalg.det(along)))


class ExpectedPlace(NamedTuple):
    """Predicted place of one label: the pixel (2,) and its covariance (2, 2) [px^2]."""

    pixel_px: Floats
    covariance_px2: Floats


NOWHERE = PredictedPixels((), (), np.empty((0, 2)), np.empty((0, 2, 2)))


@limit_blas_threads
def predict_known_places(survey: LiveSurvey, last: LiveAdjustment | None) -> PredictedPixels:
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
        transform_known(survey.inputs, points, posed.world)[0]
        for points in (survey.inputs.control, survey.inputs.check)
    ]
    tables.append(predict_planned_places(survey.inputs, posed.world))
    label = tuple(name for table in tables for name in table.label)
    if not label:
        return NOWHERE
    world = np.concatenate([table.world_m for table in tables])
    sigma = np.concatenate([table.sigma_m for table in tables])
    found = predict_known_points(survey.inputs.calibration, poses, sweep, (world, sigma))
    return PredictedPixels(
        tuple(poses.frame_id[k] for k in found.pose),
        tuple(label[k] for k in found.point),
        found.pixel_px,
        found.covariance_px2,
    )


def predict_place(
    survey: LiveSurvey, last: LiveAdjustment | None, image: str, label: str
) -> ExpectedPlace | None:
    """Predict the place of a label that is not picked in a photo; None where it is unknown.

    Parameters
    ----------
    survey, last
        As for `predict_known_places`.
    image, label
        The photo, and the label.
    """
    known = predict_known_places(survey, last)
    for places in (known,) if last is None else (last.predicted, known):
        for k, key in enumerate(zip(places.frame_id, places.label, strict=True)):
            if key == (image, label):
                return ExpectedPlace(places.pixel_px[k], places.covariance_px2[k])
    return None


def project_ground(
    survey: LiveSurvey, last: LiveAdjustment | None, image: str, pixel_px: tuple[float, float]
) -> dict[str, tuple[float, float, float]]:
    """Project the ground under a pixel to the other photos.

    Parameters
    ----------
    survey, last
        As for `predict_known_places`.
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
    pixel, scale = find_same_ground(survey.inputs.calibration, of_rows, plane, photo, pixel_px)
    return {
        name: (float(u), float(v), float(ratio))
        for name, (u, v), ratio in zip(poses.frame_id, pixel, scale, strict=True)
        if name != image and np.isfinite([u, v]).all() and ratio > 0
    }


def _best_poses(survey: LiveSurvey, last: LiveAdjustment | None) -> tuple[Poses, Floats] | None:
    """Return each photo's adjusted pose, or else the telemetry's, and its sweep (see `RowPoses`).

    Return None without either.
    """
    if last is not None:
        rows, poses = select_shown_poses(last.result)
        return poses, last.result.frames.sweep[rows]
    telemetry = None if survey.posed is None else survey.posed.telemetry
    if telemetry is None:
        return None
    return telemetry.poses, np.zeros((len(telemetry.poses.frame_id), 6))


LAID_SIGMA_M = 0.5
"""Standard deviation of an object laid by paces and sight [m]: half a step."""


def predict_planned_places(inputs: Inputs, world: World) -> KnownWorldPoints:
    """Return ends of the plan's lines and middles of its plates; none without a place on earth.

    They are on the project's ground, regardless of the height in the plan, which was made
    beforehand.

    Parameters
    ----------
    inputs
        The project.
    world
        Location of its local world.
    """
    planned = inputs.planned
    if planned is None or world.origin is None:
        return NO_CONTROL
    lines, plates = planned.lines, planned.plates
    laid = np.concatenate([lines.start_world_m, lines.end_world_m, plates.center_world_m])
    latitude, longitude, _ = geodetic_from_enu(laid, find_planned_origin(planned))
    places = enu_from_geodetic(latitude, longitude, world.origin[2], world.origin)
    ground = inputs.project.ground
    places[:, 2] = ground.height_m
    sigma = [LAID_SIGMA_M, LAID_SIGMA_M, ground.height_sigma_m]
    return KnownWorldPoints(
        label=(*lines.start_label, *lines.end_label, *plates.name),
        world_m=places,
        sigma_m=np.broadcast_to(sigma, places.shape),
    )


@limit_blas_threads
def predict_places(
    live: LiveSurvey, last: LiveAdjustment, picks: Picks, labels: Collection[str] | None = None
) -> Candidates | None:
    """Predict every label in every photo that should show it, from the most similar pick.

    Also from picks that are newer than the last adjustment, in photos that take part in it.

    Parameters
    ----------
    live, last
        The project, and its last adjustment.
    picks
        Present picks. Matches are not used as sources.
    labels
        Requested labels; None: all.

    Returns
    -------
    places
        None where they cannot be predicted yet.
    """
    try:
        adjustment = _update_adjustment(live, last, picks)
    except (SingularError, ValueError, UavgramError):  # wait for the next full adjustment
        return None
    survey = adjustment.survey
    there = {
        (survey.frame_id[frame], survey.label[label])
        for frame, label in zip(survey.pick_frame, survey.pick_label, strict=True)
    }
    rows = [
        i
        for i in np.flatnonzero(~picks.of_source("match")).tolist()
        if (labels is None or picks.label[i] in labels)
        and (picks.image[i], picks.label[i]) in there
    ]
    flight = None if survey.telemetry is None else live.flight()
    none = np.zeros(len(survey.label), np.bool_)
    found = predict_candidates(adjustment, flight, picks, rows, none)
    best: dict[Pair, int] = {}
    for row in np.argsort(compute_stretches(found.places.affine), kind="stable").tolist():
        best.setdefault(found.pair[row], row)
    return found.select(np.array(sorted(best.values()), dtype=np.int64))


def _update_adjustment(survey: LiveSurvey, last: LiveAdjustment, picks: Picks) -> Adjustment:
    """Update the last adjustment with new or moved picks."""
    adjustment, before = last.adjustment, last.observed.picks
    was = {
        key: tuple(place)
        for key, place in zip(
            zip(before.image, before.label, strict=True), before.pixel_px.tolist(), strict=True
        )
    }
    frame = {name: k for k, name in enumerate(adjustment.survey.frame_id)}
    new = [
        i
        for i in np.flatnonzero(~picks.of_source("match")).tolist()
        if picks.image[i] in frame
        and was.get((picks.image[i], picks.label[i])) != tuple(picks.pixel_px[i].tolist())
    ]
    sigma = np.where(np.isnan(picks.sigma_px), survey.inputs.project.picks_sigma_px, picks.sigma_px)
    rows = np.array(new, dtype=np.int64)
    more = MorePicks(
        [picks.label[i] for i in new],
        np.array([frame[picks.image[i]] for i in new], dtype=np.int64),
        picks.pixel_px[rows].reshape(-1, 2),
        sigma[rows],
    )
    return add_picks(adjustment, more, MIN_ROUGHNESS_M)
