"""Prediction of points in photos, and transfer of picked pixels to other photos, with covariances.

The quantities that a pixel depends on are correlated through the adjustment: the point, the pose,
the lens, the plane and the shared unknowns of the flight. The covariance of a predicted pixel is
therefore J S J^T with S the joint covariance of all unknowns. A photo without any pick is no part
of the adjustment: its pose is predicted from the adjusted flight, with the telemetry's own error of
that frame added.

A picked pixel is transferred to another photo by A = J_target J_source^-1, with J the derivatives
of the pixels of one point by its place on the ground (or at its height). A person may have picked
a place slightly beside the intended point. The transferred pixel shows the same place in the other
photo. Its error is that of J_target - A J_source by all unknowns: the error of the point's position
cancels, and errors that both poses share nearly cancel. The error of its height remains.
"""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from typing import Annotated, NamedTuple

import numpy as np

from uavgram.estimation.survey.adjustment import Adjustment
from uavgram.estimation.survey.observations.sightings import (
    Sightings,
    collect_sightings,
    compute_sighting_rows,
)
from uavgram.geometry.camera.projection import project_with_jacobian
from uavgram.geometry.ground.row_projection import RowPoses, project_rows
from uavgram.geometry.motion.camera_motion import (
    camera_motion,
    compute_row_share,
    correct_time,
    exposures_by_time,
    predict_pose,
)
from uavgram.geometry.motion.rotation import exp_so3, hat
from uavgram.model.arrays import Floats, Ints, rows_of
from uavgram.model.camera import Calibration
from uavgram.model.flight_log import Track
from uavgram.model.frames import Flight, Poses, TelemetryPrior

PAIRS_AT_ONCE = 500
"""Largest number of pairs whose right-hand sides are solved for at a time."""


@dataclass(frozen=True, eq=False)
class PredictedPixels:
    """N pairs of photo and label with the pixel (N, 2) and its covariance (N, 2, 2) [px^2]."""

    frame_id: tuple[str, ...]
    label: tuple[str, ...]
    pixel_px: Floats
    covariance_px2: Floats


@dataclass(frozen=True, eq=False)
class PixelRows:
    """Pixels of n pairs of photo and label, with derivatives by the adjustment's unknowns.

    Attributes
    ----------
    frame_id, label
        (n,) of each pair; labels by their index in the adjustment.
    pixel_px
        (n, 2) pixels.
    jacobian, columns
        (n, 2, k), (n, k): derivatives, and the columns of the unknowns; those of the point come
        first.
    own
        (n, 2, 6) root of the covariance of errors that are no unknowns: the telemetry's own error
        of a photo that is no part of the adjustment.
    """

    frame_id: tuple[str, ...]
    label: Ints
    pixel_px: Floats
    jacobian: Floats
    columns: Ints
    own: Floats

    def covariance(self, adjustment: Adjustment) -> Floats:
        """Compute the (n, 2, 2) covariances of the pixels."""
        own = self.own @ np.swapaxes(self.own, 1, 2)
        return np.asarray(own + propagate_pairs(adjustment, self.columns, self.jacobian))


FlightOfPhotos = tuple[TelemetryPrior, Flight, tuple[str, ...]]
"""Prior, flight and frame names of all photos with telemetry."""


def predict_unpicked(adjustment: Adjustment, flight: FlightOfPhotos | None) -> PredictedPixels:
    """Predict every label in every photo that should show it and in which it is not picked.

    Parameters
    ----------
    adjustment
        Adjusted survey.
    flight
        Prior, flight and frame names of all photos with telemetry, for those without a pick.
    """
    parts, names = compute_unpicked_rows(adjustment, flight), adjustment.survey.label
    return PredictedPixels(
        tuple(name for part in parts for name in part.frame_id),
        tuple(names[k] for part in parts for k in part.label),
        np.concatenate([part.pixel_px for part in parts]),
        np.concatenate([part.covariance(adjustment) for part in parts]),
    )


