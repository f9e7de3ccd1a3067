"""Lengths that were rounded to decimetres are uncertain by the rounding, and by no more."""

from __future__ import annotations

import numpy as np
import pytest

from uavgram.model.arrays import Floats
from uavgram.model.observations import KnownLines
from uavgram.stages.assemble import apply_reading_step, find_reading_step

TRUE_M = np.array([4.437, 11.164, 7.918, 19.352, 9.183, 15.046])


def lines(length_m: Floats, sigma_m: float = 0.01) -> KnownLines:
    n = len(length_m)
    return KnownLines(
        name=tuple(f"L{k}" for k in range(n)),
        start=tuple(f"A{k}" for k in range(n)),
        end=tuple(f"B{k}" for k in range(n)),
        length_m=length_m,
        sigma_m=np.full(n, sigma_m),
        adjust=np.ones(n, dtype=bool),
    )


@pytest.mark.parametrize("step", [0.1, 0.05])
def test_the_sigma_of_rounded_lengths_contains_the_rounding(step: float) -> None:
    rounded = np.round(TRUE_M / step) * step
    found, messages = apply_reading_step(lines(rounded, 0.01))

    # The variance of a uniform distribution of this width, and what was stated.
    np.testing.assert_allclose(found.sigma_m**2, step**2 / 12 + 0.01**2)
    assert [one.code for one in messages] == ["lengths-rounded"]


def test_what_is_stated_as_wide_as_the_rounding_stays() -> None:
    given = lines(np.round(TRUE_M, 1), 0.03)
    assert apply_reading_step(given) == (given, ())


@pytest.mark.parametrize("decimals", [2, 3])
def test_readings_to_the_centimetre_stay(decimals: int) -> None:
    assert find_reading_step(np.round(TRUE_M, decimals)) == 0.0


def test_few_lengths_are_multiples_of_a_decimetre_by_chance() -> None:
    assert find_reading_step(np.array([4.4, 11.2])) == 0.0
    assert find_reading_step(np.array([4.4, 11.2, 4.4])) == 0.0  # one of them was read twice
    assert find_reading_step(np.array([4.4, 11.2, 7.9])) == 0.1
    assert find_reading_step(np.array([])) == 0.0


def test_readings_to_the_centimetre_are_rarely_taken_for_rounded() -> None:
    rng = np.random.default_rng(7)
    draws = np.round(rng.uniform(2, 25, (20_000, 3)), 2)
    # In one set of a thousand all three are multiples of 0.1 m by chance; of 0.05 m it takes more.
    assert np.mean([find_reading_step(one) > 0 for one in draws]) < 0.002
