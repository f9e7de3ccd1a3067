"""Areas of the ground, from the column of picks.csv to results.json."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Protocol

import numpy as np
import pytest
from csv_rows import read_rows, write_rows
from flight_projects import Truth, copy_project

import uavgram
from uavgram.errors import InputError
from uavgram.io.results.results_json import dump_results, load_results


class Write(Protocol):
    """`area_of` says the area of a row of picks.csv by its number and label."""

    def __call__(self, area_of: Callable[[int, str], str], **changes: object) -> Path: ...


EAST = ("R1", "R2", "R3", "R4", "R5")


@pytest.fixture
def project(data_dir: Path, tmp_path: Path) -> Write:
    """The calm twin, with some of its points on an area of their own."""

    def write(area_of: Callable[[int, str], str], **changes: object) -> Path:
        rows = read_rows(data_dir / "calm_nadir" / "picks.csv")
        path = tmp_path / "picks.csv"
        write_rows(
            path,
            [row | {"area": area_of(number, row["label"])} for number, row in enumerate(rows)],
        )
        changes = {"picks": str(path)} | changes
        return copy_project(data_dir / "calm_nadir", tmp_path, **changes)

    return write


def test_points_of_an_area_get_a_plane_of_their_own(
    project: Write, truth: Callable[[str], Truth], tmp_path: Path
) -> None:
    ground = {"areas": {"verge": {"height_sigma_m": 0.5}, "lawn": {}}}
    path = project(lambda _, label: "verge" if label in EAST else "", ground=ground)
    result = uavgram.run(path, output=None)

    assert [area.name for area in result.areas] == ["default", "verge"]
    assert result.areas[0].height_m.value == result.plane.height_m.value
    assert [m.text for m in result.messages if m.code == "area-unpicked"] == [
        "The ground's area 'lawn' is not used: no usable pick names it in the column `area` of "
        "picks.csv. Name it there, or take it out of the project."
    ]
    known = truth("calm_nadir")
    true = np.array([known["measurements"][name] for name in result.measurements.name])
    error = result.measurements.value - true
    assert np.mean(np.abs(error) / true) <= 0.004
    assert np.sqrt(np.mean((error / result.measurements.sigma) ** 2)) <= 2.6

    file = tmp_path / "results.json"
    file.write_text(dump_results(result), encoding="utf-8")
    again = load_results(file).areas
    assert [area.name for area in again] == ["default", "verge"]
    np.testing.assert_array_equal(again[1].slope_deg.sigma, result.areas[1].slope_deg.sigma)


def test_a_point_in_two_areas_is_told_with_its_line(project: Write) -> None:
    path = project(lambda number, _: "road" if number % 2 else "verge")
    with pytest.raises(InputError, match=r"picks.csv:\d+: area of label '\w+' is '\w+' here"):
        uavgram.run(path, output=None)