def compute_unpicked_rows(adjustment: Adjustment, flight: FlightOfPhotos | None) -> list[PixelRows]:
    """Return the rows of `predict_unpicked`: in adjusted photos, and in others if there are any."""
    rows = [_predict_in_adjusted(adjustment)]
    if flight is not None and len(adjustment.state.telemetry):
        rows.append(_predict_in_others(adjustment, *flight))
    return rows


def _predict_in_adjusted(adjustment: Adjustment) -> PixelRows:
    """Predict labels in photos that have picks of other labels."""
    survey, state = adjustment.survey, adjustment.state
    free = np.ones((len(survey.frame_id), len(survey.label)), dtype=bool)
    free[survey.pick_frame, survey.pick_label] = False
    frame, label = np.nonzero(free)
    world, _, _ = adjustment.problem.world_points(state, label)
    poses = RowPoses(state.center[frame], state.rotation[frame], adjustment.sweep()[frame])
    parameters = adjustment.problem.intrinsics(state)
    place = project_rows(survey.calibration, parameters, poses, world)
    shown = survey.calibration.is_in_photo(place)
    return predict_rows(adjustment, frame[shown], label[shown])


def predict_pixels(adjustment: Adjustment, frame: Ints, label: Ints) -> tuple[Floats, Floats]:
    """Predict pixels (n, 2) of labels in frames of the adjustment, with covariances (n, 2, 2).

    They are those of the adjusted point alone, without the error of a pick.

    Parameters
    ----------
    adjustment
        Adjusted survey.
    frame, label
        (n,) each, by index.
    """
    rows = predict_rows(adjustment, frame, label)
    return rows.pixel_px, rows.covariance(adjustment)


def predict_rows(adjustment: Adjustment, frame: Ints, label: Ints) -> PixelRows:
    """Predict labels in frames of the adjustment; NaN behind the camera.

    Parameters
    ----------
    adjustment
        Adjusted survey.
    frame, label
        (n,) each, by index.
    """
    problem, state, n = adjustment.problem, adjustment.state, len(frame)
    place = adjustment.pixels(frame, label)
    shown = np.isfinite(place).all(axis=1)
    points = problem.layout.point_columns(label), problem.plane_columns(label)
    asked = collect_sightings(problem, points, frame, place, np.ones(n))
    pixel, jacobian = np.full((n, 2), np.nan), np.full((n, 2, asked.columns.shape[1]), np.nan)
    placed = problem.world_points(state, label[shown])
    # Observed at the predicted place (the image row where they appear), their residual is 0,
    # whatever the motion of the camera.
    where = Sightings(frame[shown], place[shown], np.ones(int(shown.sum())), asked.columns[shown])
    block = compute_sighting_rows(problem, state, where, placed)
    if block is not None:
        pixel[shown], jacobian[shown] = place[shown] + block.residual, block.jacobian
    names = tuple(adjustment.survey.frame_id[f] for f in frame)
    return PixelRows(names, label, pixel, jacobian, asked.columns, np.zeros((n, 2, 6)))


def propagate_pairs(adjustment: Adjustment, columns: Ints, jacobian: Floats) -> Floats:
    """Compute (n, 2, 2) covariances of n pairs of values.

    Parameters
    ----------
    adjustment
        Adjusted survey.
    columns, jacobian
        (n, k), (n, 2, k): columns of the unknowns, and derivatives of each pair by them.
    """
    covariance = np.empty((len(columns), 2, 2))
    size = adjustment.problem.layout.size
    for first in range(0, len(columns), PAIRS_AT_ONCE):
        some = slice(first, first + PAIRS_AT_ONCE)
        at = columns[some, :, None], np.arange(len(columns[some]))[:, None, None], np.arange(2)
        gradient = np.zeros((size, len(columns[some]), 2))
        np.add.at(gradient, at, np.swapaxes(jacobian[some], 1, 2))
        # J S J^T by solutions of the normal equations for the columns of J^T.
        solved = adjustment.minimum.factor.solve(gradient.reshape(size, -1)).reshape(gradient.shape)
        covariance[some] = np.einsum("sni,snj->nij", gradient, solved, optimize=True)
    return covariance


