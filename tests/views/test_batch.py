"""batch.html and the tables: everything is named, nothing is run, the map is true."""

import math
import re
from dataclasses import replace
from pathlib import Path

import pytest
from csv_rows import read_rows
from pyarrow import parquet
from pyproj import Geod

from uavgram.io.exports.batch_tables import write_batch_csv, write_batch_parquet
from uavgram.model.batch import Batch, Fit, ParameterUpdate, SurveyRow
from uavgram.stages.pooled_statistics import find_camera_drifts, pool_fits
from uavgram.views.batch import batch_map, render_batch_page, summarise_batch

ROWS = (
    SurveyRow(
        name="<b>=1+1</b>",
        project="/s/a/project.yaml",
        status="done",
        level="green",
        sentence="Verdict: green, in order. Everything fits.",
        latitude_deg=52.1,
        longitude_deg=4.9,
        camera="=cmd",
        mean_sigma_m=0.0123456789,
        worst_w=-2.0,
        warnings=("clock-receive",),
        output="/s/a/out put",
        fits=(Fit(kind="checks", squares=90.0, freedom=10.0),),
        seen=(ParameterUpdate(name="fx", stated=2.0, stated_sigma=3.0, value=1.0, sigma=0.5),),
    ),
    SurveyRow(
        name="b",
        project="/s/b/project.yaml",
        status="unchanged",
        level="amber",
        latitude_deg=52.3,
        longitude_deg=5.4,
        output="/s/b/out",
    ),
    SurveyRow(name="c", project="/s/c/project.yaml", status="failed", message="the disk is full"),
)


@pytest.fixture
def batch() -> Batch:
    return Batch(
        rows=ROWS,
        pooled=pool_fits(ROWS),
        drifts=find_camera_drifts(ROWS),
        version="1",
        created_utc="2026-01-01T00:00:00+00:00",
        seconds=1.0,
    )


def test_the_page_names_every_survey_and_what_is_wrong(batch: Batch) -> None:
    page = render_batch_page(batch, Path("/s/table"))

    assert "&lt;b&gt;=1+1&lt;/b&gt;" in page
    assert "<b>=1+1</b>" not in page
    assert 'href="../a/out%20put/report.html"' in page
    assert "the disk is full" in page
    assert ">c<" in page
    assert "&lt;b&gt;=1+1&lt;/b&gt; (a)" in page  # whose folder has another name
    assert "Not shown: 1 survey that failed" in page
    assert "the stated ± are too small: errors are 3 times as large" in page
    assert re.findall(r'(?:src|href)="(?!\.\./)', page) == []  # nothing from elsewhere


def test_the_headline_is_as_bad_as_the_worst(batch: Batch) -> None:
    good = replace(batch, rows=ROWS[:2], pooled=())

    assert summarise_batch(batch).level == "red"
    assert any("not measured: c" in text for text in summarise_batch(batch).reasons)
    assert summarise_batch(replace(batch, rows=ROWS[:2])).level == "amber"
    assert summarise_batch(good) == ("green", summarise_batch(good).sentence, [])


def test_distances_on_the_map_are_those_on_the_earth(batch: Batch) -> None:
    drawn = batch_map(batch, {})
    assert drawn is not None
    (first,), (second,) = drawn.drawing.find_shapes("surveys")
    _, _, true_m = Geod(ellps="WGS84").inv(4.9, 52.1, 5.4, 52.3)
    bar_m = float(drawn.drawing.bar_text.removesuffix(" km")) * 1000.0
    on_map = math.dist(first, second) / drawn.drawing.bar * bar_m

    assert on_map == pytest.approx(true_m, rel=0.01)
    assert second[1] < first[1]  # north is up
    assert second[0] > first[0]
    written = [one.text for one in drawn.drawing.written if one.text.endswith("E")]
    assert len(set(written)) == len(written) == len(drawn.drawing.find_shapes("meridian")) >= 2
    assert batch_map(replace(batch, rows=ROWS[2:]), {}) is None


def test_one_place_is_a_map_too(batch: Batch) -> None:
    drawn = batch_map(replace(batch, rows=ROWS[:1]), {})

    assert drawn is not None
    assert drawn.drawing.bar_text.endswith(" m")
    ((place,),) = drawn.drawing.find_shapes("surveys")
    assert 0 < place[0] < 1000
    assert 0 < place[1] < drawn.drawing.height


def test_both_tables_say_the_same_and_no_spreadsheet_runs_them(
    batch: Batch, tmp_path: Path
) -> None:
    write_batch_csv(batch, tmp_path / "batch.csv")
    write_batch_parquet(batch, tmp_path / "batch.parquet")
    typed = read_rows(tmp_path / "batch.csv")
    exact = parquet.read_table(tmp_path / "batch.parquet").to_pylist()

    assert [row["status"] for row in typed] == ["done", "unchanged", "failed"]
    assert typed[0]["camera"] == "'=cmd"
    assert exact[0]["camera"] == "=cmd"
    assert float(typed[0]["mean_sigma_m"]) == exact[0]["mean_sigma_m"] == 0.0123456789
    assert typed[2]["mean_sigma_m"] == ""
    assert exact[2]["mean_sigma_m"] is None
    assert exact[0]["checks_rms_sigmas"] == 3.0
    assert (exact[0]["camera_fx_value"], exact[1]["camera_fx_value"]) == (1.0, None)
