"""Projects with lines of known position: poses from them alone, their tests, what goes out."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from csv_rows import read_rows, write_rows
from kerb_projects import kerb_project

from uavgram.errors import InputError
from uavgram.io.results.results_json import load_results, write_results
from uavgram.model.result.result import Result
from uavgram.pipeline.check import check
from uavgram.pipeline.measure.compute import compute
from uavgram.pipeline.measure.inputs import read_inputs
from uavgram.stages.products.map_layers import features_of


def computed(path: Path) -> Result:
    return compute(read_inputs(path), curved=False).result


def codes(result: Result) -> set[str]:
    return {message.code for message in result.messages}


@pytest.fixture(scope="module")
def kerbs(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Result]:
    made = kerb_project(tmp_path_factory.mktemp("kerbs"), 3, points=3, photos=2)
    return made.path, computed(made.path)


def test_lines_alone_place_photos_on_the_map(kerbs: tuple[Path, Result]) -> None:
    _, result = kerbs

    assert result.world.gauge == "world"
    assert set(result.frames.status) == {"refined"}
    checks = result.point_checks
    assert len(checks.label) == 4
    assert np.abs(checks.error_m[:, :2] / checks.sigma_m[:, :2]).max() < 4.0
    assert result.control_lines.status == ("used",) * 5
    off = result.control_lines.offset_m
    assert np.abs(off / result.control_lines.sigma_m).max() < 4.0
    assert result.verdict.level == "green"


def test_lines_stand_in_results_and_are_drawn(kerbs: tuple[Path, Result], tmp_path: Path) -> None:
    _, result = kerbs
    write_results(result, tmp_path / "results.json")
    read = load_results(tmp_path / "results.json")

    assert read.control_lines.name == result.control_lines.name
    np.testing.assert_array_equal(
        read.control_lines.start_world_m, result.control_lines.start_world_m
    )
    layers = {layer.name: layer for layer in features_of(result, None).layers}
    assert len(layers["control_lines"]) == 5
    rows = {name: i for i, name in enumerate(result.known.name)}
    for i, name in enumerate(result.control_lines.name):
        assert result.known.kind[rows[name]] == "on_line"
        assert result.known.w[rows[name]] == result.control_lines.w[i]


def test_a_line_in_a_wrong_place_is_named(tmp_path: Path) -> None:
    made = kerb_project(tmp_path, 6, points=4, photos=3, shift=(1, 0.6))
    result = computed(made.path)
    lines = result.control_lines

    assert result.verdict.level != "green"
    assert lines.status[1] in ("suspect", "removed")
    assert {"known-suspect", "known-left-out"} & codes(result)


def test_too_few_lines_for_a_place_are_told(tmp_path: Path) -> None:
    made = kerb_project(tmp_path, 1, kerbs=2)  # both from west to east
    (tmp_path / "lines.csv").write_text(
        "name,from,to,length_m,sigma_m\n"
        "ab,A,B,14.866,0.01\nac,A,C,10.05,0.01\nbd,B,D,10.05,0.01\ncd,C,D,15.0,0.01\n",
        encoding="utf-8",
    )
    made.path.write_text(made.path.read_text(encoding="utf-8") + "lines: lines.csv\n")
    result = computed(made.path)

    assert result.world.gauge == "plane"
    assert set(result.known.status) == {"idle"}
    told = next(m for m in result.messages if m.code == "known-idle")
    assert "three picked points on lines that are not all parallel" in told.text
    assert not result.control_lines.name


def test_lines_on_the_earth_are_the_world(tmp_path: Path) -> None:
    """The same kerbs in latitude and longitude, by pyproj: the same distances."""
    from pyproj import Transformer

    made = kerb_project(tmp_path, 3, points=3, photos=2)
    local = computed(made.path)
    to_earth = Transformer.from_pipeline(
        "+proj=pipeline +step +inv +proj=topocentric +ellps=WGS84 +lat_0=47 +lon_0=8 +h_0=0 "
        "+step +inv +proj=cart +ellps=WGS84"
    )
    table = tmp_path / "control_lines.csv"
    rows = read_rows(table)
    for row in rows:
        for end in ("start", "end"):
            east, north = (float(row.pop(f"{end}_{axis}_m")) for axis in ("east", "north"))
            longitude, latitude, _ = to_earth.transform(east, north, 0.0)
            row[f"{end}_latitude_deg"], row[f"{end}_longitude_deg"] = latitude, longitude
    write_rows(table, rows)
    text = made.path.read_text(encoding="utf-8").replace("check: check.csv\n", "")
    made.path.write_text(text, encoding="utf-8")
    result = computed(made.path)

    assert "origin-control" in codes(result)
    np.testing.assert_allclose(result.measurements.value, local.measurements.value, atol=2e-4)


def test_a_line_called_like_a_known_thing_is_refused(tmp_path: Path) -> None:
    made = kerb_project(tmp_path, 1)
    (tmp_path / "known.csv").write_text(
        "name,kind,points,sigma\nkerb 1,right_angle,A;B;C,0.3\n", encoding="utf-8"
    )
    made.path.write_text(made.path.read_text(encoding="utf-8") + "known: known.csv\n")

    with pytest.raises(InputError, match=r"line 'kerb 1' has the name of a known thing"):
        read_inputs(made.path)


def test_check_names_points_of_lines_that_nobody_picked(tmp_path: Path) -> None:
    made = kerb_project(tmp_path, 1)
    table = tmp_path / "control_lines.csv"
    table.write_text(table.read_text(encoding="utf-8").replace("k0p0;", "k0q0;"))
    messages = check(made.path).messages

    assert any(m.code == "label-unseen" and "k0q0" in m.text for m in messages)
    assert not any(m.code == "no-scale" for m in messages)
