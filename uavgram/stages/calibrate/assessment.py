"""Calibration under assessment: usable photos, figures of the adjustment, and the account of it."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from uavgram.errors import GeometryError
from uavgram.estimation.calibration.adjustment import Fit, HeldOut, cross_validate
from uavgram.estimation.calibration.problem import Corners
from uavgram.estimation.calibration.projection import compute_length_sigmas
from uavgram.estimation.calibration.reliability import (
    CleanedFit,
    PhotoEffect,
    compute_photo_tests,
    drop_unweighted,
    estimate_common_error,
    estimate_photo_effect,
)
from uavgram.model.arrays import Bools
from uavgram.model.board import (
    BoardObservations,
    BoardPhoto,
    CalibrationOptions,
    CalibrationResult,
    LengthUncertainty,
    LensEffect,
)
from uavgram.model.camera import Calibration
from uavgram.model.message import Message
from uavgram.model.naming import figures

FEWEST_CORNERS = 6
"""Least number of corners of a photo: four determine its homography, the others constrain the
camera."""

FEWEST_PHOTOS = 3
"""Least number of photos: a plane gives two conditions on the camera (Zhang 2000, sec. 2.4)."""

SAME_PX = 1e-6
"""Largest distance of corners of the same picture [px]: noise alone is larger."""


def usable_photos(
    observations: BoardObservations,
) -> tuple[BoardObservations, tuple[tuple[BoardPhoto, str], ...]]:
    """Leave out photos without information, with the reason for each.

    Raises
    ------
    GeometryError
        Too few are left.
    """
    kept: list[BoardPhoto] = []
    left_out: list[tuple[BoardPhoto, str]] = []
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
    return BoardObservations(board=observations.board, photos=tuple(kept)), tuple(left_out)


def _in_line(photo: BoardPhoto, observations: BoardObservations) -> bool:
    place = observations.board.corner_board_m[photo.corner, :2]
    spread = np.linalg.svd(place - place.mean(axis=0), compute_uv=False)
    return bool(spread[-1] < 0.1 * observations.board.square_m)


def _is_same(first: BoardPhoto, second: BoardPhoto) -> bool:
    return bool(
        np.array_equal(first.corner, second.corner)
        and np.abs(first.pixel_px - second.pixel_px).max(initial=0.0) < SAME_PX
    )


PHOTO_FACTOR_SIGNIFICANCE = 0.01
"""Significance level of the test whether photos disagree more than their corners' noise
explains."""

LeftOut = tuple[tuple[BoardPhoto, str], ...]


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

    observations: BoardObservations
    options: CalibrationOptions
    first: Corners
    snooped: CleanedFit
    fit: Fit
    held: HeldOut
    effect: PhotoEffect

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
    observations: BoardObservations,
    options: CalibrationOptions,
    first: Corners,
    snooped: CleanedFit,
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
    fit = drop_unweighted(snooped.fit, empty)
    # The weights are scaled: the variance factor is 1 unless the sigmas were given.
    variance = fit.corner_cost / max(fit.corner_redundancy, 1.0)
    effect = estimate_photo_effect(fit, compute_photo_tests(fit, options.corner_sigma), variance)
    return AssessedCalibration(
        observations, options, first, snooped, fit, cross_validate(fit), effect
    )


POSES_DEG = (0.0, 45.0)
"""Angles of the optical axis from straight down: a map, and an oblique overview."""


def find_unexplained_error(result: CalibrationResult) -> float:
    """Estimate the common error of fitting corners beside their own noise, per coordinate [px]."""
    corners, quality = result.corners, result.quality
    fits = np.array([status == "used" for status in corners.status])
    fits &= np.array([status == "used" for status in result.photos.status])[corners.photo]
    removed = np.array([status == "removed" for status in corners.status])
    share = fits.sum() / max((~removed).sum(), 1)
    return estimate_common_error(
        corners.residual_px[fits],
        corners.sigma_px[fits] / quality.sigma_scale,
        float(share * quality.degrees_of_freedom),
    )


def add_common_error(observations: BoardObservations, error_px: float) -> BoardObservations:
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
        f"Corners miss the model by {figures(error_px)} px per coordinate beside their own noise "
        "(the "
        "board's print and flatness, the lens model, motion): that was added to every corner's "
        "sigma."
    )
    return (Message("info", "corner-common-error", text),)


def describe_lens_effects(result: CalibrationResult) -> tuple[LensEffect, ...]:
    """Compute the effects of the camera's errors on lengths on the ground, at `POSES_DEG`."""
    effects = []
    for tilt in POSES_DEG:
        lengths: LengthUncertainty | None
        try:
            lengths = compute_length_sigmas(result.calibration, tilt_rad=float(np.radians(tilt)))
        except GeometryError:  # a narrow lens may look over the horizon
            lengths = None
        effects.append(LensEffect(tilt_deg=tilt, lengths=lengths))
    return tuple(effects)
