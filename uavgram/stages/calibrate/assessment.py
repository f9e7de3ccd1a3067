"""Calibration under assessment: usable photos, figures, common errors, tables and maps."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from uavgram.errors import GeometryError
from uavgram.estimation.calibration import reliability
from uavgram.estimation.calibration.adjustment import (
    Fit,
    HeldOut,
    cross_validate,
    eliminate_poses,
    fit_poses,
)
from uavgram.estimation.calibration.network import CELL_COUNTS, compute_tilts, map_residuals
from uavgram.estimation.calibration.problem import (
    Corners,
    Linearisation,
    State,
    compute_board_middle,
    linearise,
)
from uavgram.estimation.calibration.projection import (
    compute_length_sigmas,
    compute_projection_covariance,
    compute_worst_sigma,
)
from uavgram.geometry.motion.rotation import hat
from uavgram.model import board
from uavgram.model.arrays import Bools, Floats
from uavgram.model.camera import Calibration
from uavgram.model.frames import Poses
from uavgram.model.message import Message
from uavgram.model.naming import format_digits

FEWEST_CORNERS = 6
"""Least number of corners of a photo: four determine its homography, the others constrain the
camera."""

FEWEST_PHOTOS = 3
"""Least number of photos: a plane gives two conditions on the camera (Zhang 2000, sec. 2.4)."""

SAME_PX = 1e-6
"""Largest distance of corners of the same picture [px]: noise alone is larger."""


def usable_photos(
    observations: board.BoardObservations,
) -> tuple[board.BoardObservations, tuple[tuple[board.BoardPhoto, str], ...]]:
    """Leave out photos without information, with the reason for each.

    Raises
    ------
    GeometryError
        Too few are left.
    """
    kept: list[board.BoardPhoto] = []
    left_out: list[tuple[board.BoardPhoto, str]] = []
    for photo in observations.photos:
        twin = next((other for other in kept if _is_same(photo, other)), None)
        if len(photo.corner) < FEWEST_CORNERS:
            found = f"only {len(photo.corner)} corners were found, at least {FEWEST_CORNERS} needed"
            left_out.append((photo, found))
        elif _in_line(photo, observations):
            left_out.append((photo, "the corners found are in one line of the board"))
        elif twin is not None:
            left_out.append((photo, f"the same picture as {twin.file}"))
        else:
            kept.append(photo)
    if len(kept) < FEWEST_PHOTOS:
        reasons = "".join(f"; {photo.file}: {reason}" for photo, reason in left_out)
        raise GeometryError(
            f"{len(kept)} usable photo(s) of the board do not determine a camera: take at least "
            f"{FEWEST_PHOTOS}, better 15, with the board tilted in different directions{reasons}"
        )
    return board.BoardObservations(board=observations.board, photos=tuple(kept)), tuple(left_out)


def _in_line(photo: board.BoardPhoto, observations: board.BoardObservations) -> bool:
    place = observations.board.corner_board_m[photo.corner, :2]
    spread = np.linalg.svd(place - place.mean(axis=0), compute_uv=False)
    return bool(spread[-1] < 0.1 * observations.board.square_m)


def _is_same(first: board.BoardPhoto, second: board.BoardPhoto) -> bool:
    return bool(
        np.array_equal(first.corner, second.corner)
        and np.abs(first.pixel_px - second.pixel_px).max(initial=0.0) < SAME_PX
    )


PHOTO_FACTOR_SIGNIFICANCE = 0.01
"""Significance level of the test whether photos disagree more than their corners' noise
explains."""

LeftOut = tuple[tuple[board.BoardPhoto, str], ...]


@dataclass(frozen=True, eq=False)
class AssessedCalibration:
    """Adjusted calibration.

    Attributes
    ----------
    observations
        The M usable photos.
    options
        Options with the chosen number of coefficients.
    first
        (M, n) corners with their original sigmas.
    snooped
        Adjustment and outliers, of all usable photos.
    fit
        Adjustment without removed photos.
    held
        Prediction of the photos of `fit`.
    effect
        Disagreement between photos.
    """

    observations: board.BoardObservations
    options: board.CalibrationOptions
    first: Corners
    snooped: reliability.CleanedFit
    fit: Fit
    held: HeldOut
    effect: reliability.PhotoEffect

    @property
    def removed(self) -> Bools:
        """Mask (M,) of removed photos."""
        return self.snooped.bad_photo & (self.options.outliers == "remove")

    @property
    def removed_corner(self) -> Bools:
        """Mask (M, n) of removed corners of remaining photos."""
        return self.snooped.bad_corner & (self.options.outliers == "remove")

    @property
    def factor(self) -> float:
        """Factor of the corners' variances: 1, or the larger disagreement between photos."""
        if self.effect.probability > PHOTO_FACTOR_SIGNIFICANCE:
            return 1.0
        return self.effect.factor

    @property
    def size_px(self) -> tuple[int, int]:
        """Width and height of the image."""
        photo = self.observations.photos[0]
        return photo.width_px, photo.height_px

    @property
    def sigma_px(self) -> float:
        """Standard deviation of a corner's coordinate as scaled: root of the mean square."""
        weight = self.fit.corners.weight
        return float(np.sqrt(np.mean(weight[weight > 0] ** -2.0)))

    def camera(self, name: str) -> Calibration:
        """Return the estimated camera with its covariance."""
        width, height = self.size_px
        p = len(self.fit.state.parameters)
        return Calibration(
            name=name,
            model=self.options.model,
            width_px=width,
            height_px=height,
            parameters=self.fit.state.parameters,
            covariance=self.fit.parameter_covariance(self.factor)[:p, :p],
        )


