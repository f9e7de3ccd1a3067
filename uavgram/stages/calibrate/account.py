"""A calibration made ready for readers: what it means for lengths, and all that is to be said."""

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
"""Of the optical axis from straight down: a map, and an overview from the side."""


def unexplained_error(result: CalibrationResult) -> float:
    """What the corners that fit have in common beside their own noise, per coordinate [px]."""
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
    """The same corners with a common error added to each sigma, in quadrature."""
    photos = tuple(
        replace(photo, sigma_px=np.hypot(photo.sigma_px, error_px)) for photo in observations.photos
    )
    return replace(observations, photos=photos)


def common_error_message(error_px: float) -> tuple[Message, ...]:
    """Say what was added to the corners' sigmas."""
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
    """What the camera's errors do to lengths on the ground, at `POSES_DEG`."""
    effects = []
    for tilt in POSES_DEG:
        lengths: LengthUncertainty | None
        try:
            lengths = length_uncertainty(result.calibration, tilt_rad=float(np.radians(tilt)))
        except GeometryError:  # a narrow lens may look over the horizon
            lengths = None
        effects.append(LensEffect(tilt_deg=tilt, lengths=lengths))
    return tuple(effects)
