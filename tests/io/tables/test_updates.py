from __future__ import annotations

import csv
import io
from collections.abc import Sequence
from pathlib import Path
from typing import Literal

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from uavgram.io.tables.csv_tables import unguard_formula
from uavgram.io.tables.known import read_lines
from uavgram.io.tables.measure import read_measure
from uavgram.io.tables.picks import read_picks
from uavgram.io.tables.updates import (
    create_table,
    rewrite_table,
    update_lines,
    update_measure,
    update_picks,
)
from uavgram.model.observations import KnownLines, MeasurementRequest, Picks

PickRow = tuple[str, str, *tuple[float, ...]]
"""Image, label, u, v and, where given, sigma and height."""

PICKS = (
    b"\xef\xbb\xbflabel,note,image,v_px, u_px ,sigma_px\r\n"
    b"A,corner of the kerb,P1.jpg,2.50,01.0,0.80\r\n"
    b"\r\n"
    b'"B","says ""hello"", twice",P1.jpg,4,3e0,\r\n'
    b",,,,,\r\n"
    b"A,,P2.jpg,6.000,5,1"
)


@pytest.fixture
def picks_file(tmp_path: Path) -> Path:
    path = tmp_path / "picks.csv"
    path.write_bytes(PICKS)
    return path


def picks_of(rows: Sequence[PickRow]) -> Picks:
    """Picks from rows of image, label, u, v and, where given, sigma and height."""
    numbers = [(*row[2:], *(np.nan,) * (6 - len(row))) for row in rows]
    return Picks(
        image=tuple(row[0] for row in rows),
        label=tuple(row[1] for row in rows),
        pixel_px=np.array([row[:2] for row in numbers], float).reshape(-1, 2),
        sigma_px=np.array([row[2] for row in numbers], float),
        height_m=np.array([row[3] for row in numbers], float),
    )


ROWS: list[PickRow] = [
    ("P1.jpg", "A", 1.0, 2.5, 0.8),
    ("P1.jpg", "B", 3.0, 4.0),
    ("P2.jpg", "A", 5.0, 6.0, 1.0),
]


def test_nothing_changed_is_the_same_bytes(picks_file: Path) -> None:
    picks = read_picks(picks_file)
    assert update_picks(PICKS, picks, picks) == PICKS


def test_a_moved_pick_changes_its_two_numbers_and_nothing_else(picks_file: Path) -> None:
    rows = [*ROWS[:1], ("P1.jpg", "B", 3.25, 4.0), *ROWS[2:]]
    written = update_picks(PICKS, read_picks(picks_file), picks_of(rows))
    assert written == PICKS.replace(b"P1.jpg,4,3e0,", b"P1.jpg,4,3.25,")


def test_a_renamed_and_moved_row_keeps_its_note_and_its_place(picks_file: Path) -> None:
    rows = [("P1.jpg", "kerb", 1.5, 2.5, 0.8), *ROWS[1:]]
    written = update_picks(PICKS, read_picks(picks_file), picks_of(rows))
    assert written == PICKS.replace(
        b"A,corner of the kerb,P1.jpg,2.50,01.0,", b"kerb,corner of the kerb,P1.jpg,2.50,1.5,"
    )


def test_a_new_pick_comes_last_and_the_file_still_ends_without_line_break(picks_file: Path) -> None:
    rows = [*ROWS, ("P2.jpg", "C", 7.125, 8.0)]
    written = update_picks(PICKS, read_picks(picks_file), picks_of(rows))
    assert written == PICKS + b"\r\nC,,P2.jpg,8.0,7.125,"


def test_a_new_pick_does_not_inherit_the_note_of_one_that_was_removed_last(tmp_path: Path) -> None:
    path = tmp_path / "picks.csv"
    path.write_bytes(b"image,label,u_px,v_px,note\nP1.jpg,A,1,2,old\n")
    written = update_picks(
        path.read_bytes(), read_picks(path), picks_of([("P1.jpg", "Z", 9.0, 9.0)])
    )
    assert written == b"image,label,u_px,v_px,note\nP1.jpg,Z,9.0,9.0,\n"


def test_a_removed_pick_takes_its_line_alone(picks_file: Path) -> None:
    written = update_picks(PICKS, read_picks(picks_file), picks_of([ROWS[0], ROWS[2]]))
    lines = PICKS.splitlines(keepends=True)
    assert written == b"".join(line for line in lines if not line.startswith(b'"B"'))


def test_a_column_is_added_only_where_a_value_needs_it(picks_file: Path) -> None:
    high = [*ROWS[:2], (*ROWS[2], 0.12)]
    written = update_picks(PICKS, read_picks(picks_file), picks_of(high))
    assert written is not None
    assert written.startswith(b"\xef\xbb\xbflabel,note,image,v_px, u_px ,sigma_px,height_m\r\n")
    assert written.endswith(b"A,,P2.jpg,6.000,5,1,0.12")
    assert b'"B","says ""hello"", twice",P1.jpg,4,3e0,,\r\n' in written
    picks_file.write_bytes(written)
    assert read_picks(picks_file).height_m[2] == 0.12


