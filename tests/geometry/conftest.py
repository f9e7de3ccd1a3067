"""Central differences: the referee of every Jacobian."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest


def central_differences(function: Callable, x: np.ndarray, step: float = 1e-5) -> np.ndarray:
    """Derivative of function(x), any shape, by the last axis of x, which becomes its last axis.

    Fourth order: the steps' own error stays below 1e-9 for smooth functions.
    """
    x = np.asarray(x, float)
    columns = []
    for i in range(x.shape[-1]):
        shift = np.zeros(x.shape[-1])
        shift[i] = step
        near = function(x + shift) - function(x - shift)
        far = function(x + 2 * shift) - function(x - 2 * shift)
        columns.append((8 * near - far) / (12 * step))
    return np.stack(columns, axis=-1)


def assert_derivative(analytic: np.ndarray, numeric: np.ndarray, relative: float = 1e-6) -> None:
    """Equal to `relative` of the largest entry of each matrix."""
    assert analytic.shape == numeric.shape
    scale = np.abs(numeric).max(axis=(-2, -1), keepdims=True)
    assert np.isfinite(numeric).all()
    assert (np.abs(analytic - numeric) <= relative * scale).all()


@pytest.fixture
def differences() -> Callable:
    return central_differences


@pytest.fixture
def same_derivative() -> Callable:
    return assert_derivative
