"""Measurements that other solutions would change are marked wherever they stand."""

from __future__ import annotations

import pytest
import synthetic_survey as survey
from html_page import Page
from unsure import unsure

from uavgram.model.result.result import Result
from uavgram.views.formatting import order_computed_first
from uavgram.views.recording.pages import measured_page
from uavgram.views.recording.scene import measure_scene
from uavgram.views.recording.world.labels import measured_text, survey_labels
from uavgram.views.report import render_annex, render_report
from uavgram.views.survey.key_facts import key_facts
from uavgram.views.survey.top_view import top_view
from uavgram.views.terminal import measurement_table

NAME, OTHERS = "skid left", "or 31.200, 44.900 m"


@pytest.fixture(scope="module")
def sure() -> Result:
    return survey.build()


@pytest.fixture(scope="module")
def marked(sure: Result) -> Result:
    """The most certain measurement of all, which other solutions change."""
    return unsure(sure, NAME, (31.2, 44.9))


def test_the_terminal_shows_the_other_values_beside_the_first_and_says_what_they_are(
    sure: Result, marked: Result
) -> None:
    header, _, missing, first, *rest, note = measurement_table(marked).splitlines()

    assert header.endswith("fits as well")
    assert "not computed" in missing
    assert first.startswith(NAME)
    assert first.endswith(OTHERS)
    assert not [line for line in rest if " or " in line]
    assert note.startswith('Values with "or" are not unique')
    assert " or " not in measurement_table(sure)
    assert "fits as well" not in measurement_table(sure)


def test_the_farther_the_other_values_the_earlier_the_row(marked: Result, sure: Result) -> None:
    near = unsure(sure, "road width", (6.4,)).measurements.alternative_values
    others = tuple(
        a or b for a, b in zip(near, marked.measurements.alternative_values, strict=True)
    )
    rows = unsure(sure, "", ()).measurements
    rows = type(rows)(**{**vars(rows), "alternative_values": others})

    assert [rows.name[i] for i in order_computed_first(rows)[:2]] == [NAME, "road width"]


def test_the_report_marks_the_row_and_says_what_that_means(sure: Result, marked: Result) -> None:
    page = render_annex(marked)
    rows = [row for row in Page(page).rows if len(row) == 9 and "not unique" in row[1]]

    assert [row[0] for row in rows] == [NAME]
    assert OTHERS in rows[0][3]
    assert "other solutions fit the observations as well" in page
    assert "not unique" not in render_annex(sure).lower()


def test_the_least_certain_length_is_that_one_with_its_other_values(marked: Result) -> None:
    assert dict(key_facts(marked))["least certain length for its size"].endswith(OTHERS)


def test_the_recording_marks_it_in_its_table_and_on_its_label(sure: Result, marked: Result) -> None:
    (row,) = [line for line in measured_page(marked).splitlines() if line.startswith(f"| {NAME}")]
    at = marked.measurements.name.index(NAME)
    labels, _ = survey_labels(marked, measure_scene(marked))

    assert OTHERS in row
    assert 'Values with "or" are not unique' in measured_page(marked)
    assert 'Values with "or"' not in measured_page(sure)
    assert measured_text(marked, at).endswith(f"{OTHERS} (doubtful)")
    assert [t for t in labels.words if t.startswith("NOT UNIQUE: ") and OTHERS in t]


def test_the_drawing_of_the_report_doubts_it() -> None:
    sure = survey.build(clean=True)
    marked = unsure(sure, NAME, (31.2, 44.9))
    doubted, trusted = top_view(marked), top_view(sure)
    assert doubted is not None
    assert trusted is not None
    said = {text.text for text in doubted.drawing.texts}

    assert [text for text in said if text.startswith(NAME) and text.endswith(" ?")]
    assert not [text.text for text in trusted.drawing.texts if text.text.endswith(" ?")]
    assert "a doubtful value" in render_report(marked)
    assert "a doubtful value" not in render_report(sure)
