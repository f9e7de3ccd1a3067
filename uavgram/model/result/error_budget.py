"""Where the uncertainty of each measurement comes from."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from uavgram.model.arrays import NAN_IS_NONE, Floats, FrozenArrays


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