def judge(
    observations: board.BoardObservations,
    options: board.CalibrationOptions,
    first: Corners,
    snooped: reliability.CleanedFit,
) -> AssessedCalibration:
    """Test photos, and predict each from the others.

    Parameters
    ----------
    observations
        Corners found in M photos.
    options
        Requested options.
    first
        (M, n) corners with their original sigmas.
    snooped
        Adjustment and outliers.
    """
    empty = snooped.fit.corners.count == 0
    fit = reliability.drop_unweighted(snooped.fit, empty)
    # The weights are scaled: the variance factor is 1 unless the sigmas were given.
    variance = fit.corner_cost / max(fit.corner_redundancy, 1.0)
    effect = reliability.estimate_photo_effect(
        fit, reliability.compute_photo_tests(fit, options.corner_sigma), variance
    )
    return AssessedCalibration(
        observations, options, first, snooped, fit, cross_validate(fit), effect
    )


POSES_DEG = (0.0, 45.0)
"""Angles of the optical axis from straight down: a map, and an oblique overview."""


def find_unexplained_error(result: board.CalibrationResult) -> float:
    """Estimate the common error of fitting corners beside their own noise, per coordinate [px]."""
    corners, quality = result.corners, result.quality
    fits = np.array([status == "used" for status in corners.status])
    fits &= np.array([status == "used" for status in result.photos.status])[corners.photo]
    removed = np.array([status == "removed" for status in corners.status])
    share = fits.sum() / max((~removed).sum(), 1)
    return reliability.estimate_common_error(
        corners.residual_px[fits],
        corners.sigma_px[fits] / quality.sigma_scale,
        float(share * quality.degrees_of_freedom),
    )


def add_common_error(
    observations: board.BoardObservations, error_px: float
) -> board.BoardObservations:
    """Add a common error to the sigma of each corner, in quadrature."""
    photos = tuple(
        replace(photo, sigma_px=np.hypot(photo.sigma_px, error_px)) for photo in observations.photos
    )
    return replace(observations, photos=photos)


def common_error_message(error_px: float) -> tuple[Message, ...]:
    """Report the addition to the corners' sigmas."""
    if not error_px:
        return ()
    text = (
        f"Corners miss the model by {format_digits(error_px)} px per coordinate beside their own "
        f"noise "
        "(the "
        "board's print and flatness, the lens model, motion): that was added to every corner's "
        "sigma."
    )
    return (Message("info", "corner-common-error", text),)


