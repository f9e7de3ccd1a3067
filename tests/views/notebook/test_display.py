"""A result in a notebook, and its plots."""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import replace
from html import escape
from types import ModuleType, SimpleNamespace

import numpy as np
import pytest
import synthetic_survey
from full_report import full
from html_page import Page
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

import uavgram
from uavgram.model.result.result import Result
from uavgram.views.formatting import measurement_text
from uavgram.views.notebook.display import result_html
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


def test_names_of_the_plan_stand_beside_it_in_the_projects_units(result: Result) -> None:
    options = (*result.provenance.options, ("units.length", "ft"))
    feet = replace(result, provenance=replace(result.provenance, options=options))
    assert units_of(feet).length == "ft"
    metric, imperial = uavgram.plots.plan(result), uavgram.plots.plan(feet)
    legend = imperial.get_legend()

    assert legend is not None
    told = [text.get_text() for text in legend.get_texts()]
    assert told
    rows = [
        measurement_text(result.measurements, i, units_of(feet))
        for i in range(len(result.measurements.name))
    ]
    assert set(told) <= {f"{row.name}: {row.value}" for row in rows}
    assert any(" ft" in text for text in told)
    assert imperial.get_xlabel() == "east [ft]"
    np.testing.assert_allclose(
        np.ptp(imperial.dataLim.get_points(), axis=0),
        np.ptp(metric.dataLim.get_points(), axis=0) / 0.3048,
    )
    assert " ft" in result_html(feet)
    assert " m<" in result_html(result)
