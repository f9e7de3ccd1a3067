"""Remarks on a calibration and its photos: properties and recommended actions."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import chain

import numpy as np

from uavgram.estimation.calibration.network import (
    RollingShutter,
    Tilts,
    compute_coverage,
    compute_tilts,
    detect_focus_drift,
    detect_rolling_shutter,
)
from uavgram.geometry.camera.projection import share_without_rays
from uavgram.geometry.camera.properties import FRAME_35MM_DIAGONAL_MM
from uavgram.model.board import CalibrationResult, LensSetting, ModelScore
from uavgram.model.message import Message, MessagePlural
from uavgram.model.naming import format_digits
from uavgram.stages.calibrate.assessment import AssessedCalibration

FEW_PHOTOS = 10
SMALL_SPREAD_DEG = 5.0
"""Root mean square of the tilts below which they count as one."""

LARGEST_REACH = 0.85
"""Sufficient distance of a corner from the middle, over that of the image's corner."""

LEAST_SHARE = 0.6
"""Least share of the image's cells with corners in them."""

SIGNIFICANCE = 0.001
SHUTTER_SIGNIFICANCE = 0.01
SHUTTER_PX = 0.5
FOCUS_CHANGE = 0.005
EXIF_TOLERANCE = 0.05
"""Relative tolerance of a focal length by EXIF, which is rounded, and by a table of sensors."""


def remarks_on_photos(
    judged: AssessedCalibration, result: CalibrationResult
) -> tuple[Message, ...]:
    """Report on the geometry, on the image's coverage, on shutter and focus."""
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
            f"{count} photos are few: with 15 to 30 the result and its sigmas are more reliable.",
        )
    found = compute_tilts(judged.fit.state)
    wide, narrow = np.degrees(found.spread_rad)
    if wide < SMALL_SPREAD_DEG:
        yield Message(
            "warning",
            "few-tilts",
            f"All photos see the board at nearly the same tilt ({wide:.1f} degrees of spread): "
            "focal length and distance cannot be separated. Tilt the board by 30 to 45 degrees, to "
            "all sides.",
        )
    elif narrow < SMALL_SPREAD_DEG:
        yield _one_roll(found, result, narrow)


