"""known.csv: what it holds, and every mistake refused in plain words with its line."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from uavgram.errors import InputError
from uavgram.estimation.survey.known_kinds import KNOWN_KINDS
from uavgram.io.tables.known import read_control_lines, read_known, read_lines
from uavgram.io.tables.updates import update_lines
from uavgram.model.observations import STRAIGHTNESS_M, ControlLines, KnownThings
from uavgram.picking.document import commands as c
from uavgram.picking.document.history import apply_change
from uavgram.picking.document.state import State, make_observations, make_state

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


# lines.csv: which tape, and what was measured; read, refused in plain words, and written back.


TABLE = (
    "name,from,to,length_m,sigma_m,tape,along\n"
    "L1,A,B,11.5,0.01,red,horizontal\n"
    "L2,A,C,12.5,0.01,,\n"
)


def read_tapes(folder: Path, text: str) -> State:
    (folder / "lines.csv").write_text(text)
    lines = read_lines(folder / "lines.csv")
    assert lines.tape == ("red", "")
    assert lines.along == ("horizontal", "slope")
    none, _ = make_observations(State())
    return make_state(none, lines, ())


def test_tape_and_along_come_back_from_the_page_as_they_were(tmp_path: Path) -> None:
    state = read_tapes(tmp_path, TABLE)
    _, before = make_observations(state)
    change = c.SetLine(
        was="L1", name="L1", start="A", end="B", length_m=11.6, sigma_m=0.01, adjust=True
    )
    _, after = make_observations(apply_change(state, change))

    assert (after.tape, after.along) == (before.tape, before.along)
    assert update_lines(TABLE.encode(), before, after) == TABLE.replace("11.5", "11.6").encode()
    _, blue = make_observations(apply_change(state, replace(change, tape="blue", along="slope")))
    written = update_lines(TABLE.encode(), before, blue)
    assert written == TABLE.replace("11.5,0.01,red,horizontal", "11.6,0.01,blue,").encode()


def test_another_way_to_measure_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"along must be slope or horizontal \(got 'horizontl'\)"):
        read_tapes(tmp_path, TABLE.replace("horizontal", "horizontl"))


# control_lines.csv: what it holds, and every mistake refused in plain words with its line.


PLAN = "start_east_m,start_north_m,end_east_m,end_north_m"
HEADER_CONTROL_LINES = f"name,points,{PLAN},start_up_m,end_up_m,sigma_m,use\n"
EARTH = (
    "name,points,start_latitude_deg,start_longitude_deg,end_latitude_deg,end_longitude_deg,sigma_m"
)


def read_control(folder: Path, *rows: str, header: str = HEADER_CONTROL_LINES) -> ControlLines:
    path = folder / "control_lines.csv"
    path.write_text(header + "\n".join(rows) + "\n", encoding="utf-8")
    return read_control_lines(path)


def test_ends_heights_sigmas_and_uses_are_read(tmp_path: Path) -> None:
    header = HEADER_CONTROL_LINES.replace("use\n", "sigma_up_m,straightness_m,use\n")
    lines = read_control(
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
    lines = read_control(tmp_path, "kerb,A,47.0,8.0,47.0001,8.0,0.01", header=EARTH + "\n")

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
        read_control(tmp_path, "right,A,0,0,9,0,,,0.01,", row)
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
        read_control(tmp_path, cells, header=header + "\n")


def test_names_are_not_used_twice(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="line 'k' is already in line 2"):
        read_control(tmp_path, "k,A,0,0,9,0,,,0.01,", "k,B,0,5,9,5,,,0.01,")
