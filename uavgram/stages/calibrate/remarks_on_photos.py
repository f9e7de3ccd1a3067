"""What the photos lack, and what went wrong when they were taken."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import chain

import numpy as np

from uavgram.estimation.calibration.network import Tilts, coverage, tilts
from uavgram.estimation.calibration.systematics import RollingShutter, focus_drift, rolling_shutter
from uavgram.geometry.camera.back_projection import share_without_rays
from uavgram.geometry.camera.facts import FRAME_35MM_DIAGONAL_MM
from uavgram.model.camera.board import LensSetting
from uavgram.model.camera.calibration_result import CalibrationResult
from uavgram.model.message import Message
from uavgram.stages.calibrate.assessed import AssessedCalibration

FEW_PHOTOS = 10
SMALL_SPREAD_DEG = 5.0
"""Root mean square of the tilts below which they are all but one."""

LARGEST_REACH = 0.85
"""Distance of a corner from the middle, over that of the image's corner, that is enough."""

LEAST_SHARE = 0.6
"""Of the image's cells with corners in them."""

SIGNIFICANCE = 0.001
SHUTTER_SIGNIFICANCE = 0.01
SHUTTER_PX = 0.5
FOCUS_CHANGE = 0.005
EXIF_TOLERANCE = 0.05
"""Of a focal length by EXIF, which is rounded, and by a table of sensors."""


def remarks_on_photos(
    judged: AssessedCalibration, result: CalibrationResult
) -> tuple[Message, ...]:
    """Remarks on the geometry, on the image's coverage, on shutter and focus."""
    return tuple(
        chain(
            _on_tilts(judged, result),
            _on_coverage(judged, result),
            _on_the_shutter(judged),
            _on_the_focus(judged),
            _on_exif(judged, result),
        )
    )


def _on_tilts(judged: AssessedCalibration, result: CalibrationResult) -> Iterator[Message]:
    count = len(judged.fit.corners.count)
    if count < FEW_PHOTOS:
        yield Message(
            "warning",
            "few-photos",
            f"{count} photos are few: 15 to 30 make the result, and what is said of its errors, "
            "firmer.",
        )
    found = tilts(judged.fit.state)
    wide, narrow = np.degrees(found.spread_rad)
    if wide < SMALL_SPREAD_DEG:
        yield Message(
            "warning",
            "few-tilts",
            f"All photos see the board at nearly the same tilt ({wide:.1f} degrees of spread): "
            "focal length and distance cannot be told apart. Tilt the board by 30 to 45 degrees, "
            "to all sides.",
        )
    elif narrow < SMALL_SPREAD_DEG:
        yield _one_roll(found, result, narrow)


def _one_roll(found: Tilts, result: CalibrationResult, narrow_deg: float) -> Message:
    sigma = np.sqrt(np.diag(result.calibration.covariance))
    # Perspective along the one direction of the tilts has to tell tilt, focal length and
    # principal point apart.
    along = "cy" if abs(np.cos(found.weak_rad)) > np.sqrt(0.5) else "cx"
    weak = sigma[2 + (along == "cy")]
    return Message(
        "warning",
        "one-roll",
        "All photos were taken at one roll: the board is tilted along one direction of the image "
        f"only ({narrow_deg:.1f} degrees of spread across it), so {along} is known to "
        f"{weak:.1f} px only. Take half of the photos with the camera rolled by a quarter turn.",
    )


def _on_coverage(judged: AssessedCalibration, result: CalibrationResult) -> Iterator[Message]:
    corners = judged.fit.corners
    found = coverage(corners.pixel_px[corners.weight > 0], judged.size_px)
    if found.largest_share < LARGEST_REACH or found.share < LEAST_SHARE:
        worst = np.nanmax(result.maps.uncertainty_px)
        yield Message(
            "warning",
            "image-not-covered",
            f"{np.sum(found.corners == 0)} of {found.corners.size} cells of the image hold no "
            f"corner, and none lies farther out than {100 * found.largest_share:.0f} % of the way "
            f"to the image's corners: there the lens is extrapolated (sigma up to {worst:.1f} px). "
            "Take photos with the board in the corners of the image.",
        )
    camera = result.calibration
    blind = share_without_rays(camera.model, camera.parameters, camera.width_px, camera.height_px)
    if blind > 0:
        yield Message(
            "warning",
            "lens-folds",
            f"The lens model folds back inside the image: {100 * blind:.1f} % of it has no ray. "
            "Take photos with the board in the corners of the image, or estimate fewer "
            "coefficients.",
        )


