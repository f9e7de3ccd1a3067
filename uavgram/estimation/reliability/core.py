"""How well the core of a survey fits: all but the telemetry."""

from __future__ import annotations

import numpy as np

from uavgram.estimation.survey.adjustment import Adjustment

CORE = ("pixels", "lengths", "known", "control", "calibration", "roughness", "heights", "relief")
"""Groups that say whether the model of picks and ground holds: priors of the telemetry are meant to
be generous."""


def redundancy_of(adjustment: Adjustment, name: str) -> float:
    """Share of the degrees of freedom that a group of observations has."""
    block = adjustment.minimum.blocks[name]
    return block.residual.size - float(adjustment.covariance.leverage(block).sum())


def core_squares(adjustment: Adjustment) -> tuple[float, float]:
    """Weighted sum of squares of the core of a survey, and its share of the degrees of freedom."""
    blocks = adjustment.minimum.blocks
    core = [name for name in blocks if name in CORE or name.startswith("plane")]
    squares = sum(float(np.sum(blocks[name].residual ** 2)) for name in core)
    return squares, sum(redundancy_of(adjustment, name) for name in core)
