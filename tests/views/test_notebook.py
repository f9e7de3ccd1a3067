"""A result in a notebook, and its plots."""

from __future__ import annotations

import dataclasses
import json
import sys
from collections.abc import Callable, Sequence
from dataclasses import replace
from html import escape
from types import ModuleType, SimpleNamespace
from typing import get_args

import numpy as np
import pytest
import synthetic_survey
from full_report import full
from html_page import Page
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle
from sample_results import sample_result

import uavgram
from uavgram.io.results.results_json import dump_results
from uavgram.model.result.reliability import Effects, Evidence, PriorResults, WeakestLinks
from uavgram.model.result.result import Result
from uavgram.views.data_frames import TableName
from uavgram.views.formatting import measurement_text
from uavgram.views.notebook import result_html
from uavgram.views.survey.top_view import top_view
from uavgram.views.survey.verdict import verdict_sentence
from uavgram.views.units import units_of


@pytest.fixture(scope="module")
def result() -> Result:
    return full(synthetic_survey.build())


def test_the_display_begins_with_the_verdict_and_has_every_measurement(result: Result) -> None:
    html = result_html(result)
    page, rows = Page(html), result.measurements

    assert 0 < html.index(escape(verdict_sentence(result))) < html.index(rows.name[0])
    told = {row[0]: row for row in page.rows}
    for i, name in enumerate(rows.name):
        assert told[name][3].startswith(measurement_text(rows, i).value)


def test_a_running_notebook_learns_how_to_show_a_result(monkeypatch: pytest.MonkeyPatch) -> None:
    shown: dict[tuple[str, str], Callable[[Result], str]] = {}
    html = SimpleNamespace(
        for_type_by_name=lambda module, name, how: shown.update({(module, name): how})
    )
    shell = SimpleNamespace(display_formatter=SimpleNamespace(formatters={"text/html": html}))
    notebook = ModuleType("IPython")
    notebook.get_ipython = lambda: shell  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, "IPython", notebook)
    assert callable(uavgram.load_results)

    home = (Result.__module__, Result.__name__)
    assert shown == {home: result_html}


@pytest.mark.parametrize("name", ["residuals", "plan", "budget"])
def test_a_plot_is_drawn_into_the_axes_given_or_into_its_own(result: Result, name: str) -> None:
    given = Figure().subplots()
    draw = getattr(uavgram.plots, name)

    assert draw(result, given) is given
    assert draw(result).figure is not given.figure
    given.figure.draw_without_rendering()
    assert given.get_title()


def test_bars_of_the_budget_add_up_to_everything(result: Result) -> None:
    axes = uavgram.plots.budget(result)
    ends: dict[float, float] = {}
    for bar in axes.patches:
        assert isinstance(bar, Rectangle)
        ends[bar.get_y()] = max(ends.get(bar.get_y(), 0.0), bar.get_x() + bar.get_width())

    assert ends
    np.testing.assert_allclose(list(ends.values()), 100.0, atol=1e-9)


def test_residuals_are_drawn_where_they_are(result: Result) -> None:
    axes = uavgram.plots.residuals(result)
    drawn = np.concatenate([np.asarray(some.get_offsets()) for some in axes.collections])
    used = [status in ("used", "suspect") for status in result.picks.status]

    wanted = result.picks.residual_px[used]
    np.testing.assert_allclose(np.sort(drawn, axis=0), np.sort(wanted, axis=0))


def test_the_plan_is_the_top_view_of_the_report_in_the_projects_units(result: Result) -> None:
    options = (*result.provenance.options, ("units.length", "ft"))
    feet = replace(result, provenance=replace(result.provenance, options=options))
    assert units_of(feet).length == "ft"
    for one in (result, feet):
        view = top_view(one)
        assert view is not None
        wanted = {text.text for text in view.drawing.texts if text.kind == "measured"}
        drawn = {text.get_text() for text in uavgram.plots.plan(one).texts}

        assert wanted
        assert wanted <= drawn


@pytest.fixture(scope="module")
def table_result() -> Result:
    found = full(sample_result())
    lines, picks, measured = len(found.lines.name), len(found.picks.image), found.measurements.name
    priors = PriorResults(
        kind=("telemetry", "calibration"),
        name=("position", "fx"),
        frame_id=("a.jpg", ""),
        unit=("m", "px"),
        residual=np.array([0.5, -0.25]),
        w=np.array([0.6, -0.3]),
        redundancy=np.array([0.7, 0.1]),
        bias=np.array([3.0, 40.0]),
        effects=effects(2),
    )
    weakest = WeakestLinks(
        what=("pick",) * len(measured),
        bias=np.ones(len(measured)),
        unit=("px",) * len(measured),
        change=np.full(len(measured), 0.01),
        unchecked=((),) * len(measured),
    )
    evidence = Evidence(lines=effects(lines), picks=effects(picks), priors=priors, weakest=weakest)
    return dataclasses.replace(found, evidence=evidence)


def effects(count: int) -> Effects:
    number = np.arange(count, dtype=np.float64)
    return Effects(on=("width",) * count, change=number, sigmas=number)


def numbers_in(table: object) -> int:
    """How many numbers the arrays of a table hold, a symmetric matrix with its upper half."""
    count = 0
    for field in dataclasses.fields(table):  # type: ignore[arg-type]
        value = getattr(table, field.name)
        if dataclasses.is_dataclass(value):
            count += numbers_in(value)
        elif isinstance(value, np.ndarray) and field.name != "correlation":
            rows, *shape = value.shape
            symmetric = field.name.startswith("covariance")
            each = shape[0] * (shape[0] + 1) // 2 if symmetric else int(np.prod(shape))
            count += rows * each
    return count


