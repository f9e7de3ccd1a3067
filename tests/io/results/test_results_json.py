"""results.json: the same object again, the keys that others read, and broken files refused."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import fields, is_dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np
import pytest
from sample_results import sample_result
from schema_faults import faults_of

from uavgram.errors import InputError
from uavgram.io.results.results_json import dump_results, load_results, write_results
from uavgram.model.camera import Readout
from uavgram.model.message import Correction, Remedy
from uavgram.model.result.reliability import (
    ChecksOverall,
    Effects,
    Evidence,
    PriorResults,
    Reason,
    RemovalRecord,
    SecondOrder,
    Verdict,
    WeakestLinks,
)
from uavgram.model.result.result import Estimate, OrientationCorrelation, Result

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

Table = TypeVar("Table", bound="DataclassInstance")


def assert_same(a: object, b: object, where: str = "result") -> None:
    """Compare nested dataclasses: every field, exactly, NaN equal to NaN, signs of zeros too."""
    assert type(a) is type(b), where
    if is_dataclass(a):
        for field in fields(a):
            assert_same(getattr(a, field.name), getattr(b, field.name), f"{where}.{field.name}")
    elif isinstance(a, np.ndarray):
        assert isinstance(b, np.ndarray)
        assert a.tobytes() == np.asarray(b, a.dtype).tobytes(), where
        assert a.shape == b.shape, where
    elif isinstance(a, tuple):
        assert isinstance(b, tuple)
        assert len(a) == len(b), where
        for i, (one, other) in enumerate(zip(a, b, strict=True)):
            assert_same(one, other, f"{where}[{i}]")
    else:
        both_nan = isinstance(a, float) and isinstance(b, float) and np.isnan(a) and np.isnan(b)
        assert a == b or both_nan, where


def no_rows_of(table: Table) -> Table:
    """Cut a table of rows, and the tables in it, down to no row."""
    parts = {field.name: getattr(table, field.name) for field in fields(table)}
    return replace(
        table,
        **{
            k: no_rows_of(v) if is_dataclass(v) and not isinstance(v, type) else v[:0]
            for k, v in parts.items()
        },
    )


def without_records(result: Result) -> Result:
    """Cut every table of a result down to no row, and leave out what a plane gauge lacks."""
    empty: dict[str, Any] = {}
    for field in fields(result):
        part = getattr(result, field.name)
        if field.name in {"points", "lines", "picks", "point_checks", "line_checks"}:
            empty[field.name] = no_rows_of(part)
    rows = result.measurements
    no_rows = {f.name: getattr(rows, f.name)[:0] for f in fields(rows)}
    no_rows["correlation"] = np.empty((0, 0))
    world = replace(result.world, origin=None, gauge="plane")
    return replace(
        result,
        **empty,
        measurements=replace(rows, **no_rows),
        shared=replace(
            result.shared,
            boresight_deg=None,
            lever_arm_m=None,
            heading_bias_deg=None,
            clock_offset_s=None,
        ),
        world=world,
        messages=(),
    )


def test_a_result_comes_back_as_the_same_object(sample_result: Result, tmp_path: Path) -> None:
    write_results(sample_result, tmp_path / "results.json")

    assert_same(sample_result, load_results(tmp_path / "results.json"))


def test_a_result_without_any_row_comes_back_as_the_same_object(
    sample_result: Result, tmp_path: Path
) -> None:
    result = without_records(sample_result)
    write_results(result, tmp_path / "results.json")

    assert_same(result, load_results(tmp_path / "results.json"))
    assert faults_of((tmp_path / "results.json").read_text(encoding="utf-8")) == []


def test_the_comparison_above_sees_a_last_bit(sample_result: Result) -> None:
    points = sample_result.points
    turned = np.nextafter(points.ellipse_azimuth_rad, 4.0)

    with pytest.raises(AssertionError, match="ellipse_azimuth_rad"):
        assert_same(points, replace(points, ellipse_azimuth_rad=turned))


def test_the_same_result_gives_the_same_text(sample_result: Result, tmp_path: Path) -> None:
    text = dump_results(sample_result)
    (tmp_path / "results.json").write_text(text, encoding="utf-8")

    assert dump_results(load_results(tmp_path / "results.json")) == text


def test_the_keys_of_the_contract_are_there(sample_result: Result) -> None:
    content = json.loads(dump_results(sample_result))

    assert content["schema"] == 1
    assert {"program", "version", "created_utc", "inputs", "options", "seed", "packages"} <= set(
        content["provenance"]
    )
    assert content["provenance"]["made_by"] == "Ada Lovelace"
    assert content["provenance"]["inputs"]["picks.csv"] == {"sha256": "ab" * 32, "bytes": 17}
    assert content["world"] == {
        "latitude_deg": 50.1,
        "longitude_deg": -104.6,
        "height_m": 577.25,
        "height_datum": "msl",
        "gauge": "world",
        "crs": None,
        "undulation_m": None,
    }
    assert {"offset_s", "sigma_s"} <= set(content["clock"])
    shared = content["shared"]
    assert {"boresight_deg", "lever_arm_m", "position_bias_m", "heading_bias_deg", "plane"} <= set(
        shared
    )
    assert {"value", "sigma"} <= set(shared["intrinsics"])
    assert (
        set(shared["plane"]["height_m"])
        == set(shared["plane"]["slope_deg"])
        == {
            "value",
            "sigma",
        }
    )
    assert isinstance(shared["heading_bias_deg"]["value"], float)


@pytest.mark.parametrize(
    ("table", "keys"),
    [
        ("frames", "frame_id time_utc_s status reason seed refined"),
        (
            "points",
            "label position_world_m covariance_m2 ellipse_95 relative latitude_deg longitude_deg "
            "departure_m departure_sigma_m frames",
        ),
        (
            "lines",
            "name from to length_m sigma_m adjusted_m adjusted_sigma_m residual_m w redundancy "
            "mdb_m status",
        ),
        ("picks", "image label residual_px w redundancy status"),
        ("measurements", "name kind points value sigma unit interval_95"),
        ("messages", "level code text"),
    ],
)
def test_every_record_has_the_keys_of_the_contract(
    sample_result: Result, table: str, keys: str
) -> None:
    records = json.loads(dump_results(sample_result))[table]

    assert records
    assert all(set(keys.split()) <= set(record) for record in records)


def test_who_made_a_pick_ties_and_noise_stand_under_their_keys(sample_result: Result) -> None:
    content = json.loads(dump_results(sample_result))

    assert [pick["source"] for pick in content["picks"]] == ["hand", "match", "target"]
    assert [pick["score"] for pick in content["picks"]] == [None, 0.93, 0.99]
    assert [(one["ties"], one["ties_rms_px"]) for one in content["frames"][:2]] == [
        (131, 0.21),
        (0, None),
    ]
    assert content["ties"] == {"points": 131, "sightings": 131, "rms_px": 0.21}
    assert content["noise"]["picks"]["match"] == {"stated_px": 0.1, "factor": 1.25, "sigma": 0.125}
    assert list(content["noise"]["picks"]) == ["hand", "target", "match", "tie"]


def test_only_points_off_the_ground_have_a_covariance_in_space_within_the_survey(
    sample_result: Result,
) -> None:
    content = json.loads(dump_results(sample_result))
    points = content["points"]
    assert ["covariance_m3" in point["relative"] for point in points] == [False, True, False]


def test_numbers_stand_under_the_keys_that_name_them(sample_result: Result) -> None:
    content = json.loads(dump_results(sample_result))

    frame = content["frames"][0]
    assert set(frame["seed"]) == {"center_world_m", "world_from_camera", "covariance"}
    assert np.shape(frame["refined"]["covariance"]) == (6, 6)
    assert content["frames"][2]["refined"] is None
    assert content["frames"][1]["time_utc_s"] is None
    assert content["points"][1]["ellipse_95"]["azimuth_deg"] == pytest.approx(70.73552995)
    assert content["points"][2]["ellipse_95"]["semi_minor_m"] == 1.0
    assert content["lines"][1]["adjusted_m"] is None
    assert content["lines"][0]["mdb_m"] == 0.05
    assert content["picks"][0]["residual_px"] == [0.5, -0.25]
    assert content["picks"][1]["residual_px"] == [None, None]
    assert content["measurements"][4]["value"] is None
    assert np.shape(content["measurement_correlation"]) == (6, 6)
    assert content["checks"] == [
        {
            "label": "Q;ü",
            "error_m": [0.1, 0.2, 0.3],
            "sigma_m": [0.3, 0.3, 0.4],
            "mahalanobis": 1.1,
        },
        {"name": "o", "error_m": 0.1, "sigma_m": 0.05, "z": 2.0},
    ]
    assert content["solution"]["variance_factor"] is None
    assert content["solution"]["groups"][0]["name"] == "pixels"


def test_no_infinite_number_is_ever_written(sample_result: Result) -> None:
    solution = replace(sample_result.solution, variance_factor=float("inf"))

    with pytest.raises(ValueError, match="Out of range"):
        dump_results(replace(sample_result, solution=solution))


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda text: text[: len(text) // 2], "not complete JSON"),
        (lambda _: "", "not complete JSON"),
        (lambda _: "[]", "names no schema"),
        (lambda _: "{}", "names no schema"),
        (lambda text: text.replace('"schema": 1', '"schema": 2'), "is of schema 2"),
        (lambda text: text.replace('"points"', '"pointz"', 1), "there is no key 'points'"),
        (lambda text: text.replace('"residual_px"', '"residual"', 1), "no key 'residual_px'"),
        (lambda text: text.replace("577.25", '"577.25"'), "expected a number, got '577.25'"),
        (lambda text: text.replace("577.25", "NaN"), "holds NaN"),
        (lambda text: text.replace('"refined"', '"refind"', 1), "expected one of refined"),
        (lambda text: text.replace("[0.5, -0.25]", "[0.5]"), "inhomogeneous"),
        (lambda text: text.replace('"iterations": 7', '"iterations": 7.5'), "whole number"),
        (lambda text: text.replace('"converged": true', '"converged": 1'), "true or false"),
        (lambda text: text.replace('"name": "crossing"', '"name": null'), "expected text"),
    ],
)
def test_a_broken_file_is_an_input_error_with_the_way_out(
    sample_result: Result, tmp_path: Path, change: Callable[[str], str], words: str
) -> None:
    path = tmp_path / "results.json"
    path.write_text(change(dump_results(sample_result)), encoding="utf-8")

    with pytest.raises(InputError, match=words):
        load_results(path)


def test_a_cut_file_names_the_line(sample_result: Result, tmp_path: Path) -> None:
    path = tmp_path / "results.json"
    lines = dump_results(sample_result).splitlines()
    path.write_text("\n".join(lines[:12]), encoding="utf-8")

    with pytest.raises(InputError) as caught:
        load_results(path)
    assert caught.value.line == 12


def test_a_missing_file_is_an_input_error(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="No such file"):
        load_results(tmp_path / "absent.json")


def test_what_would_put_it_right_stands_with_each_reason_and_comes_back(
    sample_result: Result, tmp_path: Path
) -> None:
    swap = Correction(action="swap", frame="1.jpg", label="A", other="B")
    longer = Correction(action="length", length="L1", length_m=3.25)
    reason = Reason(
        cause="labels-swapped",
        text="They are swapped.",
        plain="A and B seem swapped.",
        mend=Remedy(action="swap", words="Swap A and B", corrections=(swap,)),
        instead=(Remedy(action="length", words="Correct L1", corrections=(longer,)),),
    )
    bare = Reason(cause="misfit", text="It does not fit.")
    verdict = Verdict(level="amber", reasons=(reason, bare))
    content = json.loads(dump_results(replace(sample_result, verdict=verdict)))
    (tmp_path / "results.json").write_text(json.dumps(content))
    first, second = content["verdict"]["reasons"]

    assert load_results(tmp_path / "results.json").verdict == verdict
    assert first["mend"] == {
        "action": "swap",
        "words": "Swap A and B",
        "corrections": [{"action": "swap", "frame": "1.jpg", "label": "A", "other": "B"}],
    }
    assert first["instead"][0]["corrections"] == [
        {"action": "length", "length": "L1", "length_m": 3.25}
    ]
    assert not {"plain", "mend", "instead"} & set(second)


def test_correlations_of_the_orientation_come_back(sample_result: Result, tmp_path: Path) -> None:
    known = OrientationCorrelation(
        parameters=("fx", "plane height"),
        shared=np.array([[1.0, np.nan], [np.nan, np.nan]]),
        frame_id=sample_result.frames.frame_id[:1],
        with_pose=np.arange(12.0).reshape(1, 6, 2) / 100.0,
    )
    path = tmp_path / "results.json"
    write_results(replace(sample_result, orientation=known), path)
    read = load_results(path).orientation

    assert read is not None
    assert (read.parameters, read.frame_id) == (known.parameters, known.frame_id)
    np.testing.assert_array_equal(read.shared, known.shared)
    np.testing.assert_array_equal(read.with_pose, known.with_pose)


# A readout time in results.json; and files of versions that knew none.


def test_readout_and_sweep_come_back(tmp_path: Path) -> None:
    result = sample_result()
    sweep = np.arange(6.0 * len(result.frames.frame_id)).reshape(-1, 6)
    known = Readout(value_s=0.033, sigma_s=0.005)
    result = replace(
        result,
        camera=replace(result.camera, readout=known),
        frames=replace(result.frames, sweep=sweep),
        shared=replace(
            result.shared,
            readout_s=Estimate(value=np.array([0.031]), sigma=np.array([0.004])),
        ),
    )
    write_results(result, tmp_path / "results.json")
    content = json.loads((tmp_path / "results.json").read_text())
    again = load_results(tmp_path / "results.json")

    assert content["shared"]["readout_s"] == {"value": 0.031, "sigma": 0.004}
    assert again.camera.readout == known
    assert again.shared.readout_s is not None
    assert again.shared.readout_s.value[0] == 0.031
    np.testing.assert_array_equal(again.frames.sweep, sweep)


# Reliability, second order, removals and overall checks in results.json, and back.


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
