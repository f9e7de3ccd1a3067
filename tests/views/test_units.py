"""Lengths, areas, volumes and speeds in the units of the project."""

from __future__ import annotations

import json
from fractions import Fraction
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from uavgram.model.naming import IMPERIAL, METRIC, Units, units_from_options
from uavgram.views.sentence_units import convert_sentence
from uavgram.views.units import (
    feet_inches,
    quantity,
    round_bar,
    spread_text,
    value_text,
    values,
)

FEET = Units(length="ft", speed="mph")
NAMED = {"metric": METRIC, "ft": FEET, "ft-in": IMPERIAL, "m/s": Units(speed="m/s")}
CASES = json.loads(
    (Path(__file__).parents[1] / "support" / "unit_cases.json").read_text(encoding="utf-8")
)
INCH_M = 0.0254


@pytest.mark.parametrize("units", NAMED)
def test_numbers_are_written_as_the_page_writes_them(units: str) -> None:
    told = [
        quantity(value, sigma, unit, NAMED[units])
        for value, sigma, unit in (case["value"] for case in CASES["quantities"])
    ]

    assert told == [case[units] for case in CASES["quantities"]]


@given(
    value=st.floats(-500.0, 500.0),
    sigma=st.floats(0.0005, 0.5),
)
def test_feet_and_inches_are_rounded_by_less_than_their_sigma(value: float, sigma: float) -> None:
    told = value_text(value, sigma, "m", IMPERIAL)

    assert abs(inches_of(told) * INCH_M - value) < max(sigma, INCH_M / 32 + 1e-9)


def inches_of(text: str) -> float:
    """``-40 ft 6 1/8 in`` as inches."""
    inches, words = Fraction(0), text.lstrip("-").split()
    before = Fraction(0)
    for word in words:
        if word == "ft":
            inches, before = inches + 12 * before, Fraction(0)
        elif word == "in":
            inches, before = inches + before, Fraction(0)
        else:
            before += Fraction(word)
    return float(-inches if text.startswith("-") else inches)


@pytest.mark.parametrize(
    ("inches", "step", "told"),
    [
        (486.125, 1 / 8, "40 ft 6 1/8 in"),
        (11.99, 1 / 8, "1 ft 0 in"),
        (23.97, 1 / 16, "2 ft 0 in"),
        (0.5, 1 / 16, "1/2 in"),
        (-38.25, 1 / 4, "-3 ft 2 1/4 in"),
        (-0.001, 1 / 4, "0 in"),
        (493.0, 12.0, "41 ft"),
    ],
)
def test_inches_carry_over_into_feet(inches: float, step: float, told: str) -> None:
    assert feet_inches(inches, step) == told


def test_values_of_one_unit_share_its_symbol_but_not_feet_and_inches() -> None:
    assert values((12.3, 12.4), 0.02, "m", METRIC, " to ") == "12.300 to 12.400 m"
    assert values((12.3, 12.4), 0.02, "m", IMPERIAL, " to ") == "40 ft 4 1/2 in to 40 ft 8 in"
    assert spread_text(0.021, "m", IMPERIAL) == "0.83 in"
    assert spread_text(0.5, "m/s", METRIC) == "1.8 km/h"


def test_scale_bars_are_round_in_the_unit_that_they_name() -> None:
    assert round_bar(12.0, METRIC) == (10.0, "10 m")
    length_m, words = round_bar(12.0, IMPERIAL)
    assert (round(length_m, 6), words) == (6.096, "20 ft")
    assert round_bar(0.06, METRIC) == (0.05, "5 cm")
    assert round_bar(0.06, IMPERIAL)[1] == "2 in"


def test_options_without_units_are_metric_and_a_result_keeps_them() -> None:
    assert units_from_options((("name", "x"),)) == METRIC
    assert units_from_options((("units.length", "ft"), ("units.speed", "m/s"))) == Units(
        length="ft", speed="m/s"
    )


@pytest.mark.parametrize(
    ("text", "feet", "inches"),
    [
        ("It stands 1.40 m up.", "It stands 4.59 ft up.", "It stands 4 ft 7 in up."),
        ("off by 3.2 cm", "off by 0.105 ft", "off by 1.26 in"),
        ("12 mm", "0.039 ft", "0.47 in"),
        ("12.345 ± 0.012 m", "40.502 ± 0.039 ft", "40 ft 6 in ± 0.47 in"),
        ("12.345 m +- 0.012 m", "40.502 ft +- 0.039 ft", "40 ft 6 in +- 0.47 in"),
        ("E 12.3 m N -4.5 m", "E 40.4 ft N -14.8 ft", "E 40 ft 4 in N -14 ft 9 in"),
        ("3.0 cm × 2.2 cm", "0.098 ft × 0.072 ft", "1.18 in × 0.87 in"),
        ("or 31.25, 44.91 m", "or 102.53, 147.34 ft", "or 102 ft 6 1/4 in, 147 ft 4 in"),
        (
            "in photos 3 and 5.2 m off",
            "in photos 3 and 17.1 ft off",
            "in photos 3 and 17 ft 1 in off",
        ),
        ("143.0 ± 0.9 m²", "1539.2 ± 9.7 ft²", "1539.2 ± 9.7 ft²"),
        ("20 x 30 m", "66 x 98 ft", "66 ft x 98 ft"),
        ("50.1 km/h", "31.13 mph", "31.13 mph"),
        ("13.9 m/s", "31.1 mph", "31.1 mph"),
        ("7.5 km from here", "4.66 mi from here", "4.66 mi from here"),
    ],
)
def test_a_sentence_is_told_in_other_units(text: str, feet: str, inches: str) -> None:
    assert convert_sentence(text, FEET) == feet
    assert convert_sentence(text, IMPERIAL) == inches


@pytest.mark.parametrize(
    "text",
    [
        "the line 'wall 4 m' and \"5 m\" and `6 m`",
        "photos/3 m/IMG 4 m.jpg",
        "accelerates by 2.5 m/s²",
        "an ordinary drone camera of 24 mm (35 mm equivalent)",
        "w 3.1, 2 min, 5 px, 0.3 s, 12 deg, 4.2 %",
        "P5 m, M 7 mm3",
        "R1-4 m",
    ],
)
def test_what_is_no_length_stays(text: str) -> None:
    assert convert_sentence(text, IMPERIAL) == text


def test_names_that_look_like_lengths_stay_where_they_are_known() -> None:
    text = "wall 4.10 m: 4.12 m found"

    assert convert_sentence(text, FEET, ("wall 4.10 m",)) == "wall 4.10 m: 13.52 ft found"


@given(st.text(alphabet="0123456789.,±+- abmckhs/²'\"to", max_size=40))
def test_metres_stay_metres_and_what_was_told_is_not_told_again(text: str) -> None:
    metric = Units(speed="m/s")
    once = convert_sentence(text, IMPERIAL)

    assert convert_sentence(text, metric) == text or "km/h" in text
    assert convert_sentence(once, IMPERIAL) == once


@given(st.floats(0.01, 5000.0), st.integers(0, 3))
def test_a_length_told_in_feet_is_the_same_length(metres: float, places: int) -> None:
    text = f"{metres:.{places}f} m"
    told, unit = convert_sentence(text, FEET).split()

    assert unit == "ft"
    assert abs(float(told) * 0.3048 - float(text.split(maxsplit=1)[0])) <= 0.51 * 10.0**-places
