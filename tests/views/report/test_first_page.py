"""The first page: case, verdict, measurements, plan, what was not checked; and the contents."""

from __future__ import annotations

import io
import re
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
import synthetic_survey as survey
from html_page import Page
from PIL import Image

from uavgram.imaging.photos.preview import IDENTITY_TONE
from uavgram.imaging.top_view.mosaic import MOST_PX, GroundTexture, cut_ground
from uavgram.model.provenance import case_from_options
from uavgram.model.result.reliability import MeasurementStatus, Reason, Verdict
from uavgram.model.result.result import NO_PICTURES, Result
from uavgram.views.formatting import measurement_text, order_shapes_first
from uavgram.views.report import ground_extent, render_annex, render_report
from uavgram.views.report.first_page import (
    FEW_ROWS,
    MAX_NAMES,
    MAX_PLAN,
    MAX_ROWS,
    lay_out_brief,
)
from uavgram.views.survey.top_view import top_view

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
    rows = survey.build().measurements
    ok: MeasurementStatus = "ok"
    in_order = replace(
        survey.build(),
        measurements=replace(rows, status=(ok,) * len(rows.name)),
        line_checks=nothing.line_checks,
        point_checks=no_points.point_checks,
    )
    words = "The observations check one another by their agreement. No length and no point was"
    assert any(text.startswith(words) for text in lay_out_brief(in_order).limits)
    assert any(
        "within three times their uncertainty" in text
        for text in lay_out_brief(survey.build()).limits
    )


def test_more_measurements_than_fit_are_counted() -> None:
    told = lay_out_brief(survey.build())
    count = len(survey.build().measurements.name)

    assert len(told.rows) + told.more == count
    assert len(told.rows) <= MAX_ROWS + FEW_ROWS


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


# The ground below the report's plans.


SIZE_M = 0.1
WEST_M, NORTH_M = -80.0, 70.0


def texture() -> GroundTexture:
    """Its red counts metres east of the western side, its green metres south of the northern."""
    rows, columns = np.mgrid[:1400, :1600]
    rgb = np.dstack([columns * SIZE_M, rows * SIZE_M, np.full(rows.shape, 40.0)]).astype(np.uint8)
    covered = columns < 1200
    return GroundTexture(rgb, covered, WEST_M, NORTH_M, SIZE_M, IDENTITY_TONE)


def test_a_point_of_the_picture_is_where_it_is_on_the_ground() -> None:
    made = cut_ground(texture(), np.array([-31.0, -22.0]), np.array([17.0, 20.0]))
    assert made is not None
    shown = np.asarray(Image.open(io.BytesIO(made.jpeg)).convert("RGB")).astype(float)
    height, width = shown.shape[:2]
    row, column = height // 3, width // 4
    east = made.west_m + (column + 0.5) * made.width_m / width
    north = made.north_m - (row + 0.5) * made.height_m / height

    assert (made.west_m, made.north_m) == pytest.approx((-31.0, 20.0), abs=SIZE_M)
    assert max(shown.shape) <= MOST_PX
    assert shown[row, column, 0] == pytest.approx(east - WEST_M, abs=3)
    assert shown[row, column, 1] == pytest.approx(NORTH_M - north, abs=3)


def test_what_no_photo_shows_is_white_and_of_nothing_there_is_no_picture() -> None:
    made = cut_ground(texture(), np.array([0.0, 0.0]), np.array([79.0, 50.0]))
    assert made is not None
    shown = np.asarray(Image.open(io.BytesIO(made.jpeg)))

    assert shown[50, -20:].min() > 245
    assert cut_ground(texture(), np.array([45.0, 0.0]), np.array([79.0, 50.0])) is None


def test_the_backdrop_lies_where_the_drawing_has_its_corners() -> None:
    result = survey.build()
    corners = ground_extent(result)
    assert corners is not None
    ground = cut_ground(texture(), *corners)
    view = top_view(result, ground=ground, address="data:")
    assert ground is not None
    assert view is not None
    image = re.search('<image x="(.+?)" y="(.+?)" width="(.+?)"', view.drawing.__html__())
    assert image is not None
    x, y, width = map(float, image.groups())
    per_metre = view.drawing.bar / float(view.drawing.bar_text.split()[0])
    (dot,), point = view.drawing.find_shapes("points")[0], result.points.position_world_m[0]

    assert x == pytest.approx(dot[0] + (ground.west_m - point[0]) * per_metre, abs=0.01)
    assert y == pytest.approx(dot[1] - (ground.north_m - point[1]) * per_metre, abs=0.01)
    assert width == pytest.approx(ground.width_m * per_metre, abs=0.01)
    html = render_report(result, replace(NO_PICTURES, ground=ground))
    assert html.count("<image ") == 1
    assert "appear displaced away from the camera" in html
    assert '<section id="plan">' not in render_report(result)


def test_a_red_result_states_no_accuracy() -> None:
    result = survey.build()
    red = replace(result, verdict=Verdict(level="red", reasons=()))

    assert lay_out_brief(result).accuracy
    assert not lay_out_brief(red).accuracy


def test_what_is_true_of_all_measurements_does_not_list_them() -> None:
    result = survey.build(measures=(("a", "distance", ("P01", "P10"), "m"),) * 3)
    rows = replace(result.measurements, status=("doubtful",) * 3)

    told = lay_out_brief(replace(result, measurements=rows)).limits
    assert told[0].endswith("does not fit: all 3 measurements.")


def test_of_many_measurements_the_first_page_has_those_that_are_not_ok_and_the_least_certain() -> (
    None
):
    pairs = enumerate(pairwise(f"P{i:02d}" for i in range(30)))
    many = survey.build(measures=tuple((f"D{i}", "distance", pair, "m") for i, pair in pairs))
    sigma = np.full(29, 0.01)
    sigma[[20, 25]] = 5.0
    status: list[MeasurementStatus] = ["ok"] * 29
    status[28] = "not-checked"
    rows = replace(many.measurements, sigma=sigma, status=tuple(status))
    brief = lay_out_brief(replace(many, measurements=rows))

    assert len(brief.rows) == 10
    assert brief.more == 19
    assert {20, 25, 28} <= set(brief.rows)
    assert list(brief.rows) == sorted(brief.rows)


def test_the_plan_tells_of_how_many_measurements_it_names_the_least_certain() -> None:
    pairs = enumerate(pairwise(f"P{i:02d}" for i in range(30)))
    many = survey.build(measures=tuple((f"D{i}", "distance", pair, "m") for i, pair in pairs))

    assert "measured (of 29, the 12 least certain for their size are named)" in first_page(
        render_report(many)
    )
    assert "least certain for their size are named" not in render_report(survey.build())


def test_the_plan_has_a_page_of_its_own_where_the_first_one_is_full() -> None:
    pairs = enumerate(pairwise(f"P{i:02d}" for i in range(30)))
    many = survey.build(measures=tuple((f"D{i}", "distance", pair, "m") for i, pair in pairs))
    reason = Reason(cause="nothing-checks", text="Click these points once more. " * 60)
    full = replace(many, verdict=Verdict(level="amber", reasons=(reason,)))

    for result, has_own_page in ((survey.build(), False), (full, True)):
        html = render_report(result)
        assert html.count('<div class="own-page">') == has_own_page
        assert html.count("<header") == html.count("</header>")
        assert html.count("<div") == html.count("</div>")
        assert (lay_out_brief(result).plan_height > MAX_PLAN) == has_own_page
