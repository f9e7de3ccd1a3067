"""Calibrate a camera, with its covariance, from corners of a board in photos."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from uavgram.estimation.calibration.problem import Corners, make_lens, pad
from uavgram.estimation.calibration.reliability import remove_outliers
from uavgram.estimation.reliability.redundancy import compute_upper_tail
from uavgram.model.board import (
    BoardObservations,
    CalibrationOptions,
    CalibrationQuality,
    CalibrationResult,
    ModelScore,
)
from uavgram.stages.calibrate.assessment import AssessedCalibration, judge, usable_photos
from uavgram.stages.calibrate.model_choice import Candidate, choose_and_estimate, start_staged
from uavgram.stages.calibrate.remarks import remarks
from uavgram.stages.calibrate.tables import corner_results, image_maps, photo_results
from uavgram.stages.calibrate.two_cameras import refuse_two_cameras


def calibrate(
    observations: BoardObservations, options: CalibrationOptions, name: str = "camera"
) -> CalibrationResult:
    """Estimate a camera from photos of a board.

    Parameters
    ----------
    observations
        Corners found, of one camera.
    options
        Parameters to estimate, and method.
    name
        Name of the camera.

    Raises
    ------
    GeometryError
        The photos do not determine the camera, and the message names the missing ones; or they are
        of two cameras, and it names the photos of each.
    """
    observations, left_out = usable_photos(observations)
    corners = pad(observations, options.bow)
    judged, models = _estimate(observations, options, corners)
    about_cameras = refuse_two_cameras(judged)
    camera = judged.camera(name)
    p = len(camera.parameters)
    result = CalibrationResult(
        calibration=camera,
        covariance_given_sigma=judged.fit.parameter_covariance(judged.snooped.sigma_scale**-2)[
            :p, :p
        ],
        covariance_corners=judged.fit.parameter_covariance()[:p, :p],
        options=judged.options,
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


def _estimate(
    observations: BoardObservations, options: CalibrationOptions, corners: Corners
) -> tuple[AssessedCalibration, tuple[ModelScore, ...]]:
    """Adjust with the requested number of coefficients, or with the best one."""
    if not options.coefficients:
        return choose_and_estimate(observations, options, corners)
    photo = observations.photos[0]
    start = start_staged(options, corners, (photo.width_px, photo.height_px))
    judged = judge(
        observations, options, corners, remove_outliers(make_lens(options), corners, start, options)
    )
    own = Candidate(options.coefficients, judged.fit, judged.held)
    return judged, (own.score(judged.sigma_px, is_chosen=True),)


def _quality(judged: AssessedCalibration) -> CalibrationQuality:
    fit, held = judged.fit, judged.held.factor
    redundancy = max(fit.corner_redundancy, 1.0)
    squares = fit.corner_cost * judged.snooped.sigma_scale**2
    effect = judged.effect
    return CalibrationQuality(
        sigma_scale=judged.snooped.sigma_scale,
        sigma_px=judged.sigma_px,
        variance_factor=squares / redundancy,
        chi2_probability=compute_upper_tail(squares, redundancy),
        degrees_of_freedom=fit.degrees_of_freedom,
        photo_factor=effect.factor if np.isfinite(effect.factor) else None,
        photo_probability=effect.probability,
        held_out_px=float(np.sqrt(held)) * judged.sigma_px if np.isfinite(held) else None,
        iterations=fit.iterations,
        converged=fit.converged,
    )
