"""What other solutions would change, in results.json, measurements.csv and points.geojson."""

from __future__ import annotations

import csv
import io
import json
from pathlib import Path

import pytest
from unsure import unsure

from uavgram.io.exports.geojson import dump_geojson
from uavgram.io.exports.measurements_csv import dump_measurements_csv
from uavgram.io.results.results_json import dump_results, load_results
from uavgram.model.result.result import Result


@pytest.fixture
def marked(sample_result: Result) -> Result:
    return unsure(sample_result, "o", (31.25, 44.9))


def test_results_json_has_them_with_the_measurement_and_gives_them_back(
    marked: Result, tmp_path: Path
) -> None:
    path = tmp_path / "results.json"
    path.write_text(dump_results(marked), encoding="utf-8")
    kept = {
        m["name"]: m["alternative_values"] for m in json.loads(path.read_text())["measurements"]
    }

    assert kept == {**{name: [] for name in kept}, "o": [31.25, 44.9]}
    back = load_results(path)
    assert back.measurements.alternative_values == marked.measurements.alternative_values
    assert dump_results(back) == dump_results(marked)


def test_the_csv_joins_them(marked: Result) -> None:
    rows = list(csv.DictReader(io.StringIO(dump_measurements_csv(marked))))

    assert [row["alternatives"] for row in rows] == ["", "", "31.25000;44.90000", "", "", ""]


def test_the_geojson_lists_them(marked: Result) -> None:
    features = json.loads(dump_geojson(marked))["features"]
    kept = {
        f["properties"]["name"]: f["properties"]["alternative_values"]
        for f in features
        if f["properties"]["type"] == "measurement"
    }

    assert kept == {**{name: [] for name in kept}, "o": [31.25, 44.9]}
