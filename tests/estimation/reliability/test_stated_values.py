"""Explanation of wrong values in words, by the factor of the mistake."""

from __future__ import annotations

import numpy as np
import pytest

from uavgram.estimation.reliability.stated_values import (
    describe_displacement,
    explain_coordinates,
    explain_ratio,
)


@pytest.mark.parametrize(
    ("ratio", "words"),
    [
        (1000.0, "in millimetres"),
        (100.0, "in centimetres"),
        (1 / 0.3048, "in feet"),
        (1 / 0.0254, "in inches"),
        (0.001, "in kilometres"),
        (10.0, "the decimal point one place off"),
        (0.1, "the decimal point one place off"),
        (0.01, "the decimal point two places off"),
        (0.3048, "turned from feet into metres twice"),
    ],
)
def test_a_ratio_of_units_is_named_if_it_is_near_enough(ratio: float, words: str) -> None:
    assert explain_ratio(ratio, 0.0) == words
    assert explain_ratio(1.009 * ratio, 0.001) == words
    assert explain_ratio(1.05 * ratio, 0.02) == words
    assert explain_ratio(1.05 * ratio, 0.01) == ""
    assert explain_ratio(1.3 * ratio, 1.0) == ""


def test_another_ratio_has_no_name() -> None:
    assert explain_ratio(2.3, 0.01) == ""
    assert explain_ratio(1.0, 0.01) == ""


def test_where_coordinates_lie_is_told_by_distance_sigma_and_side() -> None:
    sigma = np.array([0.02, 0.03, 0.05])
    text = describe_displacement(np.array([-26.1, 3.0, 0.0]), sigma)
    assert text == "26.27 m (± 0.02 m) from where it was found, mostly to the west"
    assert describe_displacement(np.array([0.0, 0.0, 4.0]), sigma).endswith("mostly above")
    unsure = describe_displacement(np.array([0.0, 0.0, 4000.0]), 1e5 * sigma)
    assert unsure.startswith("4000 m (± 5000 m) from")
    assert describe_displacement(np.array([5.0, 5.0, 5.0]), sigma).endswith("to no one side")
    assert describe_displacement(np.array([0.0, 2e6, 0.0]), sigma).startswith(
        "2000 km (± 0.03 m) from"
    )
    assert explain_coordinates(np.array([0.0, 2e6, 0.0]), np.zeros(3))
    assert not explain_coordinates(np.array([0.0, 200.0, 0.0]), np.zeros(3))


def test_exchanged_coordinates_are_named_by_the_other_point() -> None:
    every = {"A": np.array([3.0, 8.0, 0.0]), "B": np.array([30.0, 9.0, 0.0])}
    found = every["B"] + [0.02, 0.01, 0.0]
    assert "'B'" in explain_coordinates(every["A"], found, every)
    assert not explain_coordinates(every["A"], found + 5.0, every)
