"""Photos of another zoom than the camera file says: the survey finds it, where that explains all.

A camera that is kept to a calibration of another focal length bends ground, poses and lengths.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from uavgram.errors import GeometryError
from uavgram.estimation.reliability.core import redundancy_of
from uavgram.estimation.reliability.redundancy import NO_REDUNDANCY
from uavgram.estimation.survey.adjustment import Adjustment, Refined
from uavgram.model.arrays import Floats
from uavgram.model.camera.calibration import Calibration
from uavgram.model.message import Message
from uavgram.model.survey.survey import Survey
from uavgram.stages.refine.blunders.outstanding import outstanding

CONTRADICTED = 5.0
"""Size of the test statistic of the zoom, from which on no chance explains it."""

EASED = 1.5
"""Root mean square of the calibration's residuals, in its sigmas, below which the rest fits."""

FREE = 0.4
"""Prior sigma of the factor of both focal lengths."""

SURE, LEAST = 5.0, 0.015
"""The factor found, in its own sigmas and as a share, from which on it is another zoom."""

ENOUGH = 30.0
"""Redundancy of the picks below which a zoom could stand for a wrong pick or two."""


def with_other_zoom(
    survey: Survey, refined: Refined, adjust: Callable[[Survey], Refined]
) -> tuple[Survey, Refined, tuple[Message, ...]]:
    """Survey and result with the focal length that the survey found, if it contradicts the stated.

    One factor of both focal lengths becomes an unknown, and nothing else: no wrong pick, turned
    photo or uneven ground fits by that alone. As they were, where anything does not fit then.

    Parameters
    ----------
    survey
        As it was handed in.
    refined
        Its adjustment.
    adjust
        What makes an adjustment of a survey.
    """
    before = refined.adjustment
    if abs(_zoom_test(before)) < CONTRADICTED or redundancy_of(before, "pixels") < ENOUGH:
        return survey, refined, ()
    stated = survey.calibration
    by_factor = FREE * _by_zoom(stated)
    covariance = stated.covariance + np.outer(by_factor, by_factor)
    free = replace(survey, calibration=replace(stated, covariance=covariance))
    try:
        after = adjust(free)
    except GeometryError:
        return survey, refined, ()
    found, sigma = _factor(after.adjustment)
    certain = abs(found - 1.0) > max(SURE * sigma, LEAST)
    as_many = len(after.pick_index) >= len(refined.pick_index)
    eased = _strain(after.adjustment) < EASED and after.adjustment.minimum.converged
    if not (certain and as_many and eased and outstanding(after.adjustment)[1]):
        return survey, refined, ()
    return free, after, (_message(survey, found, sigma),)


def _by_zoom(camera: Calibration) -> Floats:
    """(P,) derivatives of the interior orientation by a factor of both focal lengths."""
    by_zoom = np.zeros(len(camera.parameters))
    by_zoom[:2] = camera.parameters[:2]
    return by_zoom


def _zoom_test(adjustment: Adjustment) -> float:
    """Standardised test statistic of an error of the calibration's zoom; 0 where nothing checks it.

    Baarda 1968: w = e^T v / sqrt(e^T Q_vv e), with whitened residuals v and the error's direction
    e in their space.
    """
    problem, layout = adjustment.problem, adjustment.problem.layout
    basis = problem.intrinsic_basis
    error, *_ = np.linalg.lstsq(basis, _by_zoom(adjustment.survey.calibration))
    cofactor = np.eye(len(error)) - adjustment.shared(layout.first_intrinsic, layout.intrinsics)
    checked = float(error @ cofactor @ error)
    if checked <= NO_REDUNDANCY * float(error @ error):
        return 0.0
    return float(error @ adjustment.state.intrinsic / np.sqrt(checked))


def _strain(adjustment: Adjustment) -> float:
    return float(np.sqrt(np.mean(adjustment.minimum.blocks["calibration"].residual ** 2)))


def _factor(adjustment: Adjustment) -> tuple[float, float]:
    """Focal length over the stated one, and its sigma."""
    problem, layout = adjustment.problem, adjustment.problem.layout
    stated = adjustment.survey.calibration.parameters[0]
    own = problem.intrinsic_basis[0]
    variance = own @ adjustment.shared(layout.first_intrinsic, layout.intrinsics) @ own
    return (
        float(problem.intrinsics(adjustment.state)[0] / stated),
        float(np.sqrt(variance) / stated),
    )


def _message(survey: Survey, factor: float, sigma: float) -> Message:
    stated = float(survey.calibration.parameters[0])
    text = (
        f"These photos were taken at another zoom than the camera file {survey.calibration.name!r} "
        f"describes: its focal length would be {factor * stated:.0f} ± {sigma * stated:.0f} px, "
        f"{stated:.0f} px is stated. Everything fits with that, so it was taken. Look at zoom, "
        "focus and size of the photos, and calibrate the camera as it was used."
    )
    return Message("warning", "other-zoom", text)
