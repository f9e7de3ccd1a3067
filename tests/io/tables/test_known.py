"""known.csv: what it holds, and every mistake refused in plain words with its line."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from uavgram.errors import InputError
from uavgram.estimation.survey.known_kinds.kinds import KNOWN_KINDS
from uavgram.io.tables.known import read_known
from uavgram.model.survey.known import KnownThings

HEADER = "name,kind,points,value,sigma,use\n"


def read(folder: Path, *rows: str, header: str = HEADER) -> KnownThings:
    path = folder / "known.csv"
    path.write_text(header + "\n".join(rows) + "\n", encoding="utf-8")
    return read_known(path)


def test_values_conditions_and_uses_are_read(tmp_path: Path) -> None:
    known = read(
        tmp_path,
        "lane,distance,A;B,3.50,0.02,",
        "corner,right_angle,A;B;C,,0.3,adjust",
        "kerb,line_distance,D;A;B,0,0.01,check",
    )

    assert known.kind == ("distance", "right_angle", "line_distance")
    assert known.points == (("A", "B"), ("A", "B", "C"), ("D", "A", "B"))
    np.testing.assert_array_equal(known.value, [3.5, np.nan, 0.0])
    assert known.adjust.tolist() == [True, True, False]
    assert [KNOWN_KINDS[kind].unit for kind in known.kind] == ["m", "deg", "m"]


def test_conditions_need_no_column_of_values(tmp_path: Path) -> None:
    points = {"right_angle": "A;B;C", "collinear": "A;B;C", "level": "A;B", "vertical": "A;B"}
    conditions = tuple(name for name, kind in KNOWN_KINDS.items() if not kind.has_value)
    rows = [f"{kind},{kind},{points.get(kind, 'A;B;C;D')},0.1" for kind in conditions]
    known = read(tmp_path, *rows, header="name,kind,points,sigma\n")

    assert known.kind == conditions
    assert np.isnan(known.value).all()


def test_two_equal_lengths_may_share_an_end(tmp_path: Path) -> None:
    known = read(tmp_path, "sides,equal_lengths,A;B;B;C,,0.01,")

    assert known.points == (("A", "B", "B", "C"),)


@pytest.mark.parametrize(
    ("row", "says"),
    [
        ("k,distence,A;B,3,0.1,", r"unknown kind 'distence': did you mean 'distance'"),
        ("k,speed,A;B,3,0.1,", r"kind 'speed' cannot be known: a speed says nothing of where"),
        (
            "k,azimuth,A;B,360,0.1,",
            r"kind azimuth must lie from 0 to less than 360 degrees",
        ),
        ("k,azimuth,A;B;C,90,0.1,", r"kind azimuth needs 2 labels"),
        ("k,coordinate,A,3,0.1,", r"kind 'coordinate' cannot be known: .*control.csv"),
        ("k,profile,A;B;C,3,0.1,", r"kind 'profile' cannot be known: it has no single value"),
        ("k,distance,A;B;C,3,0.1,", r"kind distance needs 2 labels joined by ';' \(got 3"),
        ("k,coplanar,A;B;C,,0.1,", r"kind coplanar needs at least 4 labels"),
        ("k,equal_lengths,A;B;C;D;E,,0.1,", r"needs both ends of each line \(got 5 points\)"),
        ("k,equal_lengths,A;B;B;A,,0.1,", r"kind equal_lengths names one line twice"),
        ("k,parallel,A;B;A;B,,0.1,", r"kind parallel names one line twice"),
        ("k,equal_lengths,A;A;C;D,,0.1,", r"names a line from 'A' to itself"),
        ("k,distance,A;A,3,0.1,", r"points names 'A' twice in a row"),
        ("k,distance,A;B,,0.1,", r"kind distance needs a value"),
        ("k,distance,A;B,0,0.1,", r"value of kind distance must be greater than 0 \(got 0\)"),
        ("k,distance,A;B,nan,0.1,", r"value must be a number \(got 'nan'\)"),
        ("k,line_distance,A;B;C,-1,0.1,", r"must not be negative \(got -1\)"),
        ("k,angle,A;B;C,180,0.1,", r"must lie between 0 and 180 degrees; .*kind collinear"),
        ("k,right_angle,A;B;C,90,0.1,", r"kind right_angle has no value: leave it empty"),
        ("k,distance,A;B,3,,", r"sigma is empty"),
        ("k,distance,A;B,3,0,", r"sigma must be greater than 0 \(got 0\)"),
        ("k,distance,A;B,3,0.1,chek", r"use must be adjust or check \(got 'chek'\)"),
    ],
)
def test_mistakes_are_named_with_their_line(tmp_path: Path, row: str, says: str) -> None:
    with pytest.raises(InputError, match=says) as caught:
        read(tmp_path, "fine,distance,A;B,3.5,0.02,", row)

    assert "known.csv:3" in str(caught.value)


def test_all_mistakes_are_told_at_once(tmp_path: Path) -> None:
    with pytest.raises(InputError) as caught:
        read(tmp_path, "k,distance,A;B,3,0.1,", "k,level,A,,-1,")

    text = str(caught.value)
    assert "known thing 'k' is already in line 2" in text
    assert "kind level needs at least 2 labels" in text
    assert "sigma must be greater than 0" in text
