"""The values of a series beside each of them: what a running median or maximum is made of."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from uavgram.model.arrays import Floats

_BLOCK = 4096  # so many windows are copied at a time: they stay in the processor's cache


def windows(values: NDArray[Any], size: int) -> NDArray[Any]:
    """Each value and those about it, the ends repeated; (N, ...) to (N, ..., size), N >= 1.

    Of an even size one more stands before the value than behind it.
    """
    beside = [(size // 2, size - 1 - size // 2)] + [(0, 0)] * (values.ndim - 1)
    return sliding_window_view(np.pad(values, beside, "edge"), size, axis=0)


def running_rank(values: NDArray[np.floating[Any]], size: int, rank: int) -> Floats:
    """The value of this rank, from 0, in the window about each value.

    Parameters
    ----------
    values
        (N, ...), N >= 1.
    size
        Of the windows, as `windows` has it.
    rank
        Less than `size`; half of it is the median of an odd size.

    Returns
    -------
    (N, ...)
    """
    about = windows(values, size)
    starts = range(0, len(about), _BLOCK)
    blocks = (np.partition(about[k : k + _BLOCK], rank, axis=-1)[..., rank] for k in starts)
    return np.concatenate(list(blocks))


def running_median(values: NDArray[np.floating[Any]], size: int) -> Floats:
    """The median of the window about each value, of an even size the upper one of its two."""
    return running_rank(values, size, size // 2)
