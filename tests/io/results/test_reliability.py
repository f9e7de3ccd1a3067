"""Reliability, second order, removals and overall checks in results.json, and back."""

from __future__ import annotations

import json
from dataclasses import fields, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pytest
from schema_faults import faults_of

from uavgram.errors import InputError
from uavgram.io.results.results_json import dump_results, load_results
from uavgram.model.result.reliability import (
    ChecksOverall,
    Effects,
    Evidence,
    PriorResults,
    RemovalRecord,
    SecondOrder,
    WeakestLinks,
)
from uavgram.model.result.result import Result

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

NAN = np.nan


@pytest.fixture
def judged(sample_result: Result) -> Result:
    """A result in which everything is known of its reliability."""
    names = sample_result.measurements.name
    count = len(names)
    effects = Effects(
        on=(names[0], "", names[-1]),
        change=np.array([0.04, NAN, -1 / 3]),
        sigmas=np.array([2, NAN, 1]),
    )
    evidence = Evidence(
        lines=effects,
        picks=effects,
        priors=PriorResults(
            kind=("telemetry", "calibration", "clock"),
            name=("image x axis", "k1", "clock offset"),
            frame_id=("a.jpg", "", ""),
            unit=("deg", "1", "s"),
            residual=np.array([1.5, 0.0, -0.1]),
            w=np.array([6.1, 0.0, -0.2]),
            redundancy=np.array([0.9, 0.0, 0.3]),
            bias=np.array([4.0, NAN, 0.7]),
            effects=effects,
        ),
        weakest=WeakestLinks(
            what=("length 'n'",) + ("",) * (count - 1),
            bias=np.array([0.09] + [NAN] * (count - 1)),
            unit=("m",) + ("",) * (count - 1),
            change=np.array([-0.04] + [NAN] * (count - 1)),
            unchecked=(("pick of 'P' in 'a.jpg'", "k1"),) + ((),) * (count - 1),
        ),
    )
    return replace(
        sample_result,
        evidence=evidence,
        second_order=SecondOrder(
            bias=np.linspace(0, 0.1, count),
            sigma=np.array([*np.linspace(0.1, 0.2, count - 1), NAN]),
            curvature=np.linspace(0, 1, count),
            off=np.array([False] * (count - 1) + [True]),
        ),
        removals=(
            RemovalRecord(
                what="length 'n'",
                w=-25.9,
                group=("pick of 'P' in 'a.jpg'",),
                rivals=("length 'm'",),
                variance_factor_before=90.5,
                variance_factor_after=NAN,
                change=(*np.linspace(-0.1, 0.1, count - 1), NAN),
            ),
        ),
        checks_overall=ChecksOverall(
            count=4, chi2=5.5, probability=0.25, rms_error_m=0.12, mean_error_percent=NAN
        ),
    )


def same(one: DataclassInstance, other: DataclassInstance) -> None:
    for field in fields(one):
        a, b = getattr(one, field.name), getattr(other, field.name)
        if isinstance(a, np.ndarray):
            np.testing.assert_array_equal(a, b, strict=True)
        elif hasattr(a, "__dataclass_fields__"):
            same(a, b)
        else:
            np.testing.assert_equal(a, b)


def test_what_is_known_of_the_reliability_comes_back(judged: Result, tmp_path: Path) -> None:
    path = tmp_path / "results.json"
    path.write_text(dump_results(judged), encoding="utf-8")
    back = load_results(path)
    for name in ("evidence", "second_order", "checks_overall"):
        same(getattr(judged, name), getattr(back, name))
    same(judged.removals[0], back.removals[0])
    assert dump_results(back) == dump_results(judged)
    assert faults_of(dump_results(judged)) == []


def test_it_stands_with_the_rows_that_it_is_of(judged: Result) -> None:
    content = json.loads(dump_results(judged))
    line, measurement = content["lines"][0], content["measurements"][0]
    assert line["external"] == 0.04
    assert line["external_on"] == judged.measurements.name[0]
    assert measurement["weakest"] == {
        "what": "length 'n'", "mdb": 0.09, "unit": "m", "change": -0.04,
    }  # fmt: skip
    assert measurement["unchecked"] == ["pick of 'P' in 'a.jpg'", "k1"]
    assert measurement["first_order_off"] is False
    assert content["measurements"][-1]["second_order_sigma"] is None
    assert content["measurements"][-1]["weakest"] is None
    assert content["priors"][0]["frame_id"] == "a.jpg"
    assert content["priors"][0]["residual_sigmas"] == 1.5
    assert content["removals"][0]["step"] == 1
    assert content["checks_overall"]["count"] == 4


def test_a_result_without_any_of_it_comes_back_without(
    sample_result: Result, tmp_path: Path
) -> None:
    path = tmp_path / "results.json"
    path.write_text(dump_results(sample_result), encoding="utf-8")
    back = load_results(path)
    assert back.evidence is None
    assert back.second_order is None
    assert back.checks_overall is None
    assert back.removals == ()


def test_a_flag_that_is_no_truth_value_is_refused(judged: Result, tmp_path: Path) -> None:
    path = tmp_path / "results.json"
    content = json.loads(dump_results(judged))
    content["measurements"][0]["first_order_off"] = "no"
    path.write_text(json.dumps(content), encoding="utf-8")
    with pytest.raises(InputError, match="true or false"):
        load_results(path)
