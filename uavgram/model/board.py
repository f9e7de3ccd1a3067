"""Calibration board, its corners in photos, and the result of a calibration with all its reports.

The board's frame is OpenCV's: origin at its first corner, x along a row, y down the columns, z into
the board, away from the camera.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Literal

import numpy as np

from uavgram.model.arrays import NAN_IS_NONE, Floats, FrozenArrays, Ints, freeze
from uavgram.model.camera import PARAMETER_NAMES, Calibration, CameraProvenance, LensModel
from uavgram.model.frames import Poses
from uavgram.model.message import Message
from uavgram.model.naming import Column

BoardKind = Literal["chessboard", "charuco"]
Bow = Literal["flat", "bowl", "paraboloid"]
OutlierRule = Literal["report", "remove"]
CornerSigma = Literal["residuals", "given"]


@dataclass(frozen=True, kw_only=True, eq=False)
class Board:
    """A calibration board and its B corners.

    Attributes
    ----------
    kind
        Printed pattern.
    columns, rows
        Inner corners along x and along y: a corner's number is row * columns + column.
    square_m
        Side of a square.
    corner_board_m
        (B, 3) corners in the board's frame, z = 0 for a flat board.
    marker_m
        Side of a ChArUco marker; 0 for a chessboard.
    dictionary
        Name of the ChArUco markers' dictionary; empty for a chessboard.
    """

    kind: BoardKind
    columns: int
    rows: int
    square_m: float
    corner_board_m: Annotated[Floats, "b", 3]
    marker_m: float = 0.0
    dictionary: str = ""

    def __post_init__(self) -> None:
        if self.columns < 2 or self.rows < 2:
            raise ValueError(
                f"a board has two inner corners each way, got {self.columns} x {self.rows}"
            )
        if not self.square_m > 0:
            raise ValueError(f"square_m must be greater than 0, got {self.square_m}")
        freeze(self, b=self.columns * self.rows)


def flat_board(
    columns: int,
    rows: int,
    square_m: float,
    *,
    kind: BoardKind = "chessboard",
    marker_m: float = 0.0,
    dictionary: str = "",
) -> Board:
    """Return a board of `columns` x `rows` inner corners, `square_m` apart, in the plane z = 0.

    Parameters
    ----------
    columns, rows
        Inner corners along x and along y.
    square_m
        Side of a square.
    kind, marker_m, dictionary
        Printed pattern, see `Board`.
    """
    row, column = np.divmod(np.arange(columns * rows), columns)
    corner = np.stack([column, row, np.zeros(columns * rows)], axis=1) * square_m
    return Board(
        kind=kind,
        columns=columns,
        rows=rows,
        square_m=square_m,
        corner_board_m=corner,
        marker_m=marker_m,
        dictionary=dictionary,
    )


@dataclass(frozen=True, kw_only=True)
class LensSetting:
    """Camera and lens in a photo's EXIF; None and empty where EXIF has no entry.

    Attributes
    ----------
    camera
        Make and model.
    focal_length_mm
        True focal length.
    focal_length_35mm
        Equivalent focal length, referred to the 36 x 24 mm frame.
    focus_distance_m
        Distance at which the lens is focused.
    focal_length_px
        Focal length in pixels of this photo, where EXIF (or a table of cameras) gives it.
    """

    camera: str = ""
    focal_length_mm: float | None = None
    focal_length_35mm: float | None = None
    focus_distance_m: float | None = None
    focal_length_px: float | None = None


@dataclass(frozen=True, kw_only=True, eq=False)
class BoardPhoto:
    """Corners of the board that were found in one photo.

    Attributes
    ----------
    file
        Name of the photo.
    width_px, height_px
        Size of the original image.
    corner
        (n,) indices into ``Board.corner_board_m``, each at most once.
    pixel_px
        (n, 2) image coordinates, (0, 0) = centre of the top-left pixel.
    sigma_px
        (n,) standard deviation of each of the two coordinates.
    setting
        Camera and lens from EXIF.
    """

    file: str
    width_px: int
    height_px: int
    corner: Annotated[Ints, "n"]
    pixel_px: Annotated[Floats, "n", 2]
    sigma_px: Annotated[Floats, "n"]
    setting: LensSetting = LensSetting()

    def __post_init__(self) -> None:
        freeze(self)
        if len(np.unique(self.corner)) != len(self.corner):
            raise ValueError(f"{self.file}: a corner was found twice")
        if not (self.sigma_px > 0).all():
            raise ValueError(f"{self.file}: sigma_px must be greater than 0")


@dataclass(frozen=True, kw_only=True, eq=False)
class BoardObservations:
    """A board in M photos of one camera, all of one size.

    Attributes
    ----------
    board
        The board.
    photos
        (M,) those in which it was found.
    """

    board: Board
    photos: tuple[BoardPhoto, ...]

    def __post_init__(self) -> None:
        count = len(self.board.corner_board_m)
        for photo in self.photos:
            if len(photo.corner) and not 0 <= photo.corner.min() <= photo.corner.max() < count:
                raise ValueError(f"{photo.file}: a corner's index is not on the board")
        sizes = {(photo.width_px, photo.height_px) for photo in self.photos}
        if len(sizes) > 1:
            raise ValueError(f"photos of one size are needed, got {sorted(sizes)}")


@dataclass(frozen=True, kw_only=True, eq=False)
class IntrinsicsPrior(FrozenArrays):
    """Prior of the interior orientation: from EXIF, a table of cameras, a file.

    Attributes
    ----------
    source
        Source of the values, in words.
    parameters
        (P,) of a camera of the same model; coefficients beyond them are unknown.
    information
        (P, P) inverse of their covariance; rows of zeros for unknown parameters.
    """

    source: str
    parameters: Annotated[Floats, "n"]
    information: Annotated[Floats, "n", "n"]


@dataclass(frozen=True, kw_only=True)
class CalibrationOptions:
    """Options of a calibration.

    Attributes
    ----------
    model
        Lens model.
    coefficients
        Distortion coefficients to estimate. Brown: 3 (k1 k2 k3: radial only), 5 (k1 k2 p1 p2 k3) or
        8 (rational: with k4 k5 k6); fisheye: 4. 0: chosen by cross-validation.
    aspect
        fx / fy to hold; None: both are estimated.
    fixed_principal_point
        Hold it in the middle of the image.
    bow
        Shape of the board: ``flat``; ``bowl``: one curvature; ``paraboloid``: a curvature along x
        and one along y.
    bow_sigma_m
        Prior sigma of the height of the middle above the rim.
    corner_sigma
        ``residuals``: the corners' sigmas are right up to a common factor, estimated from the
        residuals (as in OpenCV); ``given``: they are right as given.
    outliers
        ``report``, or ``remove``: one at a time in each photo, each one reported.
    significance
        Probability of any suspicion in photos without outliers.
    prior
        Prior of the intrinsics that is independent of the photos.
    """

    model: LensModel = "brown"
    coefficients: int = 5
    aspect: float | None = None
    fixed_principal_point: bool = False
    bow: Bow = "flat"
    bow_sigma_m: float = 0.005
    corner_sigma: CornerSigma = "residuals"
    outliers: OutlierRule = "report"
    significance: float = 0.001
    prior: IntrinsicsPrior | None = None

    def __post_init__(self) -> None:
        allowed = (0, 3, 5, 8) if self.model == "brown" else (0, 4)
        if self.coefficients not in allowed:
            raise ValueError(f"coefficients of {self.model} must be one of {allowed}")


def parameter_count(model: LensModel, coefficients: int) -> int:
    """Return the number P of parameters of a camera with so many distortion coefficients."""
    return 12 if model == "brown" and coefficients == 8 else len(PARAMETER_NAMES[model])


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
