"""What a calibration found: the camera, how well it is known, and what speaks against it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from uavgram.model.arrays import Floats, Ints, freeze, freeze_as
from uavgram.model.camera.board import Board, CalibrationOptions
from uavgram.model.camera.calibration import Calibration, correlation_of
from uavgram.model.flight.pose import Poses
from uavgram.model.message import Message

Status = Literal["used", "suspect", "removed"]


@dataclass(frozen=True, kw_only=True, eq=False)
class CornerResults:
    """All N corners that were found, of removed photos too.

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
        (N,) standard deviation per coordinate, as scaled.
    w, redundancy
        (N,) length of the residual in its own standard deviations; how much of an error in the
        corner shows in its residual. 0 where the corner was not used.
    status
        (N,) ``suspect``: fails its test, but stays.
    """

    photo: Ints
    corner: Ints
    pixel_px: Floats
    residual_px: Floats
    sigma_px: Floats
    w: Floats
    redundancy: Floats
    status: tuple[Status, ...]

    def __post_init__(self) -> None:
        n = len(self.status)
        freeze_as(self, np.int64, photo=(n,), corner=(n,))
        freeze(self, pixel_px=(n, 2), residual_px=(n, 2))
        freeze(self, sigma_px=(n,), w=(n,), redundancy=(n,))


@dataclass(frozen=True, kw_only=True, eq=False)
class PhotoResults:
    """The M photos that could be used, and the others by name.

    Attributes
    ----------
    file
        (M,) names.
    poses
        Of the camera in the board's frame (the world is the board); covariance as scaled.
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
        Names and reasons of photos that say nothing of the camera.
    """

    file: tuple[str, ...]
    poses: Poses
    rms_px: Floats
    held_out_px: Floats
    tilt_deg: Floats
    status: tuple[Status, ...]
    reason: tuple[str, ...]
    unusable: tuple[tuple[str, str], ...] = ()

    def __post_init__(self) -> None:
        m = len(self.file)
        freeze(
            self,
            may_be_nan=("held_out_px",),
            rms_px=(m,),
            held_out_px=(m,),
            tilt_deg=(m,),
        )


@dataclass(frozen=True, kw_only=True)
class ModelScore:
    """One lens model in the comparison.

    Attributes
    ----------
    coefficients
        Of distortion.
    aic, bic
        Information criteria: smaller is better; None where the photos do not determine the model.
    held_out_px
        Standard deviation per coordinate of corners of photos left out; None where the model
        cannot do without one of the photos.
    is_chosen
        Whether it is the one of the result.
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
class ImageMaps:
    """What is known over the image; R rows of C cells.

    Attributes
    ----------
    cell_px
        (R, C, 2) their middles.
    corners
        (R, C) how many corners lie in them.
    residual_px
        (R, C, 2) mean residual; NaN without corners.
    residual_probability
        (R, C) of so long a mean residual by chance.
    uncertainty_px
        (R, C) standard deviation of the projection in its worst direction, once the turn of the
        camera that hides it best is taken away; NaN where the lens has no inverse.
    """

    cell_px: Floats
    corners: Ints
    residual_px: Floats
    residual_probability: Floats
    uncertainty_px: Floats

    def __post_init__(self) -> None:
        rows, columns = np.shape(self.corners)
        freeze_as(self, np.int64, corners=(rows, columns))
        freeze(
            self,
            may_be_nan=("residual_px", "uncertainty_px"),
            cell_px=(rows, columns, 2),
            residual_px=(rows, columns, 2),
            residual_probability=(rows, columns),
            uncertainty_px=(rows, columns),
        )


@dataclass(frozen=True, kw_only=True)
class CalibrationQuality:
    """How well everything fits.

    Attributes
    ----------
    sigma_scale
        Factor by which the corners' sigmas were scaled to agree with the residuals.
    sigma_px
        Standard deviation per coordinate of a corner, after that (root of the mean square).
    variance_factor, chi2_probability
        Of the adjustment with the corners' sigmas as they were given, and of so large a factor by
        chance.
    degrees_of_freedom
        Observations and priors, less unknowns.
    photo_factor, photo_probability
        How much more the photos disagree about the camera than their corners' noise explains, and
        of so large a factor by chance; the covariance was multiplied by it where that is
        improbable. None with too few photos.
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
    """A calibrated camera.

    Attributes
    ----------
    calibration
        The camera, with the covariance to rely on: that of the corners, times the photo factor
        where there is one.
    covariance_given_sigma
        (P, P) for the corners' sigmas as they were given.
    covariance_corners
        (P, P) for the corners' sigmas as scaled, corners taken as independent: OpenCV's.
    options
        As used, the number of coefficients decided.
    board
        The board, flat.
    bow_m, bow_covariance_m2
        (k,), (k, k) height of the board's middle over its rim, along z: one or two curvatures.
    corners, photos
        What became of each.
    quality
        How it fits.
    models
        Lens models compared; at least the one used.
    maps
        Over the image.
    messages
        Remarks, in words.
    """

    calibration: Calibration
    covariance_given_sigma: Floats
    covariance_corners: Floats
    options: CalibrationOptions
    board: Board
    bow_m: Floats
    bow_covariance_m2: Floats
    corners: CornerResults
    photos: PhotoResults
    quality: CalibrationQuality
    models: tuple[ModelScore, ...]
    maps: ImageMaps
    messages: tuple[Message, ...]

    def __post_init__(self) -> None:
        p, k = len(self.calibration.parameters), len(self.bow_m)
        freeze(
            self,
            covariance_given_sigma=(p, p),
            covariance_corners=(p, p),
            bow_m=(k,),
            bow_covariance_m2=(k, k),
        )

    @property
    def correlation(self) -> Floats:
        """(P, P) of the camera's parameters; 0 where one is held fixed."""
        return correlation_of(self.calibration.covariance)
