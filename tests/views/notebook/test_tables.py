"""Tables of a result as data frames: every number of results.json, under its name."""

from __future__ import annotations

import dataclasses
import sys
from collections.abc import Sequence
from typing import get_args

import numpy as np
import pytest
import synthetic_survey
from full_report import full
from sample_results import sample_result

import uavgram
from uavgram.model.result.result import Result
from uavgram.views.notebook.tables import TableName

pytest.importorskip("pandas", reason="pandas is not installed")


@pytest.fixture(scope="module")
def result() -> Result:
    return full(sample_result())


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
def test_no_number_of_a_table_is_left_out_or_told_twice(result: Result, name: TableName) -> None:
    frame = uavgram.to_pandas(result, name)

    assert frame.select_dtypes("number").size + frame.select_dtypes(bool).size == numbers_in(
        getattr(result, name)
    )


def test_numbers_stand_under_their_names(result: Result) -> None:
    points = uavgram.to_pandas(result, "points")
    frames = uavgram.to_pandas(result, "frames")
    picks = uavgram.to_pandas(result, "picks")
    rows = uavgram.to_pandas(result, "measurements")

    name, label = result.measurements.name[0], result.points.label[1]
    assert points.loc[label, "north_m"] == result.points.position_world_m[1, 1]
    assert points.loc[label, "covariance_east_north_m2"] == result.points.covariance_m2[1, 0, 1]
    relative = result.points.relative.ellipse_95_m[1, 1]
    assert points.loc[label, "relative_ellipse_95_minor_m"] == relative
    covariance = result.frames.refined.covariance
    posed = int(np.flatnonzero(result.has_refined)[0])
    assert frames["refined_covariance_up_y"].iloc[posed] == covariance[posed, 2, 4]
    assert picks["v_px"].iloc[0] == result.picks.pixel_px[0, 1]
    assert rows.loc[name, "bound_95_upper"] == result.measurements.interval_95[0, 1]
    assert list(rows["points"]) == list(result.measurements.points)


@pytest.mark.parametrize("name", get_args(TableName))
def test_every_table_is_a_frame(result: Result, name: TableName) -> None:
    frame = uavgram.to_pandas(result, name)

    assert frame.columns.is_unique
    assert all(not isinstance(cell, np.ndarray) for column in frame for cell in frame[column])


def test_tables_of_measurements_have_their_names(result: Result) -> None:
    names = list(result.measurements.name)
    budget, area = result.error_budget, result.areas[1]
    assert budget is not None

    assert list(uavgram.to_pandas(result, "correlation").columns) == names
    shares = uavgram.to_pandas(result, "error_budget")
    assert shares.loc[names[0], budget.source[2]] == budget.share[0, 2]
    areas = uavgram.to_pandas(result, "areas")
    assert areas.loc[area.name, "slope_north_sigma_deg"] == area.slope_deg.sigma[1]


def test_an_unknown_table_is_refused_with_those_there_are(result: Result) -> None:
    with pytest.raises(uavgram.UavgramError, match=r"'pionts'.*measurements.*points"):
        uavgram.to_pandas(result, "pionts")  # type: ignore[arg-type]  # what must fail


def test_without_pandas_it_says_how_to_get_it(
    result: Result, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "pandas", None)

    with pytest.raises(uavgram.UavgramError, match="pip install pandas"):
        uavgram.to_pandas(result, "points")


def test_a_result_with_nothing_in_it_has_empty_tables() -> None:
    bare = dataclasses.replace(synthetic_survey.build(), error_budget=None, monte_carlo=None)
    empty: Sequence[TableName] = ("error_budget", "monte_carlo", "removals")

    assert all(uavgram.to_pandas(bare, name).empty for name in empty)
