"""No cell that we write runs in a spreadsheet, and every text is read back as it was."""

from __future__ import annotations

import csv
import re
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from uavgram.io.tables.csv_tables import Columns, guarded, read_table, readable, runs
from uavgram.io.tables.new_picks import new_picks
from uavgram.io.tables.rewrite import new_table
from uavgram.model.limits import UNSHOWABLE
from uavgram.model.survey.observations import ImportedPicks

COMMAND = "=cmd|' /C calc'!A0"
FORMULA = re.compile(r"[\s]*[=+\-@＝＋－＠]|\t|\r|\n")
NUMBER = re.compile(r"[-+]?[0-9]*\.?[0-9]*([eE][-+]?[0-9]+)?")
TEXT = st.text(st.sampled_from("=+-@\t\r\n＝＋－＠'; \"a5.e\0,"), max_size=9) | st.text()


@given(TEXT)
def test_every_text_comes_back_and_no_part_of_it_begins_a_formula(text: str) -> None:
    cell = guarded(text)
    assert readable(cell) == text
    for part in cell.split(";"):
        assert not FORMULA.match(part) or NUMBER.fullmatch(part)
    assert not runs(cell)


@pytest.mark.parametrize(
    ("text", "cell"),
    [
        (COMMAND, "'" + COMMAND),
        ("+1+1", "'+1+1"),
        ("-A", "'-A"),
        ("@SUM(A1)", "'@SUM(A1)"),
        ("＝1+1", "'＝1+1"),
        ("\t=1", "'\t=1"),
        ("P1;=1+1", "P1;'=1+1"),
        ("'=1", "''=1"),
        ("-5", "-5"),
        ("+1.5e3", "+1.5e3"),
        ("skid left", "skid left"),
        ("'tis", "'tis"),
        ("O'Neil=2", "O'Neil=2"),
        ("", ""),
    ],
)
def test_what_runs_gets_an_apostrophe_and_what_does_not_stays(text: str, cell: str) -> None:
    assert guarded(text) == cell
    assert readable(text if cell == text else cell) == text


@given(
    st.lists(
        TEXT.map(str.strip).filter(lambda text: text and not UNSHOWABLE.search(text)),
        min_size=1,
        max_size=3,
    )
)
def test_a_table_reads_what_the_page_wrote(
    tmp_path_factory: pytest.TempPathFactory, names: list[str]
) -> None:
    path = tmp_path_factory.getbasetemp() / "written.csv"
    path.write_bytes(new_table(["name", "kind"], [{"name": n, "kind": "x"} for n in names]))
    table = read_table(path, Columns(text=("name", "kind")))
    assert table.text["name"] == tuple(names)
    with path.open(encoding="utf-8", newline="") as stream:
        assert not any(runs(cell) for row in csv.reader(stream) for cell in row)


def test_imported_labels_are_guarded(tmp_path: Path) -> None:
    picks = ImportedPicks(
        image=("-a.jpg",),
        label=(COMMAND,),
        pixel_px=np.array([[1.0, 2.0]]),
        known=None,
        messages=(),
    )
    content = new_picks(picks, tmp_path / "picks.csv").decode()
    assert f"'-a.jpg,'{COMMAND},1.0,2.0" in content
