"""A column of a table for people is named once."""

from __future__ import annotations

import pytest
import synthetic_survey as survey
from html_page import Page

from uavgram.views import result_tables
from uavgram.views.recording.pages import measured_page
from uavgram.views.report import render_annex, render_report
from uavgram.views.result_tables import TABLES, TableColumn, result_table
from uavgram.views.terminal import measurement_table
from uavgram.views.units import spread_text

TITLE = "sigma, as stated"
COLUMN = TableColumn(
    TITLE,
    lambda source, row: spread_text(
        float(source.result.measurements.sigma_stated[row]),
        source.result.measurements.unit[row],
        source.units,
    ),
    ("terminal", "annex", "recording"),
    is_number=True,
)


def test_a_new_column_is_one_row_for_all_places(monkeypatch: pytest.MonkeyPatch) -> None:
    result = survey.build()
    shown = (measurement_table, render_annex, measured_page)
    assert not any(TITLE in show(result) for show in (*shown, render_report))
    monkeypatch.setitem(result_tables.TABLES, "measured", (*TABLES["measured"], COLUMN))

    assert all(TITLE in show(result) for show in shown)
    assert TITLE not in render_report(result)
    cell = spread_text(float(result.measurements.sigma_stated[0]), result.measurements.unit[0])
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
