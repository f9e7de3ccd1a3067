"""From corners of a board in photos to a camera that says how well it is known."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from uavgram.estimation.calibration.outliers import snoop
from uavgram.estimation.calibration.problem import Corners, State, lens_of, pad
from uavgram.estimation.reliability import upper_tail
from uavgram.model.calibration_photos import BoardObservations, CalibrationOptions
from uavgram.model.calibration_result import CalibrationQuality, CalibrationResult, ModelScore
from uavgram.model.camera import Calibration
from uavgram.stages.calibrate.compare import (
    USUAL,
    compare_models,
    extended,
    score,
    start_staged,
)
from uavgram.stages.calibrate.judged import Judged, judge
from uavgram.stages.calibrate.maps import image_maps
from uavgram.stages.calibrate.remarks import remarks
from uavgram.stages.calibrate.tables import corner_results, photo_results
from uavgram.stages.calibrate.two_cameras import refuse_two_cameras
from uavgram.stages.calibrate.usable import usable_photos


def calibrate(
    observations: BoardObservations, options: CalibrationOptions, name: str = "camera"
) -> CalibrationResult:
    """Estimate a camera from photos of a board.

    Parameters
    ----------
    observations
        Corners found, of one camera.
    options
        What to estimate, and how.
    name
        Of the camera.

    Raises
    ------
    GeometryError
        The photos do not determine the camera, and the message says what is missing; or they are
        of two cameras, and it says which are of which.
    """
    observations, left_out = usable_photos(observations)
    corners = pad(observations, options.bow)
    photo = observations.photos[0]
    start = start_staged(options, corners, (photo.width_px, photo.height_px))
    options, start, models = _decide(options, corners, start)
    judged = judge(observations, options, corners, snoop(lens_of(options), corners, start, options))
    about_cameras = refuse_two_cameras(judged)
    if not models:
        own = score(judged.fit, judged.held, options.coefficients, judged.sigma_px, is_chosen=True)
        models = (own,)
    camera = _camera(judged, name)
    p = len(camera.parameters)
    result = CalibrationResult(
        calibration=camera,
        covariance_given_sigma=judged.fit.parameter_covariance(judged.snooped.sigma_scale**-2)[
            :p, :p
        ],
        covariance_corners=judged.fit.parameter_covariance()[:p, :p],
        options=options,
        board=observations.board,
        bow_m=judged.fit.state.bow_m,
        bow_covariance_m2=judged.fit.parameter_covariance(judged.factor)[p:, p:],
        corners=corner_results(judged),
        photos=photo_results(judged, left_out),
        quality=_quality(judged),
        models=models,
        maps=image_maps(judged, camera),
        messages=(),
    )
    return replace(result, messages=(*about_cameras, *remarks(judged, result)))


def _decide(
    options: CalibrationOptions, corners: Corners, start: State
) -> tuple[CalibrationOptions, State, tuple[ModelScore, ...]]:
    """Choose the number of coefficients, where that is asked for, on corners without outliers."""
    if options.coefficients:
        return options, start, ()
    usual = replace(options, coefficients=USUAL[options.model], outliers="remove")
    cleaned = snoop(lens_of(usual), corners, start, usual)
    kept = cleaned.fit.corners.count > 0
    clean = cleaned.fit.corners.take(kept)
    sigma_px = float(np.sqrt(np.mean(clean.weight[clean.weight > 0] ** -2.0)))
    models = compare_models(options, clean, cleaned.fit.state.take(kept), sigma_px)
    chosen = next(model.coefficients for model in models if model.is_chosen)
    options = replace(options, coefficients=chosen)
    return options, extended(cleaned.fit.state, options, corners), models


def _camera(judged: Judged, name: str) -> Calibration:
    width, height = judged.size_px
    p = len(judged.fit.state.parameters)
    return Calibration(
        name=name,
        model=judged.options.model,
        width_px=width,
        height_px=height,
        parameters=judged.fit.state.parameters,
        covariance=judged.fit.parameter_covariance(judged.factor)[:p, :p],
    )


def _quality(judged: Judged) -> CalibrationQuality:
    fit, held = judged.fit, judged.held.factor
    redundancy = max(fit.corner_redundancy, 1.0)
    squares = fit.corner_cost * judged.snooped.sigma_scale**2
    effect = judged.effect
    return CalibrationQuality(
        sigma_scale=judged.snooped.sigma_scale,
        sigma_px=judged.sigma_px,
        variance_factor=squares / redundancy,
        chi2_probability=upper_tail(squares, redundancy),
        degrees_of_freedom=fit.degrees_of_freedom,
        photo_factor=effect.factor if np.isfinite(effect.factor) else None,
        photo_probability=effect.probability,
        held_out_px=float(np.sqrt(held)) * judged.sigma_px if np.isfinite(held) else None,
        iterations=fit.iterations,
        converged=fit.converged,
    )
