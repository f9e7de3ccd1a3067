"""control_lines.csv: what it holds, and every mistake refused in plain words with its line."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from uavgram.errors import InputError
from uavgram.io.tables.known import read_control_lines
from uavgram.model.survey.known import STRAIGHTNESS_M, ControlLines

PLAN = "start_east_m,start_north_m,end_east_m,end_north_m"
HEADER = f"name,points,{PLAN},start_up_m,end_up_m,sigma_m,use\n"
EARTH = (
    "name,points,start_latitude_deg,start_longitude_deg,end_latitude_deg,end_longitude_deg,sigma_m"
)


def read(folder: Path, *rows: str, header: str = HEADER) -> ControlLines:
    path = folder / "control_lines.csv"
    path.write_text(header + "\n".join(rows) + "\n", encoding="utf-8")
    return read_control_lines(path)


def test_ends_heights_sigmas_and_uses_are_read(tmp_path: Path) -> None:
    header = HEADER.replace("use\n", "sigma_up_m,straightness_m,use\n")
    lines = read(
        tmp_path,
        "kerb,A;B,0,0,10,2,1.5,1.7,0.01,0.03,0.02,",
        "edge,C,5,5,5,15,,,0.02,,,check",
        header=header,
    )

    assert lines.kind == "local"
    assert lines.points == (("A", "B"), ("C",))
    np.testing.assert_array_equal(lines.coordinates[0], [[0, 0, 1.5], [10, 2, 1.7]])
    np.testing.assert_array_equal(lines.coordinates[1, :, :2], [[5, 5], [5, 15]])
    assert np.isnan(lines.coordinates[1, :, 2]).all()
    np.testing.assert_array_equal(lines.sigma_m[0], [[0.01, 0.01, 0.03]] * 2)
    np.testing.assert_array_equal(lines.straightness_m, [0.02, STRAIGHTNESS_M])
    assert lines.adjust.tolist() == [True, False]


def test_lines_may_be_on_the_earth(tmp_path: Path) -> None:
    lines = read(tmp_path, "kerb,A,47.0,8.0,47.0001,8.0,0.01", header=EARTH + "\n")

    assert lines.kind == "geodetic"
    np.testing.assert_array_equal(lines.coordinates[0, :, :2], [[47.0, 8.0], [47.0001, 8.0]])


@pytest.mark.parametrize(
    ("row", "says"),
    [
        ("k,,0,0,9,0,,,0.01,", "points is empty"),
        ("k,A;A,0,0,9,0,,,0.01,", "names a label twice"),
        ("k,A,0,0,,0,,,0.01,", "end_east_m is empty"),
        ("k,A,0,0,9,0,1.0,,0.01,", "end_up_m is empty, but the other end has a height: give both"),
        ("k,A,0,0,0.2,0.1,,,0.01,", "0.22 m apart seen from above, which gives the line no"),
        ("k,A,0,0,9,0,,,0,", "sigma_m"),
        ("k,A,0,0,9,0,,,0.01,chek", r"use must be adjust or check \(got 'chek'\): did you mean"),
    ],
)
def test_a_wrong_row_is_refused_with_its_line(tmp_path: Path, row: str, says: str) -> None:
    with pytest.raises(InputError, match=says) as refused:
        read(tmp_path, "right,A,0,0,9,0,,,0.01,", row)
    assert "line 3" in str(refused.value) or ":3" in str(refused.value)


@pytest.mark.parametrize(
    ("header", "says"),
    [
        (
            f"name,points,{PLAN},start_latitude_deg,start_longitude_deg,end_latitude_deg,"
            "end_longitude_deg,sigma_m",
            "has both",
        ),
        ("name,points,sigma_m", "columns are missing: give either .* or start_east_m"),
        ("name,points,start_east_m,start_north_m,end_east_m,sigma_m", "'end_north_m' is missing"),
    ],
)
def test_a_wrong_header_is_refused(tmp_path: Path, header: str, says: str) -> None:
    cells = ",".join(["k", "A", *["1"] * (header.count(",") - 1)])
    with pytest.raises(InputError, match=says):
        read(tmp_path, cells, header=header + "\n")


def test_names_are_not_used_twice(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="line 'k' is already in line 2"):
        read(tmp_path, "k,A,0,0,9,0,,,0.01,", "k,B,0,5,9,5,,,0.01,")
