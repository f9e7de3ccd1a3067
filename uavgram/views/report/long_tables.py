"""Which rows of a long table a page tells: no browser shows tens of thousands of them well."""

from __future__ import annotations

import numpy as np

from uavgram.model.arrays import Floats
from uavgram.model.result.result import Result

MOST_TOLD = 1_000
"""Rows of one table."""


def most_doubtful(doubt: Floats) -> tuple[int, ...]:
    """Rows that are told, in their order: those of which there is most doubt.

    Parameters
    ----------
    doubt
        (N,) how much; NaN is none.
    """
    first = np.argsort(-np.nan_to_num(doubt, nan=-np.inf), kind="stable")[:MOST_TOLD]
    return tuple(np.sort(first).tolist())


def rows_told(result: Result) -> dict[str, tuple[int, ...]]:
    """Rows of photos, those without a place first; of points, the least certain; of files."""
    frames = result.frames
    is_lost = np.array([status in ("rejected", "unmatched") for status in frames.status])
    return {
        "photos_told": most_doubtful(is_lost.astype(np.float64)),
        "points_told": most_doubtful(result.points.relative.ellipse_95_m[:, 0]),
        "files_told": most_doubtful(np.zeros(len(result.provenance.inputs))),
    }
