"""Calibration board, its corners in photos, and options of a calibration.

The board's frame is OpenCV's: origin at its first corner, x along a row, y down the columns, z into
the board, away from the camera.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Literal

import numpy as np

from uavgram.model.arrays import Floats, FrozenArrays, Ints, freeze
from uavgram.model.camera.calibration import PARAMETER_NAMES, LensModel

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
