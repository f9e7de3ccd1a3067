"""Numbers in plain sentences."""

from __future__ import annotations

import pytest

from uavgram.model.naming import format_digits


@pytest.mark.parametrize(
    ("value", "digits", "sign", "text"),
    [
        (963.2, 2, "", "960"),
        (4510.0, 2, "", "4500"),
        (110.4, 2, "", "110"),
        (20.1, 1, "", "20"),
        (0.01234, 2, "", "0.012"),
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
