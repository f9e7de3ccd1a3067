"""A result in feet and inches: report, terminal, recording and drawing say no metres any more."""

from __future__ import annotations

import html
import re
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import ezdxf
import numpy as np
import pytest
import synthetic_survey as survey
from full_report import full
from recording_contents import Contents

from uavgram.io.results.results_json import load_results, write_results
from uavgram.model.naming import IMPERIAL
from uavgram.model.result.result import Result
from uavgram.pipeline.measure.exports import make_writers
from uavgram.views.recording import write_recording
from uavgram.views.report import render_annex, render_report
from uavgram.views.sentence_units import convert_sentence
from uavgram.views.terminal import measurement_table
from uavgram.views.units import units_of

METRIC = re.compile(r"\d\s(mm|cm|m|km|km/h|m/s|m²|m³)(?![\w²³/])|\[m\]|, m\b|\bcentimetres?\b")
IN_FEET = (("units.length", "ft-in"), ("units.speed", "mph"))


@pytest.fixture(scope="module")
def result() -> Result:
    metric = full(survey.build())
    made = metric.provenance
    return replace(metric, provenance=replace(made, options=(*made.options, *IN_FEET)))


def left_in(text: str) -> list[str]:
    """What of a text is metric, with what stands around it."""
    return [text[max(0, m.start() - 30) : m.end() + 20] for m in METRIC.finditer(text)]


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