def describe_lens_effects(result: board.CalibrationResult) -> tuple[board.LensEffect, ...]:
    """Compute the effects of the camera's errors on lengths on the ground, at `POSES_DEG`."""
    effects = []
    for tilt in POSES_DEG:
        lengths: board.LengthUncertainty | None
        try:
            lengths = compute_length_sigmas(result.calibration, tilt_rad=float(np.radians(tilt)))
        except GeometryError:  # a narrow lens may look over the horizon
            lengths = None
        effects.append(board.LensEffect(tilt_deg=tilt, lengths=lengths))
    return tuple(effects)


@dataclass(frozen=True, eq=False)
class _Everything:
    """All usable photos with the final camera; removed ones with the pose that fits them best."""

    corners: Corners  # all corners found, sigmas as scaled
    state: State
    linear: Linearisation


def _everything(judged: AssessedCalibration) -> _Everything:
    snooped, lens = judged.snooped, judged.fit.lens
    found = judged.first.replace_weights(judged.first.weight / snooped.sigma_scale)
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


def corner_results(judged: AssessedCalibration) -> board.CornerResults:
    """Return every corner of every usable photo, with its test."""
    everything = _everything(judged)
    there = judged.first.weight > 0
    photos, slots = np.nonzero(there)
    tests = reliability.compute_corner_tests(judged.snooped.fit, judged.options.corner_sigma)
    weight = everything.corners.weight[there]
    residual = everything.linear.residual.reshape(*there.shape, 2)[there] / weight[:, None]
    status = np.full(there.shape, "used", dtype=object)
    status[judged.snooped.bad_corner] = "suspect"
    status[judged.removed_corner | judged.removed[:, None]] = "removed"
    kept: list[board.Status] = status[there].tolist()
    return board.CornerResults(
        photo=photos,
        corner=np.concatenate([photo.corner for photo in judged.observations.photos]),
        pixel_px=judged.first.pixel_px[there],
        residual_px=residual,
        sigma_px=1 / weight,
        w=tests.w[photos, slots],
        redundancy=tests.redundancy[photos, slots],
        status=tuple(kept),
    )


def photo_results(judged: AssessedCalibration, left_out: LeftOut) -> board.PhotoResults:
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
    return board.PhotoResults(
        file=files,
        poses=_poses(judged, everything, files),
        rms_px=np.sqrt(squares / count),
        held_out_px=held,
        tilt_deg=np.degrees(compute_tilts(everything.state).tilt_rad),
        status=status,
        reason=reason,
        unusable=tuple((photo.file, why) for photo, why in left_out),
    )


def _verdicts(judged: AssessedCalibration) -> tuple[tuple[board.Status, ...], tuple[str, ...]]:
    size = judged.snooped.bad_photo_size
    bad = judged.snooped.bad_photo
    gone = judged.snooped.bad_corner.sum(axis=1)
    status: list[board.Status] = []
    reason = []
    for i in range(len(bad)):
        if not bad[i]:
            status.append("used")
            reason.append("")
            continue
        status.append("removed" if judged.removed[i] else "suspect")
        if size[i] > reliability.MAX_RELATIVE_RESIDUAL:
            reason.append(f"its corners are {size[i]:.1f} times as far off as in the median photo")
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
    linear = linearise(fit.lens, everything.corners.replace_weights(used), state)
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


def image_maps(judged: AssessedCalibration, camera: Calibration) -> board.ImageMaps:
    """Compute corners, mean residuals and projection uncertainty by cell of the image."""
    columns, rows = CELL_COUNTS
    found = map_residuals(judged.fit, judged.size_px, CELL_COUNTS)
    size = np.array(judged.size_px)
    u, v = np.meshgrid(np.arange(columns) + 0.5, np.arange(rows) + 0.5)
    cell = np.stack([u, v], axis=-1) / CELL_COUNTS * size - 0.5
    return board.ImageMaps(
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
