"""A camera that its survey contradicts beyond doubt: another zoom, focus or size of photo.

Kept to its calibration it bends ground, poses and lengths. So where nothing else is wrong, the
calibration is believed as little as its own misfit deserves, and the survey finds its camera.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from uavgram.errors import GeometryError
from uavgram.estimation.survey.adjustment import Adjustment, Refined
from uavgram.model.message import Message
from uavgram.model.survey.survey import Survey
from uavgram.stages.refine.blunders.outstanding import outstanding

CONTRADICTED = 2.5
"""Root mean square of the calibration's residuals, in its sigmas, that no chance explains."""

ROUNDS = 4
"""Times that the calibration's sigmas are multiplied by the root mean square of its residuals."""


def with_freed_camera(
    survey: Survey, refined: Refined, adjust: Callable[[Survey], tuple[Survey, Refined]]
) -> tuple[Survey, Refined, tuple[Message, ...]]:
    """Survey and result with a calibration that is believed as little as its misfit deserves.

    As they were, where the survey does not contradict it, or does not fit then either.

    Parameters
    ----------
    survey
        As it was handed in.
    refined
        Its adjustment.
    adjust
        What makes an adjustment of a survey.
    """
    freed, after = survey, refined
    for _ in range(ROUNDS):
        strain = _strain(after.adjustment)
        if strain < CONTRADICTED and freed is survey:
            return survey, refined, ()
        if strain < 1.5:
            break
        camera = replace(
            freed.calibration, covariance=strain**2 * np.asarray(freed.calibration.covariance)
        )
        try:
            freed, after = adjust(replace(freed, calibration=camera))
        except GeometryError:
            return survey, refined, ()
    if not after.adjustment.minimum.converged or not outstanding(after.adjustment)[1]:
        return survey, refined, ()
    return freed, after, (_message(survey, after.adjustment),)


def _strain(adjustment: Adjustment) -> float:
    return float(np.sqrt(np.mean(adjustment.minimum.blocks["calibration"].residual ** 2)))


def _message(survey: Survey, adjustment: Adjustment) -> Message:
    stated = float(survey.calibration.parameters[0])
    found = float(adjustment.problem.intrinsics(adjustment.state)[0])
    text = (
        "These photos were not taken with the camera that the camera file describes "
        f"({survey.calibration.name!r}), or not as it was calibrated: its focal length would be "
        f"{found:.0f} px, {stated:.0f} px is stated. Everything fits with a camera that the survey "
        "found by itself, and that was taken. Look at zoom, focus and size of the photos, and "
        "calibrate the camera as it was used."
    )
    return Message("warning", "camera-freed", text)
