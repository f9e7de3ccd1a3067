"""Who picked a point follows it into tables, maps and drawings."""

from __future__ import annotations

import csv
import io
import json
from dataclasses import replace
from pathlib import Path

import pytest
from ezdxf.entities.insert import Insert
from ezdxf.filemanagement import readfile

from uavgram.io.exports.dxf import write_local_dxf
from uavgram.io.exports.geojson import dump_geojson
from uavgram.io.exports.measurements_csv import dump_measurements_csv
from uavgram.model.result.result import Result
from uavgram.model.survey.observations import Source
from uavgram.stages.products.map_layers import features_of


@pytest.fixture(scope="module")
def found(result: Result) -> tuple[Result, str, str]:
    """The ends of a distance: one is a target, the other was picked once and matched."""
    rows = result.measurements
    target, matched = rows.points[rows.kind.index("distance")]
    first = result.picks.label.index(matched)
    sources: list[Source] = []
    for k, label in enumerate(result.picks.label):
        is_match = label == matched and k != first
        sources.append("target" if label == target else "match" if is_match else "hand")
    picks = replace(result.picks, source=tuple(sources))
    return replace(result, picks=picks), target, matched


def test_it_stands_in_the_table_of_measurements(found: tuple[Result, str, str]) -> None:
    result, target, matched = found
    for row in csv.DictReader(io.StringIO(dump_measurements_csv(result))):
        ends = set(row["points"].split(";"))
        said = set(row["picked_by"].split(";"))
        assert ("target" in said) == (target in ends)
        assert ("match" in said) == (matched in ends)


def test_it_stands_on_the_map(found: tuple[Result, str, str]) -> None:
    result, target, matched = found
    made = {
        one["properties"]["label"]: one["properties"]["picked_by"]
        for one in json.loads(dump_geojson(result))["features"]
        if one["properties"]["type"] == "point"
    }
    assert made.pop(target) == ["target"]
    assert made.pop(matched) == ["hand", "match"]
    assert set(map(tuple, made.values())) == {("hand",)}
    points = features_of(result, result.world.crs).layer("points").attributes
    said = dict(zip(points["label"], points["picked_by"], strict=True))
    assert (said[target], said[matched]) == ("target", "hand; match")


def test_it_stands_in_the_drawing_where_a_person_did_not_pick_alone(
    found: tuple[Result, str, str], tmp_path: Path
) -> None:
    result, target, matched = found
    write_local_dxf(features_of(result, result.world.crs), tmp_path / "d.dxf")
    said = {
        insert.get_attrib_text("LABEL"): insert.get_attrib_text("PICKED_BY")
        for insert in readfile(tmp_path / "d.dxf").modelspace().query("INSERT")
        if isinstance(insert, Insert) and insert.has_attrib("PICKED_BY")
    }
    assert said == {target: "target", matched: "hand; match"}
