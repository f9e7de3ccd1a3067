"""Running medians, ranks and extremes, against scipy's filters of the same window."""

import numpy as np
import pytest
from scipy.ndimage import median_filter, minimum_filter, percentile_filter

from uavgram.geometry.motion.interpolation import running_median, running_rank, windows


@pytest.mark.parametrize("size", [1, 2, 5, 6, 15])
@pytest.mark.parametrize("count", [1, 4, 100, 4097])  # less than a window, and more than a block
def test_running_ranks_are_those_of_scipys_filters(count: int, size: int) -> None:
    values = np.random.default_rng(count).normal(size=(count, 2))

    median, ninth = running_median(values, size), running_rank(values, size, size * 9 // 10)
    least, about = windows(values, size).min(axis=-1), (size, 1)
    np.testing.assert_array_equal(median, median_filter(values, about, mode="nearest"))
    np.testing.assert_array_equal(ninth, percentile_filter(values, 90, about, mode="nearest"))
    np.testing.assert_array_equal(least, minimum_filter(values, about, mode="nearest"))


def test_a_running_median_keeps_what_is_infinite_apart() -> None:
    values = np.array([0.0, np.inf, 1.0, np.inf, np.inf])

    assert running_median(values, 3).tolist() == [0.0, 1.0, np.inf, np.inf, np.inf]
