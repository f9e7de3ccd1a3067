"""A generator of random numbers that draws the most likely value each time: nothing is wrong."""

from __future__ import annotations

from typing import Any

import numpy as np

from uavgram.model.arrays import Floats


class Still(np.random.Generator):
    """Draws means. Only the draws that a simulated survey makes are there."""

    def __init__(self) -> None:
        super().__init__(np.random.PCG64(0))

    def standard_normal(self, size: Any = None, *_: Any, **__: Any) -> Any:  # noqa: ANN401
        """Draw zeros."""
        return 0.0 if size is None else np.zeros(size)

    def uniform(self, low: Any = 0.0, high: Any = 1.0, size: Any = None) -> Any:  # noqa: ANN401
        """Draw the middle.

        Parameters
        ----------
        low, high, size
            As of numpy's.
        """
        middle = 0.5 * (low + high)
        return middle if size is None else np.full(size, middle)

    def random(self, size: Any = None, *_: Any, **__: Any) -> Any:  # noqa: ANN401
        """Draw ones: nothing happens that has a probability below that."""
        return 1.0 if size is None else np.ones(size)

    def multivariate_normal(self, mean: Any, *_: Any, **__: Any) -> Floats:  # noqa: ANN401
        """Draw the mean."""
        return np.array(mean, dtype=np.float64)
