"""The verdict in words, and that no table can be read without it."""

from __future__ import annotations

import json
import math
from dataclasses import fields, replace

import numpy as np
import pytest
import synthetic_survey as survey
from html_page import Page
from unsure import unsure

from uavgram.io.exports.geojson_kml import dump_geojson
from uavgram.io.exports.measurements_csv import dump_measurements_csv
from uavgram.io.json_codec import decode, encode
from uavgram.model.message import Message, Remedy
from uavgram.model.naming import IMPERIAL, METRIC
from uavgram.model.result.reliability import MeasurementStatus, Reason, Verdict
from uavgram.model.result.result import Result
from uavgram.model.result.tables import FrameStatus, MeasurementResults
from uavgram.stages.products.map_layers import features_of
from uavgram.views.formatting import format_with_sigma, order_computed_first, order_worst_first
from uavgram.views.recording.labels import measured_text, survey_labels
from uavgram.views.recording.pages import measured_page
from uavgram.views.recording.scene import measure_scene
from uavgram.views.report import render_annex, render_report
from uavgram.views.survey.key_facts import key_facts
from uavgram.views.survey.top_view import top_view
from uavgram.views.survey.verdict import (
    STATUS_WORDS,
    describe_height,
    summarise_result,
    verdict_sentence,
    verdict_words,
)
from uavgram.views.terminal import findings_lines, measurement_table


def first_rows(table: MeasurementResults, count: int) -> MeasurementResults:
    """The first measurements of a table."""
    columns = {one.name: getattr(table, one.name)[:count] for one in fields(table)}
    correlation = table.correlation[:count, :count]
    return MeasurementResults(**columns | {"correlation": correlation})


SCALE = "The scale rests on your lengths (± 1 %); nothing else confirms it."


def test_a_survey_without_a_flaw_is_green_in_one_sentence() -> None:
    words = verdict_words(survey.build(clean=True))

    assert words.sentence == ("Verdict: green, in order: all 9 measurements fit and are checked.")
    assert words.reasons == ()
    assert words.counts.startswith("20 of 20 photos used, 4 of 5 known lengths used")


def test_two_measurements_are_both_in_order() -> None:
    made = survey.build(clean=True)
    two = verdict_words(replace(made, measurements=first_rows(made.measurements, 2)))

    assert two.sentence == (
        "Verdict: green, in order: skid left is 39.612 ± 0.021 m and skid right is 43.388 ± 0.034 "
        "m; both fit and are checked."
    )


def test_readings_that_are_checked_roughly_are_no_full_check() -> None:
    made = survey.build(clean=True)
    weak = replace(made.lines, mdb_m=np.full(len(made.lines.name), 0.2))

    assert verdict_words(replace(made, lines=weak)).sentence.endswith(
        ": all 9 measurements fit and are checked for large mistakes."
    )


def test_where_nothing_is_checked_the_headline_counts_none() -> None:
    made = survey.build(clean=True)
    status: MeasurementStatus = "not-checked"
    blind = replace(made.measurements, status=(status,) * len(made.measurements.name))
    amber = replace(made, measurements=blind, verdict=Verdict(level="amber"))

    assert summarise_result(amber) == "Check: none of the 9 measurements is checked."


def test_amber_does_not_claim_that_all_is_in_order() -> None:
    clean = survey.build(clean=True)
    amber = Verdict(level="amber", reasons=(Reason(cause="x", text="L1 was left out."),))

    assert verdict_sentence(replace(clean, verdict=amber)) == (
        "Verdict: amber, check this first: all 9 measurements are in order, something else is "
        "not. L1 was left out."
    )


def test_the_first_reason_is_told_and_how_many_more_there_are() -> None:
    assert verdict_sentence(survey.build()) == (
        "Verdict: amber, check this first: of 10 measurements, 9 are doubtful (skid left, skid "
        "right, road width and 6 more) and 1 is not computed (to the tree). "
        "Line 'R3 hedge' disagrees by 0.21 m (w = 13.5): read the tape again. "
        "(And 1 other reason.)"
    )


