"""A result with two measured profiles."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from uavgram.model.result.result import Result
from uavgram.model.result.tables import ProfileResults

# Station, offset, height over the first point, height of the ground below over it.
PLACE = np.array([
    [0.0, 0.0, 0.0, 0.0], [5.0, -0.25, 0.5, 0.1], [10.0, 0.0, 0.2, 0.2],
    [0.0, 0.0, 0.0, 0.0], [2.0, 0.0, -1.0, -1.0],
])  # fmt: skip
SIGMA = np.array([
    [0.0, 0, 0, 0], [0.0123, 0.02, 0.03, 0.05], [0.01, 0, 0.02, 0.02],
    [0.0, 0, 0, 0], [0.01, 0, 0.02, 0.02],
])  # fmt: skip


def profiled(result: Result) -> Result:
    """The same survey with them."""
    table = ProfileResults(
        profile=("kerb",) * 3 + ("bank | <b>",) * 2,
        label=("P01", "P02", "P03", "P04", "P05"),
        place_m=PLACE,
        sigma_m=SIGMA,
    )
    return replace(result, profiles=table)
