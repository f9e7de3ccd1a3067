"""Result of a calibration: the camera, its accuracy, and all that its reports contain."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Literal

import numpy as np

from uavgram.model.arrays import NAN_IS_NONE, Floats, FrozenArrays, Ints, freeze
from uavgram.model.camera.board import Board, CalibrationOptions
from uavgram.model.camera.calibration import Calibration, CameraProvenance
from uavgram.model.flight.pose import Poses
from uavgram.model.message import Message
from uavgram.model.naming import Column

Status = Literal["used", "suspect", "removed"]


@dataclass(frozen=True, kw_only=True, eq=False)
class CornerResults(FrozenArrays):
    """All N corners that were found, including those of removed photos.

    Attributes
    ----------
    photo
        (N,) index into ``PhotoResults.file``.
    corner
        (N,) index into ``Board.corner_board_m``.
    pixel_px, residual_px
        (N, 2) as found; predicted minus found (for a removed photo with the pose that fits it
        best).
    sigma_px
        (N,) standard deviation per coordinate, after scaling.
    w, redundancy
        (N,) length of the standardised residual; redundancy number (the part of an error that shows
        in the residual). 0 where the corner was not used.
    status
        (N,) ``suspect``: fails its test, but is kept.
    """

    photo: Annotated[Ints, "n"]
    corner: Annotated[Ints, "n"]
    pixel_px: Annotated[Floats, "n", 2]
    residual_px: Annotated[Floats, "n", 2]
    sigma_px: Annotated[Floats, "n"]
    w: Annotated[Floats, "n"]
    redundancy: Annotated[Floats, "n"]
    status: Annotated[tuple[Status, ...], "n"]


@dataclass(frozen=True, kw_only=True, eq=False)
class PhotoResults(FrozenArrays):
    """The M usable photos, and the others by name.

    Attributes
    ----------
    file
        (M,) names.
    poses
        Of the camera in the board's frame (the world is the board); covariance after scaling.
    rms_px
        (M,) root mean square length of the residuals.
    held_out_px
        (M,) standard deviation per coordinate of its corners, predicted by a camera that was
        calibrated without this photo; NaN for a photo that was not used.
    tilt_deg
        (M,) between the board's normal and the optical axis.
    status, reason
        (M,) why it is suspect or removed; empty where it is used.
    unusable
        Names and reasons of photos without information on the camera.
    """

    file: Annotated[tuple[str, ...], "m"]
    poses: Poses
    rms_px: Annotated[Floats, "m"]
    held_out_px: Annotated[Floats, "m", NAN_IS_NONE]
    tilt_deg: Annotated[Floats, "m"]
    status: tuple[Status, ...]
    reason: tuple[str, ...]
    unusable: tuple[tuple[str, str], ...] = ()


@dataclass(frozen=True, kw_only=True)
class ModelScore:
    """One lens model in the comparison.

    Attributes
    ----------
    coefficients
        Number of distortion coefficients.
    aic, bic
        Information criteria: smaller is better; None where the photos do not determine the model.
    held_out_px
        Standard deviation per coordinate of corners of photos left out; None where the model is
        undetermined without one of the photos.
    is_chosen
        Whether it is the model of the result.
    dropped
        Why it could not be chosen; empty where it could.
    """

    coefficients: int
    aic: float | None
    bic: float | None
    held_out_px: float | None
    is_chosen: bool
    dropped: str = ""


@dataclass(frozen=True, kw_only=True, eq=False)
class ImageMaps(FrozenArrays):
    """Maps over the image of residuals and projection uncertainty; R rows of C cells.

    Attributes
    ----------
    cell_px
        (R, C, 2) centres of the cells.
    corners
        (R, C) number of corners in each.
    residual_px
        (R, C, 2) mean residual; NaN without corners.
    residual_probability
        (R, C) of such a long mean residual by chance.
    uncertainty_px
        (R, C) standard deviation of the projection in its worst direction, after removal of the
        camera rotation that compensates it best; NaN where the lens has no inverse.
    """

    cell_px: Annotated[Floats, "r", "c", 2]
    corners: Annotated[Ints, "r", "c"]
    residual_px: Annotated[Floats, "r", "c", 2, NAN_IS_NONE]
    residual_probability: Annotated[Floats, "r", "c"]
    uncertainty_px: Annotated[Floats, "r", "c", NAN_IS_NONE]


@dataclass(frozen=True, kw_only=True)
class CalibrationQuality:
    """Quality of fit of a calibration.

    Attributes
    ----------
    sigma_scale
        Factor by which the corners' sigmas were scaled to agree with the residuals.
    sigma_px
        Standard deviation per coordinate of a corner after scaling (root mean square).
    variance_factor, chi2_probability
        Of the adjustment with the corners' sigmas as given, and of such a large factor by chance.
    degrees_of_freedom
        Observations and priors, less unknowns.
    photo_factor, photo_probability
        Disagreement of the photos about the camera relative to that explained by their corners'
        noise, and probability of such a large factor by chance; the covariance was multiplied by it
        where that is improbable. None with too few photos.
    held_out_px
        Standard deviation per coordinate of corners of photos left out; None where the others do
        not determine the camera.
    iterations, converged
        Of the last adjustment.
    """

    sigma_scale: float
    sigma_px: float
    variance_factor: float
    chi2_probability: float
    degrees_of_freedom: int
    photo_factor: float | None
    photo_probability: float
    held_out_px: float | None
    iterations: int
    converged: bool


@dataclass(frozen=True, kw_only=True, eq=False)
class CalibrationResult:
    """Result of a camera calibration.

    Attributes
    ----------
    calibration
        The camera, with the recommended covariance: that of the corners, times the photo factor
        where there is one.
    covariance_given_sigma
        (P, P) for the corners' sigmas as given.
    covariance_corners
        (P, P) for the corners' sigmas after scaling, corners treated as independent: OpenCV's.
    options
        As used, including the chosen number of coefficients.
    board
        The board, flat.
    bow_m, bow_covariance_m2
        (k,), (k, k) height of the board's middle above its rim, along z: one or two curvatures.
    corners, photos
        Results of each.
    quality
        Quality of fit.
    models
        Lens models compared; at least the one used.
    maps
        Maps over the image.
    messages
        Remarks, in words.
    """

    calibration: Calibration
    covariance_given_sigma: Annotated[Floats, "p", "p"]
    covariance_corners: Annotated[Floats, "p", "p"]
    options: CalibrationOptions
    board: Board
    bow_m: Annotated[Floats, "k"]
    bow_covariance_m2: Annotated[Floats, "k", "k"]
    corners: CornerResults
    photos: PhotoResults
    quality: CalibrationQuality
    models: tuple[ModelScore, ...]
    maps: ImageMaps
    messages: tuple[Message, ...]

    def __post_init__(self) -> None:
        freeze(self, p=len(self.calibration.parameters))


@dataclass(frozen=True, kw_only=True, eq=False)
class LengthUncertainty(FrozenArrays):
    """Effect of a calibration's errors on lengths on level ground, seen from a given pose.

    Attributes
    ----------
    pixel_px
        (L, 2, 2) ends of the lengths in the image.
    length
        (L,) in multiples of the camera's height above the ground.
    pose_known
        (L,) relative standard deviation where the pose comes from another source (the flight log).
    pose_fitted
        (L,) where the pose is fitted to the picture: lengths relative to each other, as where known
        lengths determine pose and scale.
    """

    pixel_px: Annotated[Floats, "n", 2, 2, Column("ends_px")]
    length: Annotated[Floats, "n", Column("length_in_heights")]
    pose_known: Annotated[Floats, "n"]
    pose_fitted: Annotated[Floats, "n"]

    @property
    def medians(self) -> tuple[float, float]:
        """Median relative standard deviations from the lens alone: `pose_fitted`, `pose_known`."""
        return float(np.median(self.pose_fitted)), float(np.median(self.pose_known))


PhotoReason = tuple[str, str]


@dataclass(frozen=True, kw_only=True, eq=False)
class LensEffect:
    """Effect of the camera's errors on lengths on level ground, at one pose.

    Attributes
    ----------
    tilt_deg
        Of the optical axis from straight down.
    lengths
        Over the image; None where the camera sees too little ground at this tilt.
    """

    tilt_deg: float
    lengths: LengthUncertainty | None


@dataclass(frozen=True, kw_only=True, eq=False)
class CalibrationAccount:
    """Content of the files and pictures of a calibration.

    Attributes
    ----------
    result
        The camera with its quality.
    provenance
        Chain of custody.
    packages
        Pairs of package name and version.
    without_board
        Photos in which the board was not found, with the reason.
    common_error_px
        Added to the corners' own sigmas in quadrature: part of the residuals beyond their noise.
    effects
        One for each of `POSES_DEG`.
    messages
        On the photos, then on the calibration.
    """

    result: CalibrationResult
    provenance: CameraProvenance
    packages: tuple[tuple[str, str], ...]
    without_board: tuple[PhotoReason, ...]
    common_error_px: float
    effects: tuple[LensEffect, ...]
    messages: tuple[Message, ...]

    @property
    def left_out(self) -> tuple[PhotoReason, ...]:
        """Photos that are not in ``result.photos``, with the reason."""
        return (*self.without_board, *self.result.photos.unusable)
