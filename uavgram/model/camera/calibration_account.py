"""A calibration made ready for readers: what it means for lengths, and all that is to be said."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import numpy as np

from uavgram.model.arrays import Floats, FrozenArrays
from uavgram.model.camera.calibration_result import CalibrationResult
from uavgram.model.camera.provenance import CameraProvenance
from uavgram.model.columns import Column
from uavgram.model.message import Message


@dataclass(frozen=True, kw_only=True, eq=False)
class LengthUncertainty(FrozenArrays):
    """What a calibration's errors do to lengths on level ground, seen from a given pose.

    Attributes
    ----------
    pixel_px
        (L, 2, 2) ends of the lengths in the image.
    length
        (L,) in heights of the camera above the ground.
    pose_known
        (L,) relative standard deviation where the pose comes from elsewhere (the flight log).
    pose_fitted
        (L,) where the pose follows the picture: lengths relative to each other, as where known
        lengths fix pose and scale.
    """

    pixel_px: Annotated[Floats, "n", 2, 2, Column("ends_px")]
    length: Annotated[Floats, "n", Column("length_in_heights")]
    pose_known: Annotated[Floats, "n"]
    pose_fitted: Annotated[Floats, "n"]

    @property
    def medians(self) -> tuple[float, float]:
        """What the lens alone costs a usual length, as a share: `pose_fitted`, `pose_known`."""
        return float(np.median(self.pose_fitted)), float(np.median(self.pose_known))


PhotoReason = tuple[str, str]


@dataclass(frozen=True, kw_only=True, eq=False)
class LensEffect:
    """What the camera's errors do to lengths on level ground, at one pose.

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
    """All that files and pictures of a calibration are made from.

    Attributes
    ----------
    result
        The camera and its judgement.
    provenance
        Chain of custody.
    packages
        Pairs of package name and version.
    without_board
        Photos in which the board was not found, with the reason.
    common_error_px
        Added to the corners' own sigmas in quadrature: what residuals show beside their noise.
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
