"""The first page: case, verdict, measurements, plan, what was not checked; and the contents."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest
import synthetic_survey as survey
from html_page import Page

from uavgram.model.provenance import case_from_options
from uavgram.model.result.reliability import MeasurementStatus
from uavgram.model.result.result import Result
from uavgram.views.formatting import measurement_text, order_shapes_first
from uavgram.views.report import render_annex, render_report
from uavgram.views.report.brief import (
    MAX_NAMES,
    MAX_PLAN,
    MAX_ROWS,
    MIN_PLAN,
    ROW_MM,
    UNIT_MM,
    Brief,
    lay_out_brief,
)

CASE = (
    ("case.number", "AZ 12/26"),
    ("case.title", ""),
    ("case.place", "Bridge <north>"),
    ("case.more.Road width", "wall 4 m"),
    ("units.length", "ft"),
)


def with_case() -> Result:
    made = survey.build()
    return replace(made, provenance=replace(made.provenance, options=CASE))


def first_page(html: str) -> str:
    return html[html.index('<header class="brief">') : html.index("</header>")]


def test_the_case_is_as_it_was_written_and_empty_fields_are_left_out() -> None:
    told = (("Case number", "AZ 12/26"), ("Place", "Bridge <north>"), ("Road width", "wall 4 m"))

    assert case_from_options(CASE) == told
    rows = [tuple(row) for row in Page(first_page(render_report(with_case())) + "</header>").rows]
    assert rows[:3] == list(told)


def test_the_first_page_has_the_verdict_the_values_and_a_plan() -> None:
    made = survey.build()
    html = first_page(render_report(made))
    first = measurement_text(made.measurements, lay_out_brief(made).rows[0])

    assert re.findall(r'class="(verdict \w+|short|drawing)"', html) == [
        "verdict amber",
        "short",
        "drawing",
    ]
    assert f"<td>{first.name}</td>" in html
    assert first.value in html


@pytest.mark.parametrize("status", ["not-checked", "doubtful", "contradicted"])
def test_what_was_not_checked_or_does_not_fit_is_named(status: MeasurementStatus) -> None:
    made = survey.build()
    rows = made.measurements
    changed = replace(made, measurements=replace(rows, status=(status,) * len(rows.name)))
    words = {
        "not-checked": "No check would detect an error in: ",
        "doubtful": "Doubtful, as an observation on which they depend does not fit: ",
        "contradicted": "Contradicted, and not to be used: ",
    }[status]
    (told,) = [text for text in lay_out_brief(changed).limits if text.startswith(words)]

    assert told.startswith(f"{words}{rows.name[0]}, ")
    computed = int(np.isfinite(rows.value).sum())
    assert told.endswith(f" and {computed - MAX_NAMES} more.")


def test_without_a_check_it_says_so() -> None:
    nothing = survey.build(lines=(), measures=())
    no_points = replace(
        nothing, point_checks=survey.build(lines=(), measures=(), point_count=0).point_checks
    )

    assert any("was withheld" in text for text in lay_out_brief(no_points).limits)
    assert any(
        "within three times their uncertainty" in text
        for text in lay_out_brief(survey.build()).limits
    )


def test_more_measurements_than_fit_are_counted() -> None:
    told = lay_out_brief(survey.build())
    count = len(survey.build().measurements.name)

    assert len(told.rows) + told.more == count
    assert len(told.rows) <= MAX_ROWS


def test_the_contents_of_the_annex_are_its_headings_in_their_order() -> None:
    html = render_annex(survey.build())
    listed = re.findall(r'<li><a href="#([\w-]+)">(.*?)</a>', html)
    headings = re.findall(r'<section id="([\w-]+)">\s*<h2>(.*?)</h2>', html)

    assert listed == headings
    assert ("custody", "Chain of custody") in listed


def test_places_on_the_earth_stand_behind_lengths_however_uncertain() -> None:
    made = survey.build()
    rows = made.measurements
    kinds = ("coordinate", *rows.kind[1:])
    placed = replace(made, measurements=replace(rows, kind=kinds))
    order = order_shapes_first(placed.measurements)

    shapes = [i for i in order_shapes_first(rows) if kinds[i] != "coordinate"]

    assert 0 in order[len(shapes) :]
    assert list(order[: len(shapes)]) == shapes
    assert sorted(order) == list(range(len(kinds)))


@pytest.mark.parametrize("words", [4, 60, 200])
def test_the_more_is_told_the_lower_the_plan(words: int) -> None:
    made = survey.build()
    named = replace(made, name=" ".join(["crossing"] * words))
    low, high = lay_out_brief(named), lay_out_brief(made)

    def taken_mm(told: Brief) -> float:
        return ROW_MM * len(told.rows) + UNIT_MM * told.plan_height

    assert MIN_PLAN <= low.plan_height <= MAX_PLAN
    assert len(low.rows) <= len(high.rows)
    assert taken_mm(low) <= taken_mm(high)