def test_a_table_with_semicolons_and_decimal_commas_stays_one(tmp_path: Path) -> None:
    path = tmp_path / "lines.csv"
    path.write_bytes(b'name;from;to;length_m;sigma_m;note\nL1;A;B;12,001;0,010;"a;b"\n')
    before = read_lines(path)
    after = KnownLines(
        name=("L1", "L2"),
        start=("A", "C"),
        end=("B", "D"),
        length_m=np.array([12.001, 3.5]),
        sigma_m=np.array([0.02, 0.02]),
        adjust=np.array([True, True]),
    )
    content = update_lines(path.read_bytes(), before, after)
    assert content is not None
    path.write_bytes(content)
    assert path.read_bytes() == (
        b'name;from;to;length_m;sigma_m;note\nL1;A;B;12,001;0,02;"a;b"\nL2;C;D;3,5;0,02;\n'
    )
    assert read_lines(path).length_m.tolist() == [12.001, 3.5]


def test_a_new_length_that_is_adjusted_needs_no_column_that_says_so(tmp_path: Path) -> None:
    path = tmp_path / "lines.csv"
    path.write_bytes(b"name,from,to,length_m,sigma_m\nL1,A,B,11.5200,0.010\n")
    before = read_lines(path)
    after = KnownLines(
        name=("L1", "L2"),
        start=("A", "C"),
        end=("B", "D"),
        length_m=np.array([11.52, 3.0]),
        sigma_m=np.array([0.01, 0.02]),
        adjust=np.array([True, True]),
    )
    assert update_lines(path.read_bytes(), before, after) == path.read_bytes() + (
        b"L2,C,D,3.0,0.02,\n".replace(b",\n", b"\n")
    )
    withheld = KnownLines(
        name=after.name,
        start=after.start,
        end=after.end,
        length_m=after.length_m,
        sigma_m=after.sigma_m,
        adjust=np.array([True, False]),
    )
    assert update_lines(path.read_bytes(), before, withheld) == (
        b"name,from,to,length_m,sigma_m,use\nL1,A,B,11.5200,0.010,\nL2,C,D,3.0,0.02,check\n"
    )


def test_new_files_are_made_where_there_are_none_and_only_where_they_hold_something(
    tmp_path: Path,
) -> None:
    request = MeasurementRequest(
        name="skid, long",
        kind="skid_speed",
        points=("A", "B"),
        parameters=(("mu", 0.7), ("mu_sigma", 0.05)),
    )
    assert update_measure(None, (), ()) is None
    content = update_measure(None, (), (request,))
    assert content is not None
    path = tmp_path / "measure.csv"
    path.write_bytes(content)
    assert read_measure(path) == (request,)


TEXTS = st.text(alphabet='aB1 ,"\n\r;é', max_size=4).map(str.strip)
TABLES = st.lists(st.tuples(TEXTS, TEXTS, TEXTS), max_size=7)


@settings(max_examples=60)
@given(before=TABLES, after=TABLES, end=st.sampled_from(["\n", "\r\n"]), quote=st.booleans())
def test_any_table_becomes_what_it_should_hold_and_back_again(
    before: list[tuple[str, str, str]], after: list[tuple[str, str, str]], end: str, *, quote: bool
) -> None:
    """The truth is Python's own csv, which wrote the file and reads the outcome."""

    def rows_of(cells: list[tuple[str, str, str]]) -> list[dict[str, str]]:
        unique = {f"k{k}": row for k, row in enumerate(cells)}
        return [{"key": key, "a": a, "b": b} for key, (a, b, _) in unique.items()]

    out = io.StringIO()
    # Python's writer leaves a lone carriage return without quotes.
    style: Literal[0, 1] = (
        csv.QUOTE_ALL
        if quote or any("\r" in text for row in before for text in row)
        else csv.QUOTE_MINIMAL
    )
    writer = csv.writer(out, lineterminator=end, quoting=style)
    writer.writerow(["b", "key", "note", "a"])
    writer.writerows([b, f"k{k}", note, a] for k, (a, b, note) in enumerate(before))
    content = out.getvalue().encode()
    held, wanted = rows_of(before), rows_of(after)[::-1][: len(after)]
    wanted = sorted(wanted, key=lambda row: row["key"])
    written = rewrite_table(content, held, wanted, ("key",))
    read = list(csv.DictReader(io.StringIO(written.decode(), newline="")))
    # What a spreadsheet would run has an apostrophe, which every reader of ours takes off.
    assert [
        {name: unguard_formula(row[name]) for name in ("key", "a", "b")} for row in read
    ] == wanted
    notes = {f"k{k}": note for k, (_, _, note) in enumerate(before)}
    assert [row["note"] for row in read] == [notes.get(row["key"], "") for row in read]
    assert rewrite_table(content, held, held, ("key",)) == content


def test_a_new_table_quotes_what_needs_quotes() -> None:
    assert create_table(["a", "b"], [{"a": "x,y", "b": 'say "z"'}]) == b'a,b\n"x,y","say ""z"""\n'


def test_a_negative_number_with_a_decimal_comma_is_written_as_a_number() -> None:
    """Guarded against formulas, it would be read as text: no number."""
    before = b"name;length_m\na;1,5\n"
    rows = ({"name": "a", "length_m": "1.5"}, {"name": "b", "length_m": "-2.25"})
    written = rewrite_table(before, rows[:1], rows, ("name",))
    assert written.decode().splitlines()[-1] == "b;-2,25"
