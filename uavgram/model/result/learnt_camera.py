"""What a survey's own picks and lengths say of the camera that took it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from uavgram.model.arrays import Bools, Floats, freeze, freeze_as
from uavgram.model.camera.calibration import Calibration
from uavgram.model.result.shared import Estimate

LEARNT_BELOW = 0.9
"""Of the ratio of sigmas: what the survey shrinks by less than a tenth, it does not know."""


@dataclass(frozen=True, kw_only=True, eq=False)
class LearntCamera:
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

    names: tuple[str, ...]
    prior_value: Floats
    prior_sigma: Floats
    value: Floats
    sigma: Floats
    ratio: Floats
    shift: Floats
    learnt: Bools

    def __post_init__(self) -> None:
        n = len(self.names)
        freeze(
            self,
            may_be_nan=("ratio", "shift"),
            prior_value=(n,),
            prior_sigma=(n,),
            value=(n,),
            sigma=(n,),
            ratio=(n,),
            shift=(n,),
        )
        freeze_as(self, np.bool_, learnt=(n,))


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