@pytest.mark.parametrize("name", ["measurements", "points", "lines", "picks", "frames"])
def test_no_number_of_a_table_is_left_out_or_told_twice(
    table_result: Result, name: TableName
) -> None:
    frame = uavgram.to_pandas(table_result, name)

    assert frame.select_dtypes("number").size + frame.select_dtypes(bool).size == numbers_in(
        getattr(table_result, name)
    )


def test_numbers_stand_under_their_names(table_result: Result) -> None:
    points = uavgram.to_pandas(table_result, "points")
    frames = uavgram.to_pandas(table_result, "frames")
    picks = uavgram.to_pandas(table_result, "picks")
    rows = uavgram.to_pandas(table_result, "measurements")

    name, label = table_result.measurements.name[0], table_result.points.label[1]
    assert points.loc[label, "north_m"] == table_result.points.position_world_m[1, 1]
    assert (
        points.loc[label, "covariance_east_north_m2"] == table_result.points.covariance_m2[1, 0, 1]
    )
    relative = table_result.points.relative.ellipse_95_m[1, 1]
    assert points.loc[label, "relative_ellipse_95_minor_m"] == relative
    covariance = table_result.frames.refined.covariance
    posed = int(np.flatnonzero(table_result.has_refined)[0])
    assert frames["refined_covariance_up_y"].iloc[posed] == covariance[posed, 2, 4]
    assert picks["v_px"].iloc[0] == table_result.picks.pixel_px[0, 1]
    assert rows.loc[name, "bound_95_upper"] == table_result.measurements.interval_95[0, 1]
    assert list(rows["points"]) == list(table_result.measurements.points)


@pytest.mark.parametrize("name", get_args(TableName))
def test_every_table_is_a_frame(table_result: Result, name: TableName) -> None:
    frame = uavgram.to_pandas(table_result, name)

    assert frame.columns.is_unique
    assert all(not isinstance(cell, np.ndarray) for column in frame for cell in frame[column])


def test_tables_of_measurements_have_their_names(table_result: Result) -> None:
    names = list(table_result.measurements.name)
    budget, area = table_result.error_budget, table_result.areas[1]
    assert budget is not None

    assert list(uavgram.to_pandas(table_result, "correlation").columns) == names
    shares = uavgram.to_pandas(table_result, "error_budget")
    assert shares.loc[names[0], budget.source[2]] == budget.share[0, 2]
    areas = uavgram.to_pandas(table_result, "areas")
    assert areas.loc[area.name, "slope_north_sigma_deg"] == area.slope_deg.sigma[1]


NO_TABLE = {
    "schema", "name", "verdict", "provenance", "world", "clock", "checks_overall", "solution",
    "noise", "ties",
}  # fmt: skip
"""Of results.json: single values, and what holds tables of its own."""

TABLES_OF: dict[str, tuple[TableName, ...]] = {
    "verdict": ("reasons",),
    "provenance": ("inputs",),
    "solution": ("groups", "alternatives"),
    "noise": ("pick_noise", "roughness"),
    "clock": ("shared",),
    "lines": ("lines", "line_effects"),
    "picks": ("picks", "pick_effects"),
    "measurements": ("measurements", "weakest_links", "second_order"),
    "measurement_correlation": ("correlation",),
    "checks": ("point_checks", "line_checks"),
}
"""Where a part of results.json has not the name of its table."""


def test_no_part_of_results_json_is_without_a_table(table_result: Result) -> None:
    stored = json.loads(dump_results(table_result))
    tables = {name for part in stored for name in TABLES_OF.get(part, (part,))}

    assert tables - NO_TABLE == set(get_args(TableName))
    for part, held in stored.items():
        for name in TABLES_OF.get(part, () if part in NO_TABLE else (part,)):
            frame = uavgram.to_pandas(table_result, name)
            if isinstance(held, list) and part not in ("checks", "orientation"):
                assert len(frame) == len(held), name


def test_what_photos_share_and_the_lens_have_their_sigmas(table_result: Result) -> None:
    shared, lens = (
        uavgram.to_pandas(table_result, "shared"),
        uavgram.to_pandas(table_result, "camera"),
    )
    boresight, adjusted = table_result.shared.boresight_deg, table_result.shared.intrinsics

    assert boresight is not None
    assert shared.loc["boresight y", "sigma"] == boresight.sigma[1]
    assert shared.loc["boresight y", "unit"] == "deg"
    assert lens.loc["fy", "adjusted"] == adjusted.value[1]
    assert lens.loc["k1", "stated_sigma"] == np.sqrt(table_result.camera.covariance[4, 4])
    assert list(lens.loc[["fx", "k1"], "unit"]) == ["px", ""]


def test_an_unknown_table_is_refused_with_those_there_are(table_result: Result) -> None:
    with pytest.raises(uavgram.UavgramError, match=r"'pionts'.*measurements.*points"):
        uavgram.to_pandas(table_result, "pionts")  # type: ignore[arg-type]  # what must fail


def test_without_pandas_it_says_how_to_get_it(
    table_result: Result, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "pandas", None)

    with pytest.raises(uavgram.UavgramError, match="pip install pandas"):
        uavgram.to_pandas(table_result, "points")


def test_a_result_with_nothing_in_it_has_empty_tables() -> None:
    bare = dataclasses.replace(synthetic_survey.build(), error_budget=None, monte_carlo=None)
    empty: Sequence[TableName] = ("error_budget", "monte_carlo", "removals")

    assert all(uavgram.to_pandas(bare, name).empty for name in empty)
