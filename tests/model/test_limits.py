"""A decimal comma is taken where it can mean nothing else, and asked about where it can."""

from __future__ import annotations

import pytest

from uavgram.model.limits import (
    comma_question,
    find_date_fault,
    find_value_fault,
    has_decimal_comma,
    number_hint,
    replace_decimal_comma,
)


@pytest.mark.parametrize(
    ("typed", "meant"),
    [
        ("1,5", "1.5"),
        ("-0,010", "-0.010"),
        ("0,125", "0.125"),
        (",5", ".5"),
        ("12,0015", "12.0015"),
        ("1234,567", "1234.567"),
        ("1,500e2", "1.500e2"),
    ],
)
def test_a_comma_that_can_only_be_decimal_is_one(typed: str, meant: str) -> None:
    assert has_decimal_comma(typed)
    assert replace_decimal_comma(typed) == meant
    assert comma_question(typed) == ""


@pytest.mark.parametrize("typed", ["12,001", "1,234", "-999,999"])
def test_what_may_be_thousands_is_asked_about(typed: str) -> None:
    assert replace_decimal_comma(typed) == typed
    assert typed.replace(",", ".") in comma_question(typed)
    assert typed.replace(",", "") in comma_question(typed)


@pytest.mark.parametrize("typed", ["1.5", "a,b", "1,2,3", "1.234,5", "1,234.5", "1,", "", "1,5 m"])
def test_other_text_stays_as_it_is(typed: str) -> None:
    assert replace_decimal_comma(typed) == typed
    assert comma_question(typed) == ""


@pytest.mark.parametrize(
    ("typed", "way"),
    [
        ("NaN", "write a number, such as 12.5"),
        ("9' 7\"", "write it in metres, 2.921 "),
        ("13 ft 2.5 in", "write it in metres, 4.0259 "),
        ("3 inches", "write it in metres, 0.0762 "),
        ("13.2 px", "write the number alone"),
    ],
)
def test_what_is_no_number_is_answered_with_the_way_to_write_it(typed: str, way: str) -> None:
    assert way in number_hint(typed, "the column")


@pytest.mark.parametrize(
    "text",
    [
        "",
        "28.02.2026",
        "29.02.",
        "2024-02-29",
        "02/28/2026",
        "12 March 2026",
        "1.3.26",
        "3/2026",
        "24/7",
    ],
)
def test_dates_and_other_texts_have_no_fault(text: str) -> None:
    assert find_date_fault(text) == ""


@pytest.mark.parametrize("text", ["31.02.", "31.02.2026", "2026-02-31", "02/31/2026", "29.02.2026"])
def test_a_date_that_does_not_exist_is_named(text: str) -> None:
    assert find_date_fault(text) == f"there is no such date as {text}: check day and month"


@pytest.mark.parametrize("text", ["gestern", "Monday", "?"])
def test_a_text_without_a_number_is_no_date(text: str) -> None:
    assert find_date_fault(text).startswith(f"{text} is no date: write day, month and year")


def test_a_tape_is_not_read_to_metres() -> None:
    assert find_value_fault("reading_sigma_m", 5.0) == "must lie between 0.000001 and 1"
    assert find_value_fault("reading_sigma_m", 0.5) == ""
    assert find_value_fault("sigma_m", 5.0) == ""  # of a distance that was paced