def test_the_verdict_says_plainly_what_is_wrong_and_what_would_put_it_right() -> None:
    swap, free = (Remedy(action="swap", words=words) for words in ("Swap A and B", "Free A"))
    reason = Reason(cause="x", text="At length.", plain="A and B seem swapped.", mend=swap)
    amber = Verdict(level="amber", reasons=(replace(reason, instead=(free,)),))

    assert verdict_sentence(replace(survey.build(), verdict=amber)) == (
        "Verdict: amber, check this first: of 10 measurements, 9 are doubtful (skid left, skid "
        "right, road width and 6 more) and 1 is not computed (to the tree). "
        "A and B seem swapped. To correct it: swap A and B, or free A."
    )
    # What is only not checked is no fault.
    missing = replace(reason, cause="nothing-checks", plain="Not checked: L1.")
    told = verdict_sentence(
        replace(survey.build(), verdict=Verdict(level="amber", reasons=(missing,)))
    )
    assert told.endswith("Not checked: L1. To check it: swap A and B.")


def test_of_several_possible_causes_the_verdict_advises_to_remove_none() -> None:
    either = tuple(Remedy(action="unpick", words=f"Remove {name}") for name in "AB")
    text = "One of these is wrong: A or B."
    reason = Reason(cause="x", text=text, plain="One does not fit.", instead=either)
    amber = Verdict(level="amber", reasons=(reason,))

    assert verdict_sentence(replace(survey.build(), verdict=amber)).endswith(
        f"not computed (to the tree). {text}"
    )


def test_red_says_not_to_use_the_numbers_whatever_the_reason() -> None:
    reason = Reason(cause="misfit", text="Picks and lengths contradict each other.")
    red = replace(survey.build(), verdict=Verdict(level="red", reasons=(reason,)))

    assert verdict_sentence(red).startswith("Verdict: red, do not use these numbers. Picks and")
    assert 'class="verdict red"' in render_report(red)


def test_up_to_three_values_are_given_with_their_statuses() -> None:
    made = survey.build(clean=True)
    rows = first_rows(made.measurements, 3)
    rows = replace(rows, status=("ok", "not-checked", "doubtful"))
    amber = replace(made, measurements=rows, verdict=Verdict(level="amber"))

    assert summarise_result(amber) == (
        "Check: skid left is 39.612 ± 0.021 m (ok), skid right is 43.388 ± 0.034 m (not checked) "
        "and road width is 6.310 ± 0.012 m (doubtful)."
    )


def test_the_only_measurement_is_given_with_what_is_missing() -> None:
    made = survey.build(clean=True)
    missing = Reason(
        cause="nothing-checks",
        text="'skid' is not checked: a wrong click would not be noticed. Click P1 again.",
        plain="Not checked: click P1 again.",
    )
    rows = replace(first_rows(made.measurements, 1), status=("not-checked",))
    amber = replace(made, measurements=rows, verdict=Verdict(level="amber", reasons=(missing,)))
    value = f"{rows.name[0]} is {format_with_sigma(rows.value[0], rows.sigma[0], rows.unit[0])}."

    assert summarise_result(amber) == f"Check: {value}"
    assert verdict_sentence(amber).endswith(f" {value} Not checked: click P1 again.")


def test_without_a_measurement_there_is_no_verdict_anywhere() -> None:
    made = survey.build(clean=True)
    none = replace(
        made,
        measurements=first_rows(made.measurements, 0),
        verdict=Verdict(level=None),
    )
    assert summarise_result(none) == "Nothing is measured yet"
    assert verdict_sentence(none) == "Verdict: none, as nothing is measured."
    assert verdict_words(none).level is None
    assert findings_lines(none, verbose=False)[-1] == "Verdict: none, as nothing is measured."
    assert decode(Verdict, encode(none.verdict)) == none.verdict
    assert encode(none.verdict)["level"] is None


