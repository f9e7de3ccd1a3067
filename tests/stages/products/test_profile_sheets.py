"""Axes of profiles."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from uavgram.model.result.tables import NO_PROFILES, ProfileResults
from uavgram.stages.products.map_layers import profile_sheets, ticks


@given(st.floats(-1e4, 1e4), st.floats(1e-3, 1e4), st.integers(2, 12))
def test_ticks_are_round_and_hold_everything(low: float, size: float, most: int) -> None:
    high = low + size
    found = ticks(low, high, most)
    step = found[1] - found[0]
    lead = float(f"{step:.0e}") / 10 ** np.floor(np.log10(step) + 1e-6)

    assert found[0] <= low + 1e-8 * step + 1e-9
    assert found[-1] >= high - 1e-8 * step - 1e-9
    assert round(lead) in (1, 2, 5)
    assert 2 <= len(found) <= most + 3


def level(rise: float, sigma: float = 0.0, length: float = 10.0) -> ProfileResults:
    station = np.array([0.0, 0.4, 1.0]) * length
    place = np.column_stack([station, 0 * station, [0.0, rise, 0.0], 0 * station])
    sigmas = np.full((3, 4), sigma)
    return ProfileResults(profile=("a",) * 3, label=("P", "Q", "R"), place_m=place, sigma_m=sigmas)


@pytest.mark.parametrize(
    ("rise", "larger"), [(8.0, 1), (2.9, 1), (1.4, 2), (0.25, 10), (0.002, 100), (0.0, 100)]
)
def test_small_heights_are_drawn_larger(rise: float, larger: int) -> None:
    (sheet,) = profile_sheets(level(rise))

    assert sheet.exaggeration == larger
    drawn = np.ptp(sheet.height_ticks_m) * larger
    assert drawn >= 0.05 * 10.0
    assert sheet.origin == "P"


def test_axes_hold_the_intervals_of_the_heights() -> None:
    (sheet,) = profile_sheets(level(1.0, sigma=0.5))

    assert sheet.height_ticks_m[0] <= -1.96 * 0.5
    assert sheet.height_ticks_m[-1] >= 1.0 + 1.95 * 0.5


def test_no_profile_has_no_sheet() -> None:
    assert profile_sheets(NO_PROFILES) == ()
