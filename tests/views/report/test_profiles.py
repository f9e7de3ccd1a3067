"""Profiles in the report, in profiles.csv and in results.json."""

from __future__ import annotations

import csv
import io
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import synthetic_survey as survey
from html_page import Page

from uavgram.io.exports.measurements_csv import dump_profiles_csv
from uavgram.io.results.results_json import dump_results, load_results
from uavgram.model.result.result import Result
from uavgram.model.result.tables import ProfileResults
from uavgram.pipeline.measure.exports import make_writers
from uavgram.views.report import render_annex, render_report
from uavgram.views.survey.profiles import BOTTOM, LEFT, MAX_HEIGHT, RIGHT, TOP, profile_drawings

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
    (line,) = drawing.named("line")
    across = drawing.width - LEFT - RIGHT
    np.testing.assert_allclose(line[:, 0], LEFT + across * np.array([0, 0.5, 1]), atol=0.05)
    steep = across / 10.0 * kerb.exaggeration
    np.testing.assert_allclose(line[:, 1] - line[0, 1], -steep * PLACE[:3, 2], atol=0.1)
    assert TOP <= line[:, 1].min() < line[:, 1].max() <= drawing.height - BOTTOM
    assert drawing.height <= TOP + MAX_HEIGHT + BOTTOM
    ((top, bottom),) = drawing.named("rulers")  # B alone is off the ground
    np.testing.assert_array_equal(top, line[1])
    assert bottom[1] - top[1] == pytest.approx(0.4 * steep)
    high, low = drawing.named("bars")[1]
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