@pytest.fixture(scope="module")
def mixed() -> Result:
    """A row of each status, and a scale that nothing bears out."""
    result = survey.build()
    words = tuple(STATUS_WORDS)
    status = tuple(words[i % len(words)] for i in range(len(result.measurements.name)))
    measurements = replace(result.measurements, status=status)
    messages = (*result.messages, Message("info", "scale-basis", SCALE))
    return replace(result, measurements=measurements, messages=messages)


def test_every_row_of_every_table_has_its_status(mixed: Result) -> None:
    rows = mixed.measurements
    table = measurement_table(mixed).splitlines()[2:]
    head, *cells = [line.split(",") for line in dump_measurements_csv(mixed).splitlines()]
    column = head.index("status")
    page = render_report(mixed)

    for name, status, value in zip(rows.name, rows.status, rows.value.tolist(), strict=True):
        words = "not computed" if math.isnan(value) else STATUS_WORDS[status]
        (line,) = [one for one in table if one.startswith(f"{name}  ")]
        assert line.endswith(words)
        assert [row[column] for row in cells if row[0] == name] == [status]
        assert f">{words}</td>" in page.split(f"<td>{name}</td>")[1].split("</tr>")[0]


def test_maps_tell_the_status_too(mixed: Result) -> None:
    rows = mixed.measurements
    wanted = dict(zip(rows.name, rows.status, strict=True))
    shapes = [one["properties"] for one in json.loads(dump_geojson(mixed))["features"]]
    assert {one["name"]: one["status"] for one in shapes if "kind" in one} == wanted
    layer = features_of(mixed, None).layer("measured_lines").attributes
    assert {name: wanted[str(name)] for name in layer["name"]} == dict(
        zip(layer["name"], layer["status"], strict=True)
    )


def test_the_scale_is_before_the_messages_and_the_verdict_once_at_the_end(mixed: Result) -> None:
    green = replace(mixed, verdict=Verdict(level="green"))
    lines = findings_lines(green, verbose=False)

    assert lines[:3] == ["", SCALE, ""]
    assert [k for k, line in enumerate(lines) if line.startswith("Verdict: ")] == [len(lines) - 1]
    assert SCALE in render_report(green).split("</header>")[0]


def test_the_height_by_lengths_alone_is_stated_beside_the_scale(mixed: Result) -> None:
    alone = replace(mixed, world=replace(mixed.world, gauge="plane"))

    assert verdict_words(alone).scale.startswith(
        f"{SCALE} By your lengths, the cameras were about 42 m "
    )
    assert verdict_words(mixed).scale == SCALE


# Measurements that other solutions would change are marked wherever they stand.


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

    worst = [rows.name[i] for i in order_worst_first(rows) if math.isfinite(rows.value[i])]
    assert worst[:2] == [NAME, "road width"]
    # Pages have the order of the project instead, as the page on which it was typed.
    known = [i for i, value in enumerate(rows.value.tolist()) if math.isfinite(value)]
    assert order_computed_first(rows).tolist()[: len(known)] == known


def test_the_report_marks_the_row_and_says_what_that_means(sure: Result, marked: Result) -> None:
    page = render_annex(marked)
    rows = [row for row in Page(page).rows if len(row) == 9 and "not unique" in row[1]]

    assert [row[0] for row in rows] == [NAME]
    assert OTHERS in rows[0][3]
    assert "other explanations of the observations give the other" in page
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


def test_the_height_of_the_cameras_shows_lengths_in_another_unit() -> None:
    result = survey.build(clean=True)
    assert describe_height(result, METRIC) == "Cameras about 42 m above the ground: is that right?"
    assert "about 138 feet above" in describe_height(result, IMPERIAL)
    seeded: FrameStatus = "seeded"
    unused = replace(result.frames, status=tuple(seeded for _ in result.frames.status))
    assert describe_height(replace(result, frames=unused), METRIC) == ""
