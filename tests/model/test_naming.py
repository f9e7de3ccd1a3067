"""Numbers in plain sentences."""

from __future__ import annotations

import pytest

from uavgram.model.naming import format_digits, format_odds


@pytest.mark.parametrize(
    ("value", "digits", "sign", "text"),
    [
        (963.2, 2, "", "960"),
        (4510.0, 2, "", "4500"),
        (110.4, 2, "", "110"),
        (20.1, 1, "", "20"),
        (0.01234, 2, "", "0.012"),
        (0.0000123, 2, "", "0.000012"),
        (2.1e7, 2, "", "21000000"),
        (5.93, 2, "", "5.9"),
        (1234.5, 3, "+", "+1230"),
        (-4510.0, 2, "", "-4500"),
        (float("nan"), 2, "", "nan"),
        (float("inf"), 2, "", "inf"),
    ],
)
def test_a_number_has_its_digits_and_no_power_of_ten(
    value: float, digits: int, sign: str, text: str
) -> None:
    assert format_digits(value, digits, sign) == text


@pytest.mark.parametrize(
    ("probability", "text"),
    [(1e-30, "less than 1 in a million"), (3.1e-4, "1 in 3000"), (0.04, "1 in 25")],
)
def test_a_probability_is_one_of_so_many(probability: float, text: str) -> None:
    assert format_odds(probability) == text
