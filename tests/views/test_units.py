"""Lengths, areas, volumes and speeds in the units of the project."""

from __future__ import annotations

import html
import json
import re
from collections.abc import Iterator
from dataclasses import replace
from fractions import Fraction
from pathlib import Path
from typing import Any

import ezdxf
import numpy as np
import pytest
import synthetic_survey as survey
from full_report import full
from hypothesis import given
from hypothesis import strategies as st
from recording_contents import Contents

from uavgram.io.results.results_json import load_results, write_results
from uavgram.model.naming import IMPERIAL, METRIC, Units, units_from_options
from uavgram.model.result.result import Result
from uavgram.pipeline.measure.exports import make_writers
from uavgram.views.recording import write_recording
from uavgram.views.report import render_annex, render_report
from uavgram.views.terminal import measurement_table
from uavgram.views.units import (
    convert_sentence,
    format_feet_inches,
    format_length,
    format_quantity,
    format_reading,
    format_sigma,
    format_value,
    format_values,
    round_bar,
    units_of,
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
        format_quantity(value, sigma, unit, NAMED[units])
        for value, sigma, unit in (case["value"] for case in CASES["quantities"])
    ]

    assert told == [case[units] for case in CASES["quantities"]]


@pytest.mark.parametrize(
    ("length_m", "units", "shown"),
    [
        (2.925, METRIC, "2.925 m"),
        (8.875, METRIC, "8.875 m"),
        (34.0, METRIC, "34.00 m"),
        (10.5 * 0.3048, FEET, "10.50 ft"),
        (43.235 * 0.3048, FEET, "43.235 ft"),
        (10.3 * 0.3048, METRIC, "3.14 m"),  # read in feet
        (3.2004, IMPERIAL, "10 ft 6 in"),
    ],
)
def test_a_reading_of_the_tape_is_shown_as_it_was_read(
    length_m: float, units: Units, shown: str
) -> None:
    assert format_reading(length_m, units) == shown


@given(
    value=st.floats(-500.0, 500.0),
    sigma=st.floats(0.0005, 0.5),
)
def test_feet_and_inches_are_rounded_by_less_than_their_sigma(value: float, sigma: float) -> None:
    told = format_value(value, sigma, "m", IMPERIAL)

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
    assert format_feet_inches(inches, step) == told


def test_values_of_one_unit_share_its_symbol_but_not_feet_and_inches() -> None:
    assert format_values((12.3, 12.4), 0.02, "m", METRIC, " to ") == "12.300 to 12.400 m"
    assert (
        format_values((12.3, 12.4), 0.02, "m", IMPERIAL, " to ") == "40 ft 4 1/2 in to 40 ft 8 in"
    )
    assert format_sigma(0.021, "m", IMPERIAL) == "0.83 in"
    assert format_sigma(0.5, "m/s", METRIC) == "1.8 km/h"


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


# A result in feet and inches: report, terminal, recording and drawing say no metres any more.


METRES = re.compile(r"\d\s(mm|cm|m|km|km/h|m/s|m²|m³)(?![\w²³/])|\[m\]|, m\b|\bcentimetres?\b")
IN_FEET = (("units.length", "ft-in"), ("units.speed", "mph"))


@pytest.fixture(scope="module")
def result() -> Result:
    metric = full(survey.build())
    made = metric.provenance
    return replace(metric, provenance=replace(made, options=(*made.options, *IN_FEET)))


def left_in(text: str) -> list[str]:
    """What of a text is metric, with what stands around it."""
    return [text[max(0, m.start() - 30) : m.end() + 20] for m in METRES.finditer(text)]


def test_the_report_is_in_feet_and_inches(result: Result) -> None:
    page = re.sub(
        r"<style>.*?</style>|<[^>]*>",
        " ",
        render_report(result) + render_annex(result),
        flags=re.DOTALL,
    )
    text = html.unescape(page)

    assert left_in(text) == []
    assert "[ft]" in text
    assert " in ± " in text
    assert " mph" in text


def test_known_lengths_are_read_as_on_the_tape(result: Result) -> None:
    page = html.unescape(re.sub(r"<[^>]*>", " ", render_report(result)))
    taped = format_length(float(result.lines.length_m[0]), IMPERIAL, 3)

    assert " ft " in taped
    assert f"{taped} ± " in page
    assert not re.search(r"(taped|found|difference) \[ft\]", page)


def test_ten_centimetres_of_relief_are_not_taken_for_a_length_of_the_survey(
    result: Result,
) -> None:
    lines = replace(result.lines, mdb_m=np.full(len(result.lines.name), 0.0955))
    page = render_annex(replace(result, lines=lines))

    assert "3.9 in of relief" in page
    assert "its points is 3.9 in higher" in page


def test_the_terminal_is_in_feet_and_inches(result: Result) -> None:
    lines = measurement_table(result).splitlines()

    assert left_in("\n".join(convert_sentence(line, IMPERIAL) for line in lines)) == []
    assert convert_sentence(lines[2], IMPERIAL) == lines[2]  # so that columns stay below each other


def test_the_recording_is_in_feet_and_inches(result: Result, tmp_path: Path) -> None:
    path = tmp_path / "recording.rrd"
    write_recording(result, (), lambda: None, path)
    contents = Contents(path)
    told = "\n".join(texts_of([contents.static, contents.by_frame]))

    assert left_in(told) == []
    assert " in ± " in told


def texts_of(value: Any) -> Iterator[str]:  # noqa: ANN401 (whatever a recording holds)
    if isinstance(value, str):
        yield value
    elif isinstance(value, dict):
        for one in value.values():
            yield from texts_of(one)
    elif isinstance(value, list | tuple):
        for one in value:
            yield from texts_of(one)


def test_a_drawing_has_texts_in_feet_and_lies_in_metres(result: Result, tmp_path: Path) -> None:
    path = tmp_path / "survey.dxf"
    make_writers(result)["survey_local.dxf"](path)
    document = ezdxf.readfile(path)  # type: ignore[attr-defined]  # not exported by its module
    space = document.modelspace()
    texts = [text.dxf.text for text in space.query("TEXT DIMENSION")]

    assert left_in("\n".join(texts)) == []
    assert any(" ft " in text and " in ± " in text for text in texts)
    assert document.units == ezdxf.units.M


def test_results_keep_their_units_and_their_metres(result: Result, tmp_path: Path) -> None:
    path = tmp_path / "results.json"
    write_results(result, path)
    read = load_results(path)

    assert units_of(read) == IMPERIAL
    assert read.measurements.value[0] == result.measurements.value[0]
