"""Other solutions: which measured values they would change, and to what."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from uavgram.model.arrays import Floats
from uavgram.model.result.tables import MeasurementResults

SAME_SIGMAS = 1.0
"""Values of two other solutions that lie this close, in sigmas, are one value to a reader."""


def with_alternatives(
    measurements: MeasurementResults, values: Sequence[Sequence[float]]
) -> MeasurementResults:
    """Mark every measurement that the observations do not decide.

    The interval of a value holds for one solution. Where another solution, which explains the
    observations as well, puts the value outside of it, the interval says too much: the other
    values belong beside it, wherever it is shown.

    Parameters
    ----------
    measurements
        M measurements of the first solution.
    values
        The M values under each other solution; NaN where it has none.

    Returns
    -------
    MeasurementResults
        With `alternative_values`, ascending, those within `SAME_SIGMAS` of each other once.
    """
    table = np.array([list(other) for other in values], dtype=np.float64)
    table = table.reshape(len(values), len(measurements.name))
    low, high = measurements.interval_95.T
    outside = (table < low) | (table > high)  # never of NaN: what has no interval is not judged
    return replace(
        measurements,
        alternative_values=tuple(
            _distinct(np.sort(column[there]), SAME_SIGMAS * sigma)
            for column, there, sigma in zip(table.T, outside.T, measurements.sigma, strict=True)
        ),
    )


def _distinct(ascending: Floats, reach: float) -> tuple[float, ...]:
    """Values farther than `reach` from the one before them that is kept."""
    kept: list[float] = []
    for value in ascending.tolist():
        if not kept or value - kept[-1] > reach:
            kept.append(value)
    return tuple(kept)
