"""Heights over the ground in the report: the table of points, the plan, the method."""

from __future__ import annotations

import csv
import io
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import synthetic_survey as survey
from html_page import Page
from raised_survey import RAISED, raised
from uneven_ground import uneven

from uavgram.io.exports.measurements_csv import dump_profiles_csv
from uavgram.io.results.results_json import dump_results, load_results
from uavgram.model.result.result import Result
from uavgram.model.result.tables import HeightSource, ProfileResults
from uavgram.pipeline.measure.exports import make_writers
from uavgram.views.formatting import height_text
from uavgram.views.report import render_annex, render_report
from uavgram.views.survey.heights import BOTTOM, LEFT, MAX_HEIGHT, RIGHT, TOP, profile_drawings
from uavgram.views.survey.top_view import top_view

SIGMAS = "east, north, up, and their sigmas on the earth [m]"


def table(result: Result) -> tuple[list[str], dict[str, list[str]]]:
    """Head and rows of the table of points."""
    rows = Page(render_annex(result)).rows
    start = next(i for i, row in enumerate(rows) if row[:1] == ["label"])
    return rows[start], {row[0]: row for row in rows[start + 1 :] if len(row) == len(rows[start])}


def test_each_point_has_its_height_and_says_where_that_is_from() -> None:
    result = raised(survey.build())
    head, rows = table(result)
    told = {label: row[head.index("height over the ground")] for label, row in rows.items()}

    assert told["P00"] == "1.402 ± 0.021 mfound"
    assert told["P13"] == "0.500 mas stated"
    assert told["P16"] == "2.250 ± 0.040 mstated and adjusted"
    assert told["P26"] == "-0.800 ± 0.050 mfound"
    assert {told[label] for label in result.points.label if label not in RAISED} == {"on it"}


def test_coordinates_have_three_sigmas() -> None:
    result = raised(survey.build())
    head, rows = table(result)
    for k, label in enumerate(result.points.label):
        cell = rows[label][head.index(SIGMAS)]
        place, sigmas = cell.split("± ")
        wanted = np.sqrt(np.diag(result.points.covariance_m3[k]))
        np.testing.assert_allclose([float(x) for x in sigmas.split(", ")], wanted, atol=5.001e-4)
        np.testing.assert_allclose(
            [float(x) for x in place.split(", ")], result.points.position_world_m[k], atol=5.001e-4
        )


def test_rough_ground_has_sigmas_and_no_heights_and_a_plane_has_neither() -> None:
    rough, plane = table(uneven(survey.build()))[0], table(survey.build())[0]

    assert SIGMAS in rough
    assert "height over the ground" not in rough
    assert "east, north, up [m]" in plane
    assert "height over the ground" not in plane
    assert "Some points are off the ground" not in render_annex(survey.build())


def test_the_plan_marks_points_off_the_ground_and_writes_their_heights() -> None:
    result = raised(survey.build(lines=(), measures=()))
    view = top_view(result)
    assert view is not None
    rows = [k for k, label in enumerate(result.points.label) if label in RAISED]
    dots = np.concatenate(view.drawing.find_shapes("points"))
    middles = np.concatenate(view.drawing.find_shapes("off_ground"))

    np.testing.assert_array_equal(middles, dots[rows])
    assert np.ptp(middles[:, 0]) > 0
    written = {
        text.text: (text.x, text.y) for text in view.drawing.texts if text.kind == "off_ground"
    }
    assert set(written) == {"+1.402 m", "+0.50 m", "+2.250 m", "-0.800 m"}
    for row in rows:  # below its mark, where its nearer end is
        label, (x, y) = result.points.label[row], dots[row]
        at = next(place for text, place in written.items() if float(text[:-2]) == RAISED[label][0])
        assert 0 < at[1] - y < 20
        assert abs(at[0] - x) < 35  # half of its width
    assert "a point off the ground" in render_annex(result)


def test_the_plan_of_a_plane_has_no_such_marks() -> None:
    view = top_view(survey.build())
    assert view is not None
    assert not view.has_off_ground
    assert view.drawing.find_shapes("off_ground") == []
    assert "a point off the ground" not in render_annex(survey.build())


def test_the_method_tells_of_heights_where_there_are_some() -> None:
    with_heights, without = render_annex(raised(survey.build())), render_annex(survey.build())

    assert "The measured points of the ground were picked" in without
    assert "The measured points were picked" in with_heights
    assert "One that was left free is an unknown" in with_heights
    assert "One that was left free" not in without


