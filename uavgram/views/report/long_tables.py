"""Selection of the rows of a long table: browsers are slow with tens of thousands of rows."""

from __future__ import annotations

import numpy as np

from uavgram.model.arrays import Floats
from uavgram.model.result.result import Result

MAX_ROWS = 1_000
"""Largest number of rows of one table."""


def most_doubtful(doubt: Floats) -> tuple[int, ...]:
    """Select the rows with the most doubt, in their order.

    Parameters
    ----------
    doubt
        (N,) amount of doubt; NaN is none.
    """
    first = np.argsort(-np.nan_to_num(doubt, nan=-np.inf), kind="stable")[:MAX_ROWS]
    return tuple(np.sort(first).tolist())


def rows_told(result: Result) -> dict[str, tuple[int, ...]]:
    """Select rows of photos, those without a place first; of points, least certain; of files."""
    frames = result.frames
    is_lost = np.array([status in ("rejected", "unmatched") for status in frames.status])
    return {
        "photos_told": most_doubtful(is_lost.astype(np.float64)),
        "points_told": most_doubtful(result.points.relative.ellipse_95_m[:, 0]),
        "files_told": most_doubtful(np.zeros(len(result.provenance.inputs))),
    }
