"""results.schema.json: generated, part of the package, and true of every written file."""

from __future__ import annotations

import json
from dataclasses import replace
from importlib.resources import files

import pytest
from results_schema import dump_schema, results_schema, schema_of
from schema_faults import faults_of

from uavgram.io.results.results_json import dump_results
from uavgram.model.message import Correction, Message, Remedy
from uavgram.model.result.reliability import Reason, Verdict
from uavgram.model.result.result import Result


def test_the_file_in_the_package_is_the_generated_one() -> None:
    shipped = files("uavgram").joinpath("results.schema.json").read_text(encoding="utf-8")

    assert shipped == dump_schema()  # python tests/support/results_schema.py > that file


def test_a_result_has_the_keys_and_types_of_the_schema_and_no_other(sample_result: Result) -> None:
    remedy = Remedy(
        action="ends",
        words="Take L1 from A to B",
        corrections=(Correction(action="ends", length="L1", ends=("A", "B")),),
    )
    named = Message("warning", "point-off-ground", "x", labels=("A",), heights_m=(1.0,))
    reasons = (
        Reason(cause="misfit", text="x"),
        Reason(cause="line-other-ends", text="x", plain="y", mend=remedy, instead=(remedy,)),
    )
    result = replace(
        sample_result,
        verdict=Verdict(level="red", reasons=reasons),
        messages=(*sample_result.messages, named),
    )

    assert faults_of(dump_results(sample_result)) == []
    assert faults_of(dump_results(result)) == []
    assert faults_of(dump_results(replace(result, verdict=Verdict(level=None)))) == []


@pytest.mark.parametrize(
    ("place", "wrong"),
    [
        (("measurements", 0, "value"), "1.0"),
        (("measurements", 0, "status"), "good"),
        (("measurements", 0, "interval_95"), [1.0, 2.0, 3.0]),
        (("points", 0, "position_world_m"), [1.0, None, 2.0]),
        (("frames", 0, "refined"), {}),
        (("verdict", "level"), "blue"),
        (("shared", "readout_s"), [0.1]),
        (("world", "gauge"), None),
        (("solution", "iterations"), 1.5),
        (("lines", 0, "new"), 1),
        (("new",), 1),
    ],
)
def test_a_wrong_value_or_an_unknown_key_is_found(
    sample_result: Result, place: tuple[str | int, ...], wrong: object
) -> None:
    content = json.loads(dump_results(sample_result))
    inside = content
    for key in place[:-1]:
        inside = inside[key]
    inside[place[-1]] = wrong

    (fault,) = faults_of(json.dumps(content))
    assert "new" in place or fault.startswith("/".join(map(str, place)))


def test_every_key_of_a_file_is_required_but_what_a_run_may_lack(sample_result: Result) -> None:
    content = json.loads(dump_results(sample_result))
    for key in content:
        rest = {one: value for one, value in content.items() if one != key}
        is_optional = key in ("error_budget", "priors")
        assert bool(faults_of(json.dumps(rest))) != is_optional, key


def test_readers_may_meet_keys_of_later_versions() -> None:
    assert "additionalProperties" not in results_schema()


def test_columns_have_descriptions() -> None:
    rows = results_schema()["properties"]["measurements"]["items"]["properties"]

    assert "1 %" in rows["shift_tape_1pct"]["description"]
    assert not [
        key for key in ("name", "value", "sigma", "status") if "description" not in rows[key]
    ]


def test_a_type_without_a_form_in_json_is_refused() -> None:
    with pytest.raises(TypeError, match="no form in JSON"):
        schema_of(complex)
