"""Where ground points appear in photos in which nobody picked them, and how well that is known.

What a pixel depends on is correlated through the adjustment: the point, the pose, the lens, the
plane and what all of the flight has in common. The covariance of a predicted pixel is therefore
J S J^T with S the joint covariance of all unknowns. A photo without any pick is no part of the
adjustment: its pose is what the adjusted flight says of it, with the telemetry's own error of that
frame added.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from uavgram.estimation.survey.adjustment import Adjustment
from uavgram.estimation.survey.likelihood import SurveyProblem
from uavgram.geometry.camera.projection import project, project_with_jacobian
from uavgram.geometry.motion.rotation import hat
from uavgram.geometry.motion.telemetry_pose import corrected_time, exposures_by_time, predict_pose
from uavgram.model.arrays import Floats, Ints
from uavgram.model.camera.calibration import Calibration
from uavgram.model.flight.photo_poses import Flight
from uavgram.model.flight.pose import TelemetryPrior

PAIRS_AT_ONCE = 500
"""Bound of the right-hand sides that are solved for at a time."""


@dataclass(frozen=True, eq=False)
class PredictedPixels:
    """N pairs of photo and label with the pixel (N, 2) and its covariance (N, 2, 2) [px^2].

    `label` counts the adjustment's labels.
    """

    frame_id: tuple[str, ...]
    label: Ints
    pixel_px: Floats
    covariance_px2: Floats


def predict_unpicked(
    adjustment: Adjustment, flight: tuple[TelemetryPrior, Flight, tuple[str, ...]] | None
) -> PredictedPixels:
    """Every label in every photo that should show it and in which it is not picked.

    Parameters
    ----------
    adjustment
        The adjusted survey.
    flight
        Prior, flight and frame names of all photos with telemetry, for those without a pick.
    """
    parts = [_in_adjusted(adjustment)]
    if flight is not None and len(adjustment.state.telemetry):
        parts.append(_in_others(adjustment, *flight))
    return PredictedPixels(
        tuple(name for part in parts for name in part.frame_id),
        np.concatenate([part.label for part in parts]),
        np.concatenate([part.pixel_px for part in parts]),
        np.concatenate([part.covariance_px2 for part in parts]),
    )


def _in_adjusted(adjustment: Adjustment) -> PredictedPixels:
    """Labels in photos that have picks of other labels."""
    survey, state = adjustment.survey, adjustment.state
    free = np.ones((len(survey.frame_id), len(survey.label)), dtype=bool)
    free[survey.pick_frame, survey.pick_label] = False
    frame, label = np.nonzero(free)
    world, _, _ = adjustment.problem.world_points(state, label)
    shown = _shown(adjustment, world, state.center[frame], state.rotation[frame])
    frame, label = frame[shown], label[shown]
    pixel, covariance = pixels_at(adjustment, frame, label)
    return PredictedPixels(tuple(survey.frame_id[f] for f in frame), label, pixel, covariance)


def pixels_at(adjustment: Adjustment, frame: Ints, label: Ints) -> tuple[Floats, Floats]:
    """Pixels (n, 2) of labels in frames of the adjustment, and their covariances (n, 2, 2).

    Those of the adjusted point alone, without the error of a pick.

    Parameters
    ----------
    adjustment
        The adjusted survey.
    frame, label
        (n,) each, by index.
    """
    survey, problem = adjustment.survey, adjustment.problem
    n = len(frame)
    asked = replace(
        survey,
        pick_frame=frame,
        pick_label=label,
        pixel_px=np.zeros((n, 2)),  # a residual from there is the pixel
        pick_sigma_px=np.ones(n),
    )
    used = np.isin(np.arange(len(survey.line_start)), problem.line_index)
    blocks = SurveyProblem(asked, problem.pivot_m, used).evaluate(adjustment.state)
    if blocks is None or not n:
        return np.full((n, 2), np.nan), np.full((n, 2, 2), np.nan)
    block = blocks["pixels"]
    return block.residual, _propagated(adjustment, block.columns, block.jacobian)


def _propagated(adjustment: Adjustment, columns: Ints, jacobian: Floats) -> Floats:
    """(n, 2, 2) covariances of n pairs of values from their Jacobians (n, 2, k)."""
    covariance = np.empty((len(columns), 2, 2))
    size = adjustment.problem.layout.size
    for first in range(0, len(columns), PAIRS_AT_ONCE):
        some = slice(first, first + PAIRS_AT_ONCE)
        at = columns[some, :, None], np.arange(len(columns[some]))[:, None, None], np.arange(2)
        gradient = np.zeros((size, len(columns[some]), 2))
        np.add.at(gradient, at, np.swapaxes(jacobian[some], 1, 2))
        solved = adjustment.minimum.factor.solve(gradient.reshape(size, -1)).reshape(gradient.shape)
        covariance[some] = np.einsum("sni,snj->nij", gradient, solved, optimize=True)
    return covariance


def _in_others(
    adjustment: Adjustment, prior: TelemetryPrior, track: Flight, names: tuple[str, ...]
) -> PredictedPixels:
    """Labels in photos without any pick, whose poses the adjusted flight gives."""
    known = set(adjustment.survey.frame_id)
    rows = np.array([k for k, f in enumerate(prior.frame_index) if names[f] not in known], int)
    chosen = [names[prior.frame_index[k]] for k in rows]
    state, layout, survey = adjustment.state, adjustment.problem.layout, adjustment.survey
    if not chosen:
        return PredictedPixels((), np.empty(0, int), np.empty((0, 2)), np.empty((0, 2, 2)))
    time_s = prior.time_s[rows]
    center, rotation, d_shared = predict_pose(
        exposures_by_time(track, chosen)(corrected_time(state.telemetry, time_s, prior.middle_s)),
        prior.gimbal_from_camera,
        state.telemetry,
        time_s - prior.middle_s,
    )
    frame, label = (
        grid.ravel()
        for grid in np.meshgrid(np.arange(len(rows)), np.arange(layout.points), indexing="ij")
    )
    world, d_point, d_plane = adjustment.problem.world_points(state, label)
    shown = _shown(adjustment, world, center[frame], rotation[frame])
    frame, label, world = frame[shown], label[shown], world[shown]
    camera_from_world = np.swapaxes(rotation, 1, 2)[frame]
    camera = np.einsum("nij,nj->ni", camera_from_world, world - center[frame])
    pixel, d_camera, d_lens = project_with_jacobian(
        survey.calibration.model, adjustment.problem.intrinsics(state), camera
    )
    d_world = d_camera @ camera_from_world
    d_pose = np.concatenate([-d_world, d_camera @ hat(camera)], axis=2)
    jacobian = np.concatenate(
        [
            d_world @ d_point[shown],
            d_pose @ d_shared[frame],
            d_lens @ adjustment.problem.intrinsic_basis,
            d_world @ d_plane[shown],
        ],
        axis=2,
    )
    n = len(frame)
    columns = np.concatenate(
        [
            layout.point_columns(label),
            layout.shared_columns(layout.first_telemetry, layout.telemetry, n),
            layout.shared_columns(layout.first_intrinsic, layout.intrinsics, n),
            adjustment.problem.plane_columns(label),
        ],
        axis=1,
    )
    own = d_pose @ prior.covariance[rows][frame] @ np.swapaxes(d_pose, 1, 2)
    covariance = own + _propagated(adjustment, columns, jacobian)
    return PredictedPixels(tuple(chosen[f] for f in frame), label, pixel, covariance)


def _shown(adjustment: Adjustment, world: Floats, center: Floats, rotation: Floats) -> Ints:
    """Which of N pairs of world point and pose give a pixel inside the image."""
    parameters = adjustment.problem.intrinsics(adjustment.state)
    return shown_in_photo(adjustment.survey.calibration, parameters, world, center, rotation)


def shown_in_photo(
    calibration: Calibration, parameters: Floats, world: Floats, center: Floats, rotation: Floats
) -> Ints:
    """Which of N pairs of world point (N, 3) and pose (N, 3), (N, 3, 3) give a pixel in the image.

    Parameters
    ----------
    calibration
        Lens model and size of the image.
    parameters
        Of the lens model, where they are better known than the calibration's.
    world, center, rotation
        Points and poses (world from camera).
    """
    camera = np.einsum("nji,nj->ni", rotation, world - center)
    pixel = project(calibration.model, parameters, camera)
    size = np.array([calibration.width_px, calibration.height_px])
    with np.errstate(invalid="ignore"):
        inside = (pixel >= -0.5).all(axis=1) & (pixel <= size - 0.5).all(axis=1)
    return np.flatnonzero(inside)
