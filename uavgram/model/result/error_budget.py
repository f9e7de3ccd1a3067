"""Where the uncertainty of each measurement comes from."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from uavgram.model.arrays import NAN_IS_NONE, Floats, FrozenArrays

SOURCES: dict[str, str] = {
    "pixels": "picks",
    "matches": "matches",
    "identification": "identification",
    "linked": "identification",
    "ties": "tie points",
    "tie heights": "tie points",
    "beside": "tie points",
    "calibration": "lens",
    "lengths": "known lengths",
    "known": "known things",
    "tape": "tape",
    "telemetry": "flight log",
    "boresight": "flight log",
    "lever_arm": "flight log",
    "position_bias": "flight log",
    "heading_bias": "flight log",
    "clock": "flight log",
    "clock_drift": "flight log",
    "readout": "rolling shutter",
    "turning": "rolling shutter",
    "plane": "ground",
    "roughness": "ground",
    "relief": "ground",
    "heights": "ground",
    "idle": "ground",
    "control": "control points",
    "gauge": "choice of axes",
    "other": "friction and times",
}
"""Group of observations in the likelihood -> its name for people. The groups of further areas of
the ground are called ``plane of NAME``."""


@dataclass(frozen=True, kw_only=True, eq=False)
class ErrorBudget(FrozenArrays):
    """Shares of the variance of M measurements.

    Attributes
    ----------
    source
        (S,) names for people, such as ``picks``; what contributes nothing anywhere is left out.
    share
        (M, S) of the variance, rows add up to 1; NaN where there is no value.
    """

    source: Annotated[tuple[str, ...], "s"]
    share: Annotated[Floats, "m", "s", NAN_IS_NONE]
