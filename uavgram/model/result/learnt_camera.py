"""What a survey's own picks and lengths say of the camera that took it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import numpy as np

from uavgram.model.arrays import NAN_IS_NONE, Bools, Floats, FrozenArrays
from uavgram.model.camera.calibration import Calibration
from uavgram.model.result.shared import Estimate

LEARNT_BELOW = 0.9
"""Of the ratio of sigmas: what the survey shrinks by less than a tenth, it does not know."""


@dataclass(frozen=True, kw_only=True, eq=False)
class LearntCamera(FrozenArrays):
    """The camera before and after the survey, parameter by parameter.

    Attributes
    ----------
    names
        (P,) of the parameters.
    prior_value, prior_sigma
        (P,) the calibration.
    value, sigma
        (P,) with the survey's own observations.
    ratio
        (P,) sigma over prior sigma: 1 where nothing was learnt; NaN where the calibration holds
        the parameter fixed.
    shift
        (P,) of the value, in prior sigmas; NaN likewise.
    learnt
        (P,) whether the survey determines the parameter: its ratio is below `LEARNT_BELOW`.
    """

    names: Annotated[tuple[str, ...], "n"]
    prior_value: Annotated[Floats, "n"]
    prior_sigma: Annotated[Floats, "n"]
    value: Annotated[Floats, "n"]
    sigma: Annotated[Floats, "n"]
    ratio: Annotated[Floats, "n", NAN_IS_NONE]
    shift: Annotated[Floats, "n", NAN_IS_NONE]
    learnt: Annotated[Bools, "n"]


def learnt_camera(prior: Calibration, refined: Estimate) -> LearntCamera:
    """Compare a calibration with what the survey made of it.

    Parameters
    ----------
    prior
        The calibration that the survey began with.
    refined
        Its parameters in the adjustment, (P,).
    """
    sigma = np.sqrt(np.maximum(prior.covariance.diagonal(), 0.0))  # rounded below zero is none
    free = np.where(sigma > 0, sigma, np.nan)
    ratio = refined.sigma / free
    return LearntCamera(
        names=prior.parameter_names,
        prior_value=prior.parameters,
        prior_sigma=sigma,
        value=refined.value,
        sigma=refined.sigma,
        ratio=ratio,
        shift=(refined.value - prior.parameters) / free,
        learnt=ratio < LEARNT_BELOW,  # False for NaN
    )