@pytest.mark.parametrize(
    ("source", "sigma", "text"),
    [("ground", 0.0, "on it"), ("free", 0.25, "1.500 ± 0.250 m, found")],
)
def test_heights_in_words(source: HeightSource, sigma: float, text: str) -> None:
    assert height_text(1.5, sigma, source) == text


# Profiles in the report, in profiles.csv and in results.json.


PLACE = np.array([
    [0.0, 0.0, 0.0, 0.0], [5.0, -0.25, 0.5, 0.1], [10.0, 0.0, 0.2, 0.2],
    [0.0, 0.0, 0.0, 0.0], [2.0, 0.0, -1.0, -1.0],
])  # fmt: skip
SIGMA = np.array([
    [0.0, 0, 0, 0], [0.0123, 0.02, 0.03, 0.05], [0.01, 0, 0.02, 0.02],
    [0.0, 0, 0, 0], [0.01, 0, 0.02, 0.02],
])  # fmt: skip


@pytest.fixture(scope="module")
def result() -> Result:
    table = ProfileResults(
        profile=("kerb",) * 3 + ("<b>bank",) * 2,
        label=("A", "B", "C", "A", "=D"),
        place_m=PLACE,
        sigma_m=SIGMA,
    )
    return replace(survey.build(), profiles=table)


def test_a_drawing_is_to_scale(result: Result) -> None:
    kerb, bank = profile_drawings(result)
    assert [kerb.name, bank.name] == ["kerb", "<b>bank"]
    drawing = kerb.drawing
    (line,) = drawing.find_shapes("line")
    across = drawing.width - LEFT - RIGHT
    np.testing.assert_allclose(line[:, 0], LEFT + across * np.array([0, 0.5, 1]), atol=0.05)
    steep = across / 10.0 * kerb.exaggeration
    np.testing.assert_allclose(line[:, 1] - line[0, 1], -steep * PLACE[:3, 2], atol=0.1)
    assert TOP <= line[:, 1].min() < line[:, 1].max() <= drawing.height - BOTTOM
    assert drawing.height <= TOP + MAX_HEIGHT + BOTTOM
    ((top, bottom),) = drawing.find_shapes("rulers")  # B alone is off the ground
    np.testing.assert_array_equal(top, line[1])
    assert bottom[1] - top[1] == pytest.approx(0.4 * steep)
    high, low = drawing.find_shapes("bars")[1]
    assert low[1] - high[1] == pytest.approx(2 * 1.959964 * 0.03 * steep)
    assert [text.text for text in drawing.texts] == ["A", "B", "C"]
    assert drawing.bar == pytest.approx(float(drawing.bar_text.split()[0]) * across / 10.0)


def test_the_report_has_a_table_and_a_drawing_of_each_profile(result: Result) -> None:
    html, annex = render_report(result), render_annex(result)
    rows = {row[0]: row for row in Page(annex).rows if len(row) == 5}
    assert rows["B"][1:] == ["5.000 ± 0.012", "-0.250 ± 0.020", "0.500 ± 0.030", "0.100 ± 0.050"]
    assert rows["C"][1:3] == ["10.000 ± 0.010", "0.000"]
    assert html.count('aria-label="Profile ') == 2
    assert "<b>bank" not in html + annex
    assert "<h2>Profiles" not in render_report(survey.build()) + render_annex(survey.build())


def test_the_table_is_a_file_where_there_is_a_profile(result: Result) -> None:
    rows = list(csv.reader(io.StringIO(dump_profiles_csv(result))))
    assert rows[0][:4] == ["profile", "label", "station_m", "station_sigma_m"]
    assert rows[0][-2:] == ["ground_m", "ground_sigma_m"]
    assert rows[2][:6] == ["kerb", "B", "5.00000", "0.01230", "-0.25000", "0.02000"]
    assert rows[5][1] == "'=D"  # no spreadsheet takes it for a formula
    assert "profiles.csv" in make_writers(result)
    assert "profiles.csv" not in make_writers(survey.build())


def test_results_give_the_profiles_back(result: Result, tmp_path: Path) -> None:
    path = tmp_path / "results.json"
    path.write_text(dump_results(result), encoding="utf-8")
    again = load_results(path).profiles
    assert again.profile == result.profiles.profile
    assert again.label == result.profiles.label
    np.testing.assert_array_equal(again.place_m, PLACE)
    np.testing.assert_array_equal(again.sigma_m, SIGMA)


def test_the_method_says_what_a_volume_is_where_one_is_measured(result: Result) -> None:
    rows = result.measurements
    volumes = replace(rows, kind=("volume", *rows.kind[1:]))
    assert "A volume lies between" in render_annex(replace(result, measurements=volumes))
    assert "A volume lies between" not in render_annex(result)
