"""The number of distortion coefficients: the best that the photos determine."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import replace

import numpy as np

from uavgram.errors import GeometryError
from uavgram.estimation.calibration.normals import UndeterminedError
from uavgram.estimation.calibration.outliers import Snooped, snoop
from uavgram.estimation.calibration.problem import Corners, lens_of
from uavgram.estimation.calibration.projection_uncertainty import length_uncertainty
from uavgram.model.camera.board import BoardObservations, CalibrationOptions
from uavgram.model.camera.calibration_result import ModelScore
from uavgram.stages.calibrate.assessed import AssessedCalibration, judge
from uavgram.stages.calibrate.compare import (
    MODELS,
    USUAL,
    candidates,
    choose,
    extended,
    start_staged,
)

LARGEST_COST = 0.01
"""Share of a usual length that the lens alone may cost: ordinary calibrations are at 0.0002 to
0.002, rational lenses whose coefficients trade places at 0.01 to 9."""


def choose_and_estimate(
    observations: BoardObservations, options: CalibrationOptions, corners: Corners
) -> tuple[AssessedCalibration, tuple[ModelScore, ...]]:
    """Estimate with the best number of coefficients that the photos determine.

    Raises
    ------
    UndeterminedError
        They determine none.
    """
    photo = observations.photos[0]
    cleaned = _cleaned(options, corners, (photo.width_px, photo.height_px))
    kept = cleaned.fit.corners.count > 0
    clean = cleaned.fit.corners.take(kept)
    sigma_px = float(np.sqrt(np.mean(clean.weight[clean.weight > 0] ** -2.0)))
    found = candidates(options, clean, cleaned.fit.state.take(kept))
    estimated: dict[int, AssessedCalibration] = {}
    best = choose(found)
    while best is not None:
        own = replace(options, coefficients=best.coefficients)
        start = extended(cleaned.fit.state, own, corners)
        try:
            judged = judge(observations, own, corners, snoop(lens_of(own), corners, start, own))
            estimated[own.coefficients], why = judged, _why_not(judged)
        except UndeterminedError as fault:
            why = str(fault)
        if not why:
            break
        found = [replace(one, dropped=why) if one is best else one for one in found]
        best = choose(found)
    if not estimated:
        raise UndeterminedError(found[0].dropped)
    # Where none is good the simplest has the fewest unknowns; the verdict says what it is worth.
    chosen = min(estimated) if best is None else best.coefficients
    scores = (one.score(sigma_px, is_chosen=one.coefficients == chosen) for one in found)
    return estimated[chosen], tuple(scores)


def _cleaned(options: CalibrationOptions, corners: Corners, size_px: tuple[int, int]) -> Snooped:
    """Take outliers out with the usual number of coefficients, or with as many as there can be."""
    usual = USUAL[options.model]
    *first, last = (usual, *(n for n in reversed(MODELS[options.model]) if n < usual))

    def clean(count: int) -> Snooped:
        own = replace(options, coefficients=count, outliers="remove")
        return snoop(lens_of(own), corners, start_staged(own, corners, size_px), own)

    for count in first:
        with suppress(UndeterminedError):
            return clean(count)
    return clean(last)


def _why_not(judged: AssessedCalibration) -> str:
    """Why a lens is no choice though it fits; empty where it is one."""
    if not judged.fit.converged:
        return "its adjustment did not come to rest"
    try:
        cost = length_uncertainty(judged.camera("camera"), tilt_rad=0.0).medians[0]
    except GeometryError:  # it folds back all over the image
        return "hardly a pixel of it has a ray"
    if cost <= LARGEST_COST:
        return ""
    return f"the photos do not determine its coefficients: it alone would cost a length {cost:.1%}"