def _predict_in_others(
    adjustment: Adjustment, prior: TelemetryPrior, track: Flight, names: tuple[str, ...]
) -> PixelRows:
    """Predict labels in photos without any pick, whose poses the adjusted flight gives."""
    known = set(adjustment.survey.frame_id)
    rows = np.array([k for k, f in enumerate(prior.frame_index) if names[f] not in known], int)
    chosen = [names[prior.frame_index[k]] for k in rows]
    state, layout, survey = adjustment.state, adjustment.problem.layout, adjustment.survey
    if not chosen:
        nothing = np.empty(0, np.int64)
        return predict_rows(adjustment, nothing, nothing)
    time_s = prior.time_s[rows]
    center, rotation, d_shared = predict_pose(
        exposures_by_time(track, chosen)(correct_time(state.telemetry, time_s, prior.middle_s)),
        prior.gimbal_from_camera,
        state.telemetry,
        time_s - prior.middle_s,
    )
    frame, label = (
        grid.ravel()
        for grid in np.meshgrid(np.arange(len(rows)), np.arange(layout.points), indexing="ij")
    )
    world, d_point, d_plane = adjustment.problem.world_points(state, label)
    motion = np.zeros((len(rows), 6))
    if survey.rolling is not None and isinstance(track, Track):
        these = replace(prior, **rows_of(prior, rows))
        motion = camera_motion(track, these, chosen, state.telemetry)
    sweep = motion * state.readout if layout.readout else motion
    poses = RowPoses(center[frame], rotation[frame], sweep[frame])
    parameters = adjustment.problem.intrinsics(state)
    place = project_rows(survey.calibration, parameters, poses, world)
    shown = survey.calibration.is_in_photo(place)
    frame, label, world = frame[shown], label[shown], world[shown]
    poses = RowPoses(*(part[shown] for part in poses))
    share = compute_row_share(place[shown, 1], survey.calibration.height_px)
    of_row, turn = poses.at(share)
    camera_from_world = np.swapaxes(poses.rotation @ exp_so3(turn), 1, 2)
    camera = np.einsum("nij,nj->ni", camera_from_world, world - of_row)
    pixel, d_camera, d_lens = project_with_jacobian(survey.calibration.model, parameters, camera)
    # Pixel by point, by pose (centre, turn) and by readout time, all through the camera axes.
    d_world = d_camera @ camera_from_world
    d_pose = np.concatenate([-d_world, d_camera @ hat(camera)], axis=2)
    by_readout = d_pose @ (share[:, None] * motion[frame])[..., None]
    jacobian = np.concatenate(
        [
            d_world @ d_point[shown],
            d_pose @ d_shared[frame],
            d_lens @ adjustment.problem.intrinsic_root(state),
            d_world @ d_plane[shown],
            by_readout[..., : layout.readout],
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
            layout.shared_columns(layout.first_readout, layout.readout, n),
        ],
        axis=1,
    )
    # The telemetry's own error of each frame, by the pose.
    own = d_pose @ np.linalg.cholesky(prior.covariance[rows])[frame]
    return PixelRows(tuple(chosen[f] for f in frame), label, pixel, jacobian, columns, own)


class KnownPixels(NamedTuple):
    """N pairs of pose (N,) and point (N,), with the pixel (N, 2) and its covariance (N, 2, 2).

    Pixels in px, covariances in px^2; poses and points by their rows.
    """

    pose: Ints
    point: Ints
    pixel_px: Floats
    covariance_px2: Floats


