"""A column of a table for people is named once."""

from __future__ import annotations

import numpy as np
import pytest
import synthetic_survey as survey
from html_page import Page

from uavgram.views import result_tables
from uavgram.views.recording.pages import measured_page
from uavgram.views.report import render_annex, render_report
from uavgram.views.result_tables import TABLES, TableColumn, result_table
from uavgram.views.terminal import measurement_table
from uavgram.views.units import format_sigma

TITLE = "sigma, as stated"
COLUMN = TableColumn(
    f">{TITLE}",
    lambda source, row: format_sigma(
        float(source.result.measurements.sigma_stated[row]),
        source.result.measurements.unit[row],
        source.units,
    ),
    ("terminal", "annex", "recording"),
)


def test_a_new_column_is_one_row_for_all_places(monkeypatch: pytest.MonkeyPatch) -> None:
    result = survey.build()
    shown = (measurement_table, render_annex, measured_page)
    assert not any(TITLE in show(result) for show in (*shown, render_report))
    monkeypatch.setitem(result_tables.TABLES, "measured", (*TABLES["measured"], COLUMN))

    assert all(TITLE in show(result) for show in shown)
    assert TITLE not in render_report(result)
    cell = format_sigma(float(result.measurements.sigma_stated[0]), result.measurements.unit[0])
    row = next(
        row for row in Page(render_annex(result)).rows if row[0] == result.measurements.name[0]
    )
    assert row[-1] == cell
    assert cell in measurement_table(result)
    assert cell in measured_page(result)


@pytest.mark.parametrize("name", ["measured", "lengths", "points"])
@pytest.mark.parametrize("where", ["terminal", "first page", "report", "annex", "recording"])
def test_titles_of_a_table_differ_and_rows_are_complete(
    name: result_tables.TableName, where: result_tables.Place
) -> None:
    table = result_table(name, survey.build(), (2, 0, 1), where)

    assert len(set(table.titles)) == len(table.titles) == len(table.numbers)
    assert all(len(row) == len(table.titles) for row in table.rows)
    assert len(table.rows) == len(table.bad) == 3
    assert not any("[m]" in title and "[relief]" in title for title in table.titles)


# Tables that are too long for a page: what is left out is told, and is not what matters.


def test_a_long_table_tells_what_is_doubtful_and_how_much_more_there_is(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    made = survey.build()
    whole = render_annex(made)
    assert " more photos are in results.json" not in whole
    monkeypatch.setattr(result_tables, "MAX_ROWS", 4)
    page = render_annex(made)

    photos = page.split('id="photos"')[1].split("</section>")[0]
    lost = {
        name
        for name, status in zip(made.frames.frame_id, made.frames.status, strict=True)
        if status in ("rejected", "unmatched")
    }
    assert lost
    assert all(name in photos for name in lost)
    assert photos.count("<tr") == 1 + 4
    assert f"{len(made.frames.frame_id) - 4} more photos are in results.json" in photos
    points = page.split('id="points"')[1].split("</section>")[0]
    size = made.points.relative.ellipse_95_m[:, 0]
    for k, label in enumerate(made.points.label):
        assert (f"<td>{label}</td>" in points) == (k in np.argsort(-size, kind="stable")[:4])
    assert f"{len(size) - 4} more points are in results.json" in points
    residuals = page.split("Residuals by photo")[1].split("</section>")[0]
    used = [status in ("used", "suspect") for status in made.picks.status]
    length = np.linalg.norm(made.picks.residual_px, axis=1)
    worst = made.picks.image[int(np.argmax(np.where(used, length, -1.0)))]
    assert f"<td>{worst}</td>" in residuals
    assert "These photos have the largest residuals" in residuals