def _one_roll(found: Tilts, result: CalibrationResult, narrow_deg: float) -> Message:
    sigma = np.sqrt(np.diag(result.calibration.covariance))
    # Only the perspective along the direction of the tilts separates tilt, focal length
    # and principal point.
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
    found = compute_coverage(corners.pixel_px[corners.weight > 0], judged.size_px)
    if found.largest_share < LARGEST_REACH or found.share < LEAST_SHARE:
        worst = np.nanmax(result.maps.uncertainty_px)
        yield Message(
            "warning",
            "image-not-covered",
            f"{np.sum(found.corners == 0)} of {found.corners.size} cells of the image hold no "
            f"corner, and none is farther out than {100 * found.largest_share:.0f} % of the way "
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
    """Return whether the drift of the rows is large and significant."""
    return found.probability < SHUTTER_SIGNIFICANCE and found.drift_px > SHUTTER_PX


def _on_the_shutter(judged: AssessedCalibration) -> Iterator[Message]:
    found = detect_rolling_shutter(judged.fit, judged.size_px)
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
    found = detect_focus_drift(judged.fit, max(factor, 1.0))
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
    """Return the focal length [px] by EXIF: as stated, or by its 35 mm equivalent."""
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


STRONG_CORRELATION = 0.9
SQUARE_PIXELS = 0.01
"""Difference of fx / fy from 1 that does not occur in sensors."""


LEFT_OUT = "{count} photos were left out"
DO_NOT_FIT = "{count} photos do not fit the others"
LOOK = (
    "Look at them; leave them out (--outliers remove) if the board was moved, blurred or found "
    "wrongly."
)


def remarks(judged: AssessedCalibration, result: CalibrationResult) -> tuple[Message, ...]:
    """Collect all remarks: on the model, on left-out photos, on the covariance, on the photos."""
    return (
        *_on_the_model(result),
        *_on_outliers(result),
        *_on_the_covariance(judged, result),
        *_on_the_parameters(result),
        *remarks_on_photos(judged, result),
    )


def _on_the_model(result: CalibrationResult) -> Iterator[Message]:
    scores = result.models
    chosen = next(score for score in scores if score.is_chosen)
    if len(scores) > 1:
        yield Message("info", "lens-model", _choice(chosen, scores))
    if not result.quality.converged:
        yield Message(
            "error",
            "calibration-not-converged",
            f"The adjustment did not converge in {result.quality.iterations} steps: estimate "
            "fewer coefficients, or take more photos with the board tilted.",
        )


def _on_outliers(result: CalibrationResult) -> Iterator[Message]:
    photos, corners = result.photos, result.corners
    for file, why in photos.unusable:
        yield _photo("photo-unusable", file, f"{file} was left out: {why}.", LEFT_OUT, why)
    for file, status, reason in zip(photos.file, photos.status, photos.reason, strict=True):
        if status == "removed":
            text = f"{file} was left out: {reason}."
            yield _photo("photo-removed", file, text, LEFT_OUT, reason)
        elif status == "suspect":
            text = (
                f"{file} does not fit the others: {reason}. Look at it; leave it out (--outliers "
                "remove) if the board was moved, blurred or found wrongly."
            )
            yield _photo("photo-suspect", file, text, DO_NOT_FIT, reason, LOOK)
    verdict = np.array(corners.status, dtype=object)
    for word, code, what in (
        ("removed", "corners-removed", "were left out, being outliers"),
        ("suspect", "corners-suspect", "fit worse than chance allows (--outliers remove)"),
    ):
        kept_photo = np.array([s != "removed" for s in photos.status])[corners.photo]
        marked = (verdict == word) & kept_photo
        if marked.any():
            files = [photos.file[i] for i in np.unique(corners.photo[marked])]
            yield Message(
                "info",
                code,
                f"{marked.sum()} of {len(verdict)} corners {what}: in {', '.join(files)}.",
                files=tuple(files),
            )


def _photo(code: str, file: str, text: str, opening: str, why: str, look: str = "") -> Message:
    several = MessagePlural(opening, file, why, look)
    return Message("warning", code, text, files=(file,), several=several)


def _on_the_covariance(judged: AssessedCalibration, result: CalibrationResult) -> Iterator[Message]:
    quality = result.quality
    if judged.factor > 1:
        advice = "Use a stiff, flat board, and hold the camera still."
        if result.options.bow == "flat":
            advice = f"Try --bow paraboloid. {advice}"
        yield Message(
            "warning",
            "photos-disagree",
            f"Photos disagree about the camera {np.sqrt(judged.factor):.1f} times as much as their "
            "corners' noise explains (a board that is not flat, a moving camera, a lens that is "
            f"not quite of this model): the sigmas were enlarged by that. {advice}",
        )
    if quality.sigma_scale > 1.5 or quality.sigma_scale < 1 / 1.5:
        yield Message(
            "info",
            "corner-sigma-scaled",
            f"The corners' errors are {format_digits(quality.sigma_scale)} times as large as they "
            f"state themselves: ± {format_digits(quality.sigma_px)} px is used.",
        )
    elif result.options.corner_sigma == "given" and quality.chi2_probability < 0.001:
        yield Message(
            "warning",
            "corner-sigma-too-small",
            "The stated errors of the camera are too small, as the corners fit worse than stated: "
            f"their errors are {format_digits(quality.variance_factor**0.5)} times as large. Use "
            "`corner_sigma: residuals`.",
        )


def _on_the_parameters(result: CalibrationResult) -> Iterator[Message]:
    camera = result.calibration
    names = camera.parameter_names
    sigma = np.sqrt(np.diag(camera.covariance))
    correlation = result.calibration.correlation
    strong = [
        f"{names[i]} and {names[j]} {correlation[i, j]:.2f}"
        for i in range(len(names))
        for j in range(i + 1, len(names))
        if abs(correlation[i, j]) > STRONG_CORRELATION
    ]
    if strong:
        yield Message(
            "info",
            "correlated-parameters",
            f"Known only in combination: {', '.join(strong)}. The ± of a single one means little. "
            "The camera file has their joint errors, so the results are right.",
        )
    fx, fy = camera.parameters[:2]
    if result.options.aspect is None and abs(fx / fy - 1) > SQUARE_PIXELS:
        yield Message(
            "warning",
            "pixels-not-square",
            f"fx and fy differ by {100 * abs(fx / fy - 1):.1f} %, as on no sensor: the photos "
            f"do not separate focal length and tilt (sigma fx {sigma[0]:.1f} px, fy "
            f"{sigma[1]:.1f} px). Set --fix-aspect, or take photos with the camera rolled by a "
            "quarter turn.",
        )
    prior = result.options.prior
    if prior is not None:
        known = np.flatnonzero(np.diag(prior.information)[: len(names)] > 0)
        stated = np.sqrt(np.diag(np.linalg.inv(prior.information[np.ix_(known, known)])))
        learnt = [
            f"{names[i]} {format_digits(before, 3)} to {format_digits(sigma[i], 3)}"
            for i, before in zip(known.tolist(), stated.tolist(), strict=True)
            if sigma[i] > 0
        ]
        yield Message(
            "info",
            "intrinsics-prior",
            f"Known beforehand ({prior.source}); sigma before and after: {', '.join(learnt)}.",
        )


def _choice(chosen: ModelScore, scores: tuple[ModelScore, ...]) -> str:
    """Describe the choice of the number of coefficients, and the impossible ones."""
    possible = [score for score in scores if not score.dropped]
    others = [score for score in possible if not score.is_chosen]
    compared = [f"{_pixels(chosen.held_out_px)} per coordinate"]
    compared += [", ".join(f"{one.coefficients}: {_pixels(one.held_out_px)}" for one in others)]
    text = (
        f"{chosen.coefficients} distortion coefficients were chosen: the fewest that predict "
        f"photos left out as well as any ({'; '.join(filter(None, compared))})."
    )
    if len(possible) > 1:
        aic = min(possible, key=lambda score: score.aic or np.inf).coefficients
        bic = min(possible, key=lambda score: score.bic or np.inf).coefficients
        text += f" Akaike's criterion prefers {aic}, the Bayesian one {bic}."
    if chosen.dropped:
        text = (
            f"{chosen.coefficients} distortion coefficients were taken, the fewest: the photos "
            "determine no lens model well."
        )
    for one in scores:
        if one.dropped:
            text += f" {one.coefficients} coefficients were no choice: {one.dropped}."
    return text


def _pixels(value: float | None) -> str:
    return "cannot do without one of them" if value is None else f"{value:.3f} px"
