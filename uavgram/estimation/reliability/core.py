"""How well the core of a survey fits: all but the telemetry."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from uavgram.estimation.reliability.redundancy import upper_tail
from uavgram.estimation.survey.adjustment import Adjustment
from uavgram.estimation.survey.observations.kinds import kind_of


def redundancy_of(adjustment: Adjustment, name: str) -> float:
    """Share of the degrees of freedom that a group of observations has."""
    block = adjustment.minimum.blocks[name]
    return block.residual.size - float(adjustment.covariance.leverage(block).sum())


class CoreFit(NamedTuple):
    """How picks, lengths, ground and camera fit together, telemetry left aside.

    Attributes
    ----------
    squares, degrees
        Weighted sum of squares, and redundancy, of these groups.
    probability
        Of so large a sum by chance. Degrees of freedom of a part of the observations are spread
        over more directions, none of larger variance: a chi-square with as many is on the safe
        side.
    """

    squares: float
    degrees: float
    probability: float


def core_fit(adjustment: Adjustment) -> CoreFit:
    """Sum of squares of the groups that show whether the model holds.

    Those of picks and ground: priors of the telemetry are meant to be generous, and ties say
    nothing of the ground.
    """
    blocks = adjustment.minimum.blocks
    core = [name for name in blocks if kind_of(name).is_core]
    squares = sum(float(np.sum(blocks[name].residual ** 2)) for name in core)
    degrees = sum(redundancy_of(adjustment, name) for name in core)
    return CoreFit(squares, degrees, upper_tail(squares, degrees))
