"""The sheet for the field: what it says, on how many pages, in whose units."""

from __future__ import annotations

import dataclasses
import html as escaping
import io
import re
from typing import Any

import numpy as np
import pytest
from planned_sample import bare_plan, none_of, sample_plan

from uavgram.errors import UavgramError
from uavgram.model.maps import Paper
from uavgram.model.naming import Units
from uavgram.model.planned import FlightPlanned
from uavgram.views.field_sheet import field_sheet, field_sheet_pdf
from uavgram.views.flight_plan import (
    describe_accuracy,
    describe_alternatives,
    flight_facts,
    summarise_work,
    unchecked_lines,
)

PLAN = sample_plan()
PAGE = field_sheet(PLAN)


def text_of(page: str) -> str:
    """What a reader sees, without style and tags."""
    body = re.sub(r"<style>.*?</style>", " ", page, flags=re.DOTALL)
    return re.sub(r"\s+", " ", escaping.unescape(re.sub(r"<[^>]+>", " ", body)))


def without(planned: FlightPlanned, **changes: object) -> FlightPlanned:
    return dataclasses.replace(planned, **changes)  # type: ignore[arg-type]


def test_the_nose_points_from_0_to_359_degrees() -> None:
    for heading, said in (
        ([359.9, 0.1, 359.8, 0.0, 0.2, 359.9], "0° from north"),
        ([152.0] * 6, "152° from north"),
        ([0.0, 0.0, 0.0, 180.0, 180.0, 180.0], "turns: see each photo"),
    ):
        frames = dataclasses.replace(PLAN.frames, heading_deg=np.array(heading))
        assert dict(flight_facts(without(PLAN, frames=frames)))["Nose"] == said


def test_the_first_sentence_says_what_to_do() -> None:
    assert summarise_work(PLAN) == (
        "Lay and tape 5 lines, then take 6 photos from 40 m above the ground."
    )
    bare = without(PLAN, lines=none_of(PLAN.lines))
    assert summarise_work(bare) == "Take 6 photos from 40 m above the ground."


def test_what_is_not_good_enough_is_named() -> None:
    assert (
        describe_accuracy(PLAN)[0]
        == "Not as good as you wish, even if all goes well: impact <to> kerb."
    )
    better = dataclasses.replace(PLAN.measurements, sigma=PLAN.measurements.sigma / 2)
    assert describe_accuracy(without(PLAN, measurements=better))[0].startswith(
        "Everything will be as good"
    )
    assert len(describe_accuracy(without(PLAN, measurements=none_of(PLAN.measurements)))) == 1


def test_a_line_that_nothing_replaces_and_one_that_nothing_checks() -> None:
    told = " ".join(describe_alternatives(PLAN))
    assert "Without L5 the survey has no scale" in told
    assert "L3 matters most: without it, expect ± 1.9 cm" in told
    assert unchecked_lines(PLAN) == ("L4",)
    shown = text_of(PAGE)
    assert "L4 above all, as nothing else checks its reading" in shown
    assert "never: tape it twice" in shown


def test_everything_to_lay_and_to_measure_is_in_the_tables() -> None:
    shown = text_of(PAGE)
    for name in (*PLAN.lines.name, *PLAN.lines.start_label, *PLAN.measurements.name):
        assert name in shown
    assert "1.2 m from corner 1 towards corner 2, then 1.2 m inwards" in shown
    assert shown.count(" NO ") == 1
    assert "-33.856973, 151.215149" in shown


def test_names_that_people_wrote_are_no_markup() -> None:
    assert "<to>" not in PAGE
    assert "impact &lt;to&gt; kerb" in PAGE


@pytest.mark.parametrize("length", ["ft", "ft-in"])
def test_in_feet_nothing_is_said_in_metres(length: Any) -> None:  # noqa: ANN401
    shown = text_of(field_sheet(PLAN, Units(length=length, speed="mph")))
    assert not re.search(r"\d (m|cm|mm|km/h|m/s)\b", shown)
    assert "131 ft above the ground" in shown
    assert re.search(r"L1 46.6 ft|L1 46 ft 7 in", shown)


def test_a_plan_of_photos_alone_has_a_sheet() -> None:
    shown = text_of(field_sheet(bare_plan()))
    assert "1. Fly" in shown
    for absent in ("tape", "keep out", "nan", "None"):
        assert absent not in shown


@pytest.mark.parametrize(("paper", "size"), [("a4", (595.28, 841.89)), ("letter", (612.0, 792.0))])
def test_it_is_two_pages_of_paper(paper: Paper, size: tuple[float, float]) -> None:
    pikepdf = pytest.importorskip("pikepdf", reason="pikepdf is not installed")
    try:
        made = field_sheet_pdf(PAGE, paper)
    except UavgramError as fault:
        pytest.skip(str(fault))
    pages = pikepdf.open(io.BytesIO(made)).pages
    assert len(pages) == 2
    assert [float(edge) for edge in pages[0].mediabox][2:] == pytest.approx(size, abs=0.01)
