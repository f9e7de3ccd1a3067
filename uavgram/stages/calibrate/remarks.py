"""What a person should know of a calibration, and what to do about it."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from uavgram.model.camera.calibration_result import CalibrationResult, ModelScore
from uavgram.model.message import Message, Several
from uavgram.model.naming import figures
from uavgram.stages.calibrate.assessed import AssessedCalibration
from uavgram.stages.calibrate.remarks_on_photos import remarks_on_photos

STRONG_CORRELATION = 0.9
SQUARE_PIXELS = 0.01
"""Departure of fx / fy from 1 that no sensor has."""


LEFT_OUT = "{count} photos were left out"
DO_NOT_FIT = "{count} photos do not fit the others"
LOOK = (
    "Look at them; leave them out (--outliers remove) if the board was moved, blurred or found "
    "wrongly."
)


def remarks(judged: AssessedCalibration, result: CalibrationResult) -> tuple[Message, ...]:
    """All remarks: on the model, on what was left out, on the covariance, on the photos."""
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
            f"The adjustment did not come to rest in {result.quality.iterations} steps: estimate "
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
    several = Several(opening, file, why, look)
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
            f"Residuals are {figures(quality.sigma_scale)} times as large as the corners' own "
            "sigmas "
            f"say: those were scaled to {figures(quality.sigma_px)} px.",
        )
    elif result.options.corner_sigma == "given" and quality.chi2_probability < 0.001:
        yield Message(
            "warning",
            "corner-sigma-too-small",
            "The camera's sigmas are too small, as the corners fit worse than their own sigmas "
            f"say: use corner_sigma: residuals (variance factor "
            f"{figures(quality.variance_factor)}).",
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
            f"Strongly correlated: {', '.join(strong)}. Their sigmas mean little one by one; the "
            "covariance says what they do together.",
        )
    fx, fy = camera.parameters[:2]
    if result.options.aspect is None and abs(fx / fy - 1) > SQUARE_PIXELS:
        yield Message(
            "warning",
            "pixels-not-square",
            f"fx and fy differ by {100 * abs(fx / fy - 1):.1f} %, which no sensor does: the photos "
            f"do not tell focal length and tilt apart (sigma fx {sigma[0]:.1f} px, fy "
            f"{sigma[1]:.1f} px). Set --fix-aspect, or take photos with the camera rolled by a "
            "quarter turn.",
        )
    prior = result.options.prior
    if prior is not None:
        known = np.flatnonzero(np.diag(prior.information)[: len(names)] > 0)
        stated = np.sqrt(np.diag(np.linalg.inv(prior.information[np.ix_(known, known)])))
        learnt = [
            f"{names[i]} {figures(before, 3)} to {figures(sigma[i], 3)}"
            for i, before in zip(known.tolist(), stated.tolist(), strict=True)
            if sigma[i] > 0
        ]
        yield Message(
            "info",
            "intrinsics-prior",
            f"Known beforehand ({prior.source}); sigma before and after: {', '.join(learnt)}.",
        )


def _choice(chosen: ModelScore, scores: tuple[ModelScore, ...]) -> str:
    """How the number of coefficients was chosen, and which could not be."""
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
