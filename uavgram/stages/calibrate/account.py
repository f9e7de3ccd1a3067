"""Account of a calibration: its effect on lengths, and messages."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from uavgram.errors import GeometryError
from uavgram.estimation.calibration.projection_uncertainty import length_uncertainty
from uavgram.estimation.calibration.reliability import common_error
from uavgram.model.camera.board import BoardObservations
from uavgram.model.camera.calibration_result import CalibrationResult, LengthUncertainty, LensEffect
from uavgram.model.message import Message
from uavgram.model.naming import figures

POSES_DEG = (0.0, 45.0)
"""Angles of the optical axis from straight down: a map, and an oblique overview."""


def unexplained_error(result: CalibrationResult) -> float:
    """Estimate the common error of fitting corners beside their own noise, per coordinate [px]."""
    corners, quality = result.corners, result.quality
    fits = np.array([status == "used" for status in corners.status])
    fits &= np.array([status == "used" for status in result.photos.status])[corners.photo]
    removed = np.array([status == "removed" for status in corners.status])
    share = fits.sum() / max((~removed).sum(), 1)
    return common_error(
        corners.residual_px[fits],
        corners.sigma_px[fits] / quality.sigma_scale,
        float(share * quality.degrees_of_freedom),
    )


def with_common_error(observations: BoardObservations, error_px: float) -> BoardObservations:
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


def lens_effects(result: CalibrationResult) -> tuple[LensEffect, ...]:
    """Compute the effects of the camera's errors on lengths on the ground, at `POSES_DEG`."""
    effects = []
    for tilt in POSES_DEG:
        lengths: LengthUncertainty | None
        try:
            lengths = length_uncertainty(result.calibration, tilt_rad=float(np.radians(tilt)))
        except GeometryError:  # a narrow lens may look over the horizon
            lengths = None
        effects.append(LensEffect(tilt_deg=tilt, lengths=lengths))
    return tuple(effects)
