"""Tables of a result as data frames: every number of results.json, under its name."""

from __future__ import annotations

import dataclasses
import json
import sys
from collections.abc import Sequence
from typing import get_args

import numpy as np
import pytest
import synthetic_survey
from full_report import full
from sample_results import sample_result

import uavgram
from uavgram.io.results.results_json import dump_results
from uavgram.model.result.reliability import Effects, Evidence, PriorResults, WeakestLinks
from uavgram.model.result.result import Result
from uavgram.views.notebook.tables import TableName

pytest.importorskip("pandas", reason="pandas is not installed")


@pytest.fixture(scope="module")
def result() -> Result:
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


def test_no_part_of_results_json_is_without_a_table(result: Result) -> None:
    stored = json.loads(dump_results(result))
    tables = {name for part in stored for name in TABLES_OF.get(part, (part,))}

    assert tables - NO_TABLE == set(get_args(TableName))
    for part, held in stored.items():
        for name in TABLES_OF.get(part, () if part in NO_TABLE else (part,)):
            frame = uavgram.to_pandas(result, name)
            if isinstance(held, list) and part not in ("checks", "orientation"):
                assert len(frame) == len(held), name


def test_what_photos_share_and_the_lens_have_their_sigmas(result: Result) -> None:
    shared, lens = uavgram.to_pandas(result, "shared"), uavgram.to_pandas(result, "camera")
    boresight, adjusted = result.shared.boresight_deg, result.shared.intrinsics

    assert boresight is not None
    assert shared.loc["boresight y", "sigma"] == boresight.sigma[1]
    assert shared.loc["boresight y", "unit"] == "deg"
    assert lens.loc["fy", "adjusted"] == adjusted.value[1]
    assert lens.loc["k1", "stated_sigma"] == np.sqrt(result.camera.covariance[4, 4])
    assert list(lens.loc[["fx", "k1"], "unit"]) == ["px", ""]


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