def predict_known_points(
    calibration: Calibration, poses: Poses, sweep: Floats, known: tuple[Floats, Floats]
) -> KnownPixels:
    """Predict every known point in every photo that should show it.

    The covariance is that of the pose and of the known point, assumed independent of each other,
    with an exact lens: good enough for its only use, to search for the point there.

    Parameters
    ----------
    calibration
        Calibration of the photos.
    poses
        (F,) poses.
    sweep
        (F, 6) motion of each camera during the readout; see `RowPoses`.
    known
        (K, 3) points in the world, and their standard deviations [m].
    """
    world_m, sigma_m = known
    pose, point = (
        grid.ravel()
        for grid in np.meshgrid(
            np.arange(len(poses.center_world_m)), np.arange(len(world_m)), indexing="ij"
        )
    )
    center, rotation = poses.center_world_m, poses.world_from_camera
    of_rows = RowPoses(center[pose], rotation[pose], sweep[pose])
    place = project_rows(calibration, calibration.parameters, of_rows, world_m[point])
    shown = np.flatnonzero(calibration.is_in_photo(place))
    pose, point = pose[shown], point[shown]
    of_row, turn = of_rows.at(compute_row_share(place[:, 1], calibration.height_px))
    from_world = np.swapaxes(rotation[pose] @ exp_so3(turn[shown]), 1, 2)
    camera = np.einsum("nij,nj->ni", from_world, world_m[point] - of_row[shown])
    pixel, d_camera, _ = project_with_jacobian(calibration.model, calibration.parameters, camera)
    # Propagate pose and point: J_pose C J_pose^T + J_point C J_point^T.
    d_world = d_camera @ from_world
    d_pose = np.concatenate([-d_world, d_camera @ hat(camera)], axis=2)
    by_pose = d_pose @ poses.covariance[pose] @ np.swapaxes(d_pose, 1, 2)
    by_point = np.einsum("nij,nj,nkj->nik", d_world, sigma_m[point] ** 2, d_world)
    return KnownPixels(pose, point, pixel, by_pose + by_point)


EAST_NORTH = slice(0, 2)
"""East and north among the unknowns of a point."""

MIN_DETERMINANT = 1e-9
"""Determinant [px^2/m^2] below which a photo sees the ground edge-on."""


@dataclass(frozen=True, eq=False)
class PickedPixels:
    """Picks of m pixels (m, 2), each in a frame (m,) and of a label (m,) of the adjustment."""

    frame: Ints
    label: Ints
    pixel_px: Floats


@dataclass(frozen=True, eq=False)
class TransferredPixels:
    """n picked pixels at their predicted places in other photos.

    Attributes
    ----------
    click
        (n,) index of the picked pixel.
    frame_id
        (n,) the other photo.
    pixel_px, covariance_px2
        (n, 2), (n, 2, 2) predicted pixel and its covariance.
    affine
        (n, 2, 2) d pixel there / d pixel here.
    rise
        (n, 2) d pixel there / d height [px/m] of the shown thing; 0 if its height is stated, or was
        estimated.
    jacobian, columns
        (n, 2, k), (n, k): derivatives of the error, and the columns of the unknowns.
    own
        (n, 2, 6) covariance root of the other photo's telemetry errors, if the photo is not
        adjusted.
    """

    click: Annotated[Ints, "n"]
    frame_id: Annotated[tuple[str, ...], "n"]
    pixel_px: Annotated[Floats, "n", 2]
    covariance_px2: Annotated[Floats, "n", 2, 2]
    affine: Annotated[Floats, "n", 2, 2]
    rise: Annotated[Floats, "n", 2]
    jacobian: Annotated[Floats, "n", 2, "k"]
    columns: Annotated[Ints, "n", "k"]
    own: Annotated[Floats, "n", 2, 6]

    def select(self, rows: Ints) -> TransferredPixels:
        """Select some places (m,)."""
        return replace(self, **rows_of(self, rows))

    def joint_covariance(self, adjustment: Adjustment, rows: Ints) -> Floats:
        """Compute the joint covariance (2 m, 2 m) of some places in one other photo."""
        size, m = adjustment.problem.layout.size, len(rows)
        gradient = np.zeros((size, m, 2))
        at = self.columns[rows, :, None], np.arange(m)[:, None, None], np.arange(2)
        np.add.at(gradient, at, np.swapaxes(self.jacobian[rows], 1, 2))
        flat, own = gradient.reshape(size, 2 * m), self.own[rows].reshape(2 * m, -1)
        return np.asarray(flat.T @ adjustment.minimum.factor.solve(flat) + own @ own.T)


