"""Which observation to take out as a blunder, if any can be told from the others."""

from __future__ import annotations

import numpy as np

from uavgram.estimation.adjustment import Refined, Removal
from uavgram.estimation.reliability import critical_value, reliability

TIE = 1e-3
"""Relative difference of standardised residuals below which they do not tell blunders apart."""

MOST = 0.25
"""Share of the observations beyond which what is taken out is no blunder but the model."""


def blunders(refined: Refined, significance: float) -> list[Removal]:
    """The pick or length with the largest standardised residual above the critical value.

    More than one where they tie: with a single redundancy every standardised residual is the
    same, and nothing tells which observation is wrong (Foerstner 1983, separability).
    """
    adjustment = refined.adjustment
    blocks, covariance = adjustment.minimum.blocks, adjustment.covariance
    pick = np.abs(reliability(blocks["pixels"], covariance).w).max(axis=1)
    found = [Removal("pick", int(refined.pick_index[k]), float(w)) for k, w in enumerate(pick)]
    if "lengths" in blocks:
        line = np.abs(reliability(blocks["lengths"], covariance).w)[:, 0]
        used = refined.line_index[adjustment.problem.line_index]
        found += [Removal("line", int(used[k]), float(w)) for k, w in enumerate(line)]
    largest = max(removal.w for removal in found)
    if largest <= critical_value(significance):
        return []
    return [removal for removal in found if removal.w >= (1.0 - TIE) * largest]
