"""Central differences: the referee of every Jacobian."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike

from uavgram.model.arrays import Floats


def central_differences(
    function: Callable[[Floats], Floats], x: ArrayLike, step: float = 1e-5
) -> Floats:
    """Derivative of function(x), any shape, by the last axis of x, which becomes its last axis.

    Fourth order: the steps' own error stays below 1e-9 for smooth functions.
    """
    at = np.asarray(x, float)
    columns = []
    for i in range(at.shape[-1]):
        shift = np.zeros(at.shape[-1])
        shift[i] = step
        near = function(at + shift) - function(at - shift)
        far = function(at + 2 * shift) - function(at - 2 * shift)
        columns.append((8 * near - far) / (12 * step))
    return np.stack(columns, axis=-1)


def assert_derivative(analytic: Floats, numeric: Floats, relative: float = 1e-6) -> None:
    """Equal to `relative` of the largest entry of each matrix."""
    assert analytic.shape == numeric.shape
    scale = np.abs(numeric).max(axis=(-2, -1), keepdims=True)
    assert np.isfinite(numeric).all()
    assert (np.abs(analytic - numeric) <= relative * scale).all()