def transfer_pixels(
    adjustment: Adjustment, flight: FlightOfPhotos | None, clicked: PickedPixels
) -> TransferredPixels:
    """Transfer picked pixels to every photo that should show them but has no pick of their label.

    Parameters
    ----------
    adjustment
        Adjusted survey.
    flight
        Flight of all photos with telemetry, for those without a pick.
    clicked
        Picked pixels.
    """
    here = predict_rows(adjustment, clicked.frame, clicked.label)
    parts = [
        _transfer(adjustment, here, there, clicked)
        for there in compute_unpicked_rows(adjustment, flight)
    ]
    width = max(part.columns.shape[1] for part in parts)
    parts = [_pad(part, width) for part in parts]
    arrays = {one.name for one in fields(TransferredPixels)} - {"frame_id"}
    joined = {name: np.concatenate([getattr(part, name) for part in parts]) for name in arrays}
    names = tuple(name for part in parts for name in part.frame_id)
    return TransferredPixels(frame_id=names, **joined)


def transfer_between_picks(adjustment: Adjustment, clicked: PickedPixels) -> TransferredPixels:
    """Transfer picked pixels to each other photo with a pick of their label.

    Parameters
    ----------
    adjustment, clicked
        As for `transfer_pixels`.
    """
    here = predict_rows(adjustment, clicked.frame, clicked.label)
    return _transfer(adjustment, here, here, clicked)


def _pad(part: TransferredPixels, width: int) -> TransferredPixels:
    """Pad the derivatives with columns of zeros."""
    more = width - part.columns.shape[1]
    return replace(
        part,
        jacobian=np.pad(part.jacobian, ((0, 0), (0, 0), (0, more))),
        columns=np.pad(part.columns, ((0, 0), (0, more))),
    )


def _transfer(
    adjustment: Adjustment, here: PixelRows, there: PixelRows, clicked: PickedPixels
) -> TransferredPixels:
    """Transfer every picked pixel to the photos `there` that show its label."""
    click, row = np.nonzero(clicked.label[:, None] == there.label[None])
    at, to = here.jacobian[click], there.jacobian[row]
    place = at[:, :, EAST_NORTH]
    area = place[:, 0, 0] * place[:, 1, 1] - place[:, 0, 1] * place[:, 1, 0]
    with np.errstate(invalid="ignore"):  # NaN: not visible
        seen = np.asarray((np.abs(area) > MIN_DETERMINANT) & np.isfinite(to.sum(axis=(1, 2))))
    click, row, at, to = click[seen], row[seen], at[seen], to[seen]
    # A = J_target J_source^-1; the click's offset from the label's predicted pixel moves with A.
    affine = to[:, :, EAST_NORTH] @ np.linalg.inv(at[:, :, EAST_NORTH])
    beside = clicked.pixel_px[click] - here.pixel_px[click]
    moved = there.pixel_px[row] + np.einsum("nij,nj->ni", affine, beside)
    # Error of the transfer: (J_target - A J_source) by all unknowns.
    jacobian = np.concatenate([to, -affine @ at], axis=2)
    columns = np.concatenate([there.columns[row], here.columns[click]], axis=1)
    own = there.own[row]
    covariance = own @ np.swapaxes(own, 1, 2) + propagate_pairs(adjustment, columns, jacobian)
    names = tuple(there.frame_id[k] for k in row)
    survey, up = adjustment.survey, slice(2, adjustment.problem.layout.point_size)
    rise = (to[:, :, up] - affine @ at[:, :, up]).sum(axis=2)  # 0 if no height is unknown
    is_known = (survey.height_above_m != 0.0) | survey.is_free
    rise[is_known[clicked.label[click]]] = 0.0
    return TransferredPixels(click, names, moved, covariance, affine, rise, jacobian, columns, own)
