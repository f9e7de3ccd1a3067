"""Tables of all corners and photos of a calibration, and maps of the image."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from uavgram.errors import GeometryError
from uavgram.estimation.calibration.adjustment import eliminate_poses, fit_poses
from uavgram.estimation.calibration.network import CELL_COUNTS, compute_tilts, map_residuals
from uavgram.estimation.calibration.problem import (
    Corners,
    Linearisation,
    State,
    compute_board_middle,
    linearise,
)
from uavgram.estimation.calibration.projection import (
    compute_projection_covariance,
    compute_worst_sigma,
)
from uavgram.estimation.calibration.reliability import MAX_RELATIVE_RESIDUAL, compute_corner_tests
from uavgram.geometry.motion.rotation import hat
from uavgram.model.arrays import Bools, Floats
from uavgram.model.board import CornerResults, ImageMaps, PhotoResults, Status
from uavgram.model.camera import Calibration
from uavgram.model.frames import Poses
from uavgram.stages.calibrate.assessment import AssessedCalibration, LeftOut


@dataclass(frozen=True, eq=False)
class _Everything:
    """All usable photos with the final camera; removed ones with the pose that fits them best."""

    corners: Corners  # all corners found, sigmas as scaled
    state: State
    linear: Linearisation


def _everything(judged: AssessedCalibration) -> _Everything:
    snooped, lens = judged.snooped, judged.fit.lens
    found = judged.first.weighted(judged.first.weight / snooped.sigma_scale)
    state = snooped.fit.state
    out = judged.removed
    if out.any():
        posed = fit_poses(lens, found.take(out), state.take(out))[0]
        rotation, middle = state.camera_from_board.copy(), state.middle_camera_m.copy()
        rotation[out], middle[out] = posed.camera_from_board, posed.middle_camera_m
        state = replace(state, camera_from_board=rotation, middle_camera_m=middle)
    linear = linearise(lens, found, state)
    assert linear is not None  # noqa: S101  (it could be adjusted)
    return _Everything(found, state, linear)


def corner_results(judged: AssessedCalibration) -> CornerResults:
    """Return every corner of every usable photo, with its test."""
    everything = _everything(judged)
    there = judged.first.weight > 0
    photos, slots = np.nonzero(there)
    tests = compute_corner_tests(judged.snooped.fit, judged.options.corner_sigma)
    weight = everything.corners.weight[there]
    residual = everything.linear.residual.reshape(*there.shape, 2)[there] / weight[:, None]
    status = np.full(there.shape, "used", dtype=object)
    status[judged.snooped.bad_corner] = "suspect"
    status[judged.removed_corner | judged.removed[:, None]] = "removed"
    kept: list[Status] = status[there].tolist()
    return CornerResults(
        photo=photos,
        corner=np.concatenate([photo.corner for photo in judged.observations.photos]),
        pixel_px=judged.first.pixel_px[there],
        residual_px=residual,
        sigma_px=1 / weight,
        w=tests.w[photos, slots],
        redundancy=tests.redundancy[photos, slots],
        status=tuple(kept),
    )


def photo_results(judged: AssessedCalibration, left_out: LeftOut) -> PhotoResults:
    """Return every usable photo with its pose; then unusable ones, by name and reason."""
    everything = _everything(judged)
    count = judged.first.count
    there = judged.first.weight > 0
    weight = np.where(there, everything.corners.weight, 1.0)
    residual = everything.linear.residual.reshape(*there.shape, 2) / weight[..., None]
    # Root mean square of the corners' residuals [px], and of the predictions without each photo.
    squares = np.sum(np.where(there[..., None], residual, 0.0) ** 2, axis=(1, 2))
    held = np.full(len(count), np.nan)
    held[~judged.removed] = np.sqrt(judged.held.by_photo) * judged.sigma_px
    files = tuple(photo.file for photo in judged.observations.photos)
    status, reason = _verdicts(judged)
    return PhotoResults(
        file=files,
        poses=_poses(judged, everything, files),
        rms_px=np.sqrt(squares / count),
        held_out_px=held,
        tilt_deg=np.degrees(compute_tilts(everything.state).tilt_rad),
        status=status,
        reason=reason,
        unusable=tuple((photo.file, why) for photo, why in left_out),
    )


def _verdicts(judged: AssessedCalibration) -> tuple[tuple[Status, ...], tuple[str, ...]]:
    size = judged.snooped.bad_photo_size
    bad = judged.snooped.bad_photo
    gone = judged.snooped.bad_corner.sum(axis=1)
    status: list[Status] = []
    reason = []
    for i in range(len(bad)):
        if not bad[i]:
            status.append("used")
            reason.append("")
            continue
        status.append("removed" if judged.removed[i] else "suspect")
        if size[i] > MAX_RELATIVE_RESIDUAL:
            reason.append(f"its residuals are {size[i]:.1f} times those of the median photo")
        else:
            reason.append(f"{gone[i]} of its corners do not fit")
    return tuple(status), tuple(reason)


def _poses(judged: AssessedCalibration, everything: _Everything, files: tuple[str, ...]) -> Poses:
    """Convert board poses in the camera's frame to camera poses in the board's frame.

    C = m - R^T t, with R = camera_from_board and m the board's middle. The estimator's errors (dt,
    phi), true R = exp(phi) R, are in those of `Poses`: dC = -R^T (dt + hat(t) phi), dtheta = -phi.
    """
    # Covariance of the board poses: own part, and the camera's through the Schur complement's gain.
    fit, state = judged.fit, everything.state
    used = _used_weight(judged, everything)
    linear = linearise(fit.lens, everything.corners.weighted(used), state)
    assert linear is not None  # noqa: S101  (it could be adjusted)
    normals = eliminate_poses(fit.lens, linear)
    border = fit.border_covariance * judged.factor
    covariance = normals.pose_inverse * judged.factor
    covariance += normals.gain @ border @ np.swapaxes(normals.gain, 1, 2)
    back = np.swapaxes(state.camera_from_board, 1, 2)
    # Transform of the errors: dC = -R^T (dt + hat(t) phi), dtheta = -phi.
    turn = np.zeros((len(files), 6, 6))
    turn[:, :3, :3] = -back
    turn[:, :3, 3:] = -back @ hat(state.middle_camera_m)
    turn[:, 3:, 3:] = -np.eye(3)
    center = compute_board_middle(judged.observations.board) - np.einsum(
        "mij,mj->mi", back, state.middle_camera_m
    )
    return Poses(
        frame_id=files,
        center_world_m=center,
        world_from_camera=back,
        covariance=turn @ covariance @ np.swapaxes(turn, 1, 2),
    )


def _used_weight(judged: AssessedCalibration, everything: _Everything) -> Floats:
    """Return weights (M, n) without bad corners, but with removed photos, for their poses."""
    out: Bools = judged.removed_corner & ~judged.removed[:, None]
    return np.where(out, 0.0, everything.corners.weight)


def image_maps(judged: AssessedCalibration, camera: Calibration) -> ImageMaps:
    """Compute corners, mean residuals and projection uncertainty by cell of the image."""
    columns, rows = CELL_COUNTS
    found = map_residuals(judged.fit, judged.size_px, CELL_COUNTS)
    size = np.array(judged.size_px)
    u, v = np.meshgrid(np.arange(columns) + 0.5, np.arange(rows) + 0.5)
    cell = np.stack([u, v], axis=-1) / CELL_COUNTS * size - 0.5
    return ImageMaps(
        cell_px=cell,
        corners=found.corners,
        residual_px=found.mean_px,
        residual_probability=found.probability,
        uncertainty_px=_uncertainty(camera, cell),
    )


def _uncertainty(camera: Calibration, cell: Floats) -> Floats:
    """Return the largest standard deviation (R, C) of the grid's pixels within each cell."""
    rows, columns = cell.shape[:2]
    try:
        pixel, covariance = compute_projection_covariance(camera)
    except GeometryError:  # hardly a pixel has a ray: see the remarks
        return np.full((rows, columns), np.nan)
    size = np.array([camera.width_px, camera.height_px])
    at = np.clip((pixel + 0.5) / size * (columns, rows), 0, (columns - 1, rows - 1)).astype(int)
    result = np.full((rows, columns), -np.inf)
    np.maximum.at(result, (at[:, 1], at[:, 0]), compute_worst_sigma(covariance))
    return np.where(np.isfinite(result), result, np.nan)
