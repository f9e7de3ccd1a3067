"""Numbers in words."""

from __future__ import annotations

from dataclasses import replace
from typing import get_args

import numpy as np
import pytest
import synthetic_survey as survey

from uavgram.model.naming import METRIC
from uavgram.model.observations import MEASUREMENT_FORMS, MeasurementKind
from uavgram.views.formatting import (
    UNIT_WORDS,
    chance,
    format_relative_sigma,
    format_with_sigma,
    number,
    order_worst_first,
)
from uavgram.views.units import decimals, display_unit


@pytest.mark.parametrize(
    ("sigma", "unit", "places"),
    [
        (0.021, "m", 3),
        (0.0004, "m", 4),
        (3.2, "m", 2),
        (3.2, "m2", 1),
        (0.09, "deg", 3),
        (25, "m2", 0),
    ],
)
def test_a_value_shows_two_digits_of_its_sigma(sigma: float, unit: str, places: int) -> None:
    assert decimals(sigma, display_unit(unit, METRIC)) == places


def test_a_value_and_its_sigma_end_at_the_same_digit() -> None:
    assert format_with_sigma(12.34567, 0.0213, "m") == "12.346 ± 0.021 m"
    assert format_with_sigma(143.04, 0.912, "m2") == "143.04 ± 0.91 m²"


def test_what_cannot_be_computed_says_so() -> None:
    assert format_with_sigma(np.nan, np.nan, "m") == "not computed"
    assert number(np.nan) == "–"


def test_there_is_no_negative_zero() -> None:
    assert number(-0.0001, 2, signed=True) == "0.00"


def test_a_tiny_probability_is_not_shown_as_zero() -> None:
    assert chance(3e-7) == "< 0.001"
    assert chance(0.25) == "0.250"


def test_an_angle_has_no_relative_sigma() -> None:
    assert format_relative_sigma(87.0, 0.1, "deg") == "–"
    assert format_relative_sigma(-50.0, 0.1, "m") == "0.20 %"


def test_the_worst_measurement_comes_first_and_what_has_no_value_before_it() -> None:
    rows = survey.build().measurements
    order = [rows.name[i] for i in order_worst_first(rows)]

    assert order[:2] == ["to the tree", "patch"]  # 0.9 of 143 m² is 0.6 %: more than any length
    assert order[-1] == "skid left"  # 21 mm of 40 m


def test_every_kind_of_measurement_has_its_properties_and_a_unit_with_words() -> None:
    kinds = {*get_args(MeasurementKind)}
    assert {*MEASUREMENT_FORMS} == kinds
    assert {form.unit for form in MEASUREMENT_FORMS.values()} == {*UNIT_WORDS}


def test_a_coordinate_near_zero_is_not_the_worst_for_being_small() -> None:
    rows = survey.build().measurements
    order = [rows.name[i] for i in order_worst_first(rows)]

    assert order.index("road width") < order.index("rest position north")  # 12 mm of 6.3 m; 34 mm


def test_a_height_near_zero_is_not_the_worst_for_being_small() -> None:
    rows = survey.build().measurements
    kinds = tuple("height" if kind == "coordinate" else kind for kind in rows.kind)
    assert list(order_worst_first(replace(rows, kind=kinds))) == list(order_worst_first(rows))