def shows_rolling_shutter(found: RollingShutter) -> bool:
    """Whether the drift of the rows is large, and no chance."""
    return found.probability < SHUTTER_SIGNIFICANCE and found.drift_px > SHUTTER_PX


def _on_the_shutter(judged: AssessedCalibration) -> Iterator[Message]:
    found = rolling_shutter(judged.fit, judged.size_px)
    if shows_rolling_shutter(found):
        yield Message(
            "warning",
            "rolling-shutter",
            f"Signs of a rolling shutter: rows drift against each other by {found.drift_px:.1f} px "
            "from top to bottom, differently in each photo. The camera (or the board) moved while "
            "the rows were read out, or the focus changed. Hold both still, in good light.",
        )


def _on_the_focus(judged: AssessedCalibration) -> Iterator[Message]:
    factor = judged.effect.factor if np.isfinite(judged.effect.factor) else 1.0
    found = focus_drift(judged.fit, max(factor, 1.0))
    spread = float(np.sqrt(np.mean(found.relative**2)))
    if found.probability < SIGNIFICANCE and spread > FOCUS_CHANGE:
        yield Message(
            "warning",
            "focal-length-changes",
            f"Photos ask for focal lengths that differ by {100 * spread:.1f} % (rms): autofocus, "
            "zoom or image stabilisation was at work. Fix focus and zoom, and switch "
            "stabilisation off.",
        )


def _on_exif(judged: AssessedCalibration, result: CalibrationResult) -> Iterator[Message]:
    settings = [photo.setting for photo in judged.observations.photos]
    for attribute, code, what in (
        ("camera", "two-cameras", "cameras"),
        ("focal_length_mm", "zoom-changed", "focal lengths [mm]"),
        ("focus_distance_m", "focus-changed", "focus distances [m]"),
    ):
        values = sorted({v for s in settings if (v := getattr(s, attribute)) not in {None, ""}})
        if len(values) > 1:
            yield Message(
                "warning",
                code,
                f"By their EXIF the photos have different {what}: "
                f"{', '.join(str(value) for value in values)}. Calibrate each setting by itself.",
            )
    yield from _on_exif_focal(settings, result)


def _stated_focal(setting: LensSetting, diagonal_px: float) -> float | None:
    """Focal length [px] by EXIF: as stated, or by its 35 mm equivalent over the diagonal."""
    if setting.focal_length_px is not None or setting.focal_length_35mm is None:
        return setting.focal_length_px
    return setting.focal_length_35mm * diagonal_px / FRAME_35MM_DIAGONAL_MM


def _on_exif_focal(settings: list[LensSetting], result: CalibrationResult) -> Iterator[Message]:
    camera = result.calibration
    diagonal = float(np.hypot(camera.width_px, camera.height_px))
    stated = [f for s in settings if (f := _stated_focal(s, diagonal)) is not None]
    if not stated:
        return
    exif = float(np.median(stated))
    fx = float(camera.parameters[0])
    sigma = float(np.sqrt(camera.covariance[0, 0]))
    if abs(fx - exif) > EXIF_TOLERANCE * exif + 3 * sigma:
        yield Message(
            "warning",
            "exif-focal",
            f"The focal length is {fx:.0f} px, by EXIF {exif:.0f} px ({100 * (fx / exif - 1):+.0f} "
            "%): the photos were cropped, resized or zoomed digitally, or the board's proportions "
            "are wrong. Calibrate with whole photos as the camera writes them.",
        )
