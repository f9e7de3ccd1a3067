"""Accuracies that logs state, and whether the receiver's solution was a fixed RTK one."""

from __future__ import annotations

import numpy as np

from uavgram.io.logs.quality.samples import merge_sigmas
from uavgram.io.logs.topics import StatedValues

TIME_S = np.arange(6.0)
KNOWN = StatedValues("GPA", TIME_S, (np.full(6, 0.02), np.full(6, 0.03)))


def test_a_row_is_fixed_where_the_solutions_before_and_after_are() -> None:
    fix = np.array([3.0, 6.0, 6.0, 5.0, 6.0, 8.0])
    merged = merge_sigmas([KNOWN], [], StatedValues("GPS", TIME_S + 0.1, (fix,)))

    assert merged is not None
    assert merged.is_fixed.tolist() == [False, False, True, False, False, False]


def test_nothing_is_fixed_where_no_receiver_says_so() -> None:
    for fix in (None, StatedValues("GPS", np.zeros(0), (np.zeros(0),))):
        merged = merge_sigmas([KNOWN], [], fix)
        assert merged is not None
        assert not merged.is_fixed.any()
