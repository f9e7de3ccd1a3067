"""CSV tables: every kind of broken file gives its message with the right line."""

from __future__ import annotations

import csv
import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from uavgram.errors import InputError
from uavgram.io.tables.csv_tables import (
    Columns,
    Table,
    find_own_columns,
    guard_formula,
    is_formula,
    parse_number,
    read_table,
    unguard_formula,
)
from uavgram.io.tables.updates import create_picks, create_table
from uavgram.model.limits import UNSHOWABLE, find_unshowable
from uavgram.model.observations import ImportedPicks

Read = Callable[[str | bytes], Table]
ReadOwn = Callable[[str], Table]

COLUMNS = Columns(
    text=("name",), numbers=("length_m",), optional_text=("use",), optional_numbers=("sigma_m",)
)
OWN = Columns(text=("name",), numbers=("length_m",), optional_numbers=("sigma_m",), others=True)


@pytest.fixture
def read(tmp_path: Path) -> Read:
    def _read(content: str | bytes) -> Table:
        path = tmp_path / "t.csv"
        path.write_bytes(content.encode() if isinstance(content, str) else content)
        table = read_table(path, COLUMNS)
        table.raise_faults()
        return table

    return _read


@pytest.fixture
def read_own(tmp_path: Path) -> ReadOwn:
    def _read(content: str) -> Table:
        path = tmp_path / "own.csv"
        path.write_text(content, encoding="utf-8", newline="")
        return read_table(path, OWN)

    return _read


@pytest.mark.parametrize(
    "content",
    [
        "name,length_m,use,sigma_m\na,1.5,,\nb,2,check,0.1\n",
        b"\xef\xbb\xbfname,length_m,use,sigma_m\r\na,1.5,,\r\nb,2,check,0.1\r\n",
        "sigma_m,use,length_m,name\n,, 1.5 ,a\n\n,,,\n0.1,check,2,b",
        'name,"length_m",use,sigma_m\n"a",1.5,,\n"b",2,check,1e-1\n\n\n',
    ],
    ids=["plain", "spreadsheet", "other order, blank lines", "quotes"],
)
def test_the_same_table_in_several_dialects(read: Read, content: str | bytes) -> None:
    table = read(content)

    assert table.text == {"name": ("a", "b"), "use": ("", "check")}
    np.testing.assert_array_equal(table.numbers["length_m"], [1.5, 2.0])
    np.testing.assert_array_equal(table.numbers["sigma_m"], [np.nan, 0.1])


def test_absent_optional_columns_are_empty(read: Read) -> None:
    table = read("name,length_m\na,1\n")

    assert table.text["use"] == ("",)
    assert np.isnan(table.numbers["sigma_m"]).all()
    assert table.header == ("name", "length_m")


def test_rows_keep_their_line_numbers_across_blank_lines_and_quoted_breaks(
    read_own: ReadOwn,
) -> None:
    table = read_own('name,length_m,remark\n\na,1,"of\ntwo lines"\n,,\nc,2,\n')

    assert table.line.tolist() == [3, 6]


@pytest.mark.parametrize(
    ("content", "line", "words"),
    [
        ("", 1, "the file is empty"),
        ("\n\n", 1, "the file is empty"),
        ("name;length_m\na;12,001\n", 2, "is it 12.001 or 12001? Write it without a comma"),
        ("name;length_m\na;1.234,5\n", 2, "with one decimal point, and no comma"),
        ("name\tlength_m\na\t1\n", 1, "by tabs: save the table as CSV with commas"),
        ("name,sigma_m\na,1\n", 1, "column 'length_m' is missing"),
        ("name,length_m,sigma\na,1,1\n", 1, "unknown column 'sigma': did you mean 'sigma_m'?"),
        ("name,length_m,xyz\na,1,1\n", 1, "unknown column 'xyz': known are name, length_m"),
        ("name,length_m,name\na,1,b\n", 1, "column 'name' is there twice"),
        ("name,length_m\na,1\nb,2,3\n", 3, "3 cells, but the header has 2: write 6.98 for 6,98"),
        ("name,length_m\na\n", 2, "1 cells, but the header has 2"),
        ("name,length_m\n,1\n", 2, "name is empty"),
        ("name,length_m\na,\n", 2, "length_m is empty"),
        ("name,length_m\na,1\nb,x\n", 3, "length_m must be a number (got 'x')"),
        ('name,length_m\na,"12,001"\n', 2, "is it 12.001 or 12001?"),
        ("name,length_m\na,12 m\n", 2, "write the number alone"),
        ("name,length_m\na,nan\n", 2, "must be a number (got 'nan')"),
        ("name,length_m\na,-inf\n", 2, "must be a number (got '-inf')"),
        ("name,length_m\na,1e999\n", 2, "must be a number (got '1e999')"),
        ("name,length_m\na,-2e10\n", 2, "(got '-2e10'): it is far too large"),
        ("name,length_m\na\x0cb,1\n", 2, "name holds the control character '\\x0c'"),
        ("name,length_m\na\x1b[31m,1\n", 2, "name holds the control character '\\x1b'"),
        ("name,length_m,use\na,1,\ufffe\n", 2, "use holds the control character '\\ufffe'"),
        ('name,length_m\n"a\nb",1\n', 2, "name holds a line break"),
        ("name,length_m\nP\u202e1,1\n", 2, "character U+202E (right-to-left override)"),
        ("name,length_m\nP1\u200b,1\n", 2, "invisible character U+200B (zero width space)"),
        ("name,length_m\nP1\u200d,1\n", 2, "invisible character U+200D (zero width joiner)"),
        ("name,length_m\na,1_000\n", 2, "must be a number (got '1_000')"),
        ("name,length_m\na,٣\n", 2, "must be a number"),
        ("name,length_m,sigma_m\na,1,?\n", 2, "sigma_m must be a number"),
        ('name,length_m\na,1\n"b,2\n', 3, 'is a quote (") missing?'),
        (b"name,length_m\na,1\n\xe9,2\n", 3, "UTF-8"),
        ("name,length_m\na,1\n".encode("utf-16"), 1, "UTF-16"),
        ("name,length_m\na,1\n".encode("utf-16-le"), 1, "UTF-16"),
        ("name,length_m\na,1\n".encode("utf-16-be"), 1, "UTF-16"),
    ],
)
def test_a_mistake_is_named_with_its_line(
    read: Read, content: str | bytes, line: int, words: str
) -> None:
    with pytest.raises(InputError) as caught:
        read(content)

    assert caught.value.line == line
    assert words in caught.value.message
    assert "\n" not in caught.value.message


def test_all_mistakes_come_at_once(read: Read) -> None:
    with pytest.raises(InputError) as caught:
        read("name,length_m\na,x\n,2\nc,y\n")

    assert [line.split("t.csv:")[1][0] for line in str(caught.value).splitlines()] == list("234")


def test_a_missing_file_is_an_input_error(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="No such file"):
        read_table(tmp_path / "absent.csv", COLUMNS)


CELL = st.sampled_from(["a", " b ", "", "1", "1e3", "1_0", "nan", "\t", "'=x", "\u2028", "c\x00"])


@given(
    rows=st.lists(st.lists(CELL, min_size=0, max_size=5), max_size=8),
    end=st.sampled_from(["\n", "\r\n", "\r"]),
)
def test_what_is_read_many_rows_at_a_time_is_what_is_read_one_by_one(
    tmp_path_factory: pytest.TempPathFactory, rows: list[list[str]], end: str
) -> None:
    path = tmp_path_factory.getbasetemp() / "plain.csv"

    def content(header: str) -> object:
        path.write_bytes(end.join([header, *map(",".join, rows)]).encode())
        try:
            table = read_table(path, COLUMNS)
        except InputError as fault:
            return str(fault)
        return table.text, repr(table.numbers), table.line.tolist(), table.faults

    # A quote anywhere has the rows read by Python's csv one by one.
    assert content("name,length_m,use,sigma_m") == content('name,"length_m",use,sigma_m')


@pytest.mark.parametrize("text", ["1", "-2.5", "+.5", "3.", "1e-3", "007"])
def test_decimal_numbers_are_read(text: str) -> None:
    assert parse_number(text) == float(text)


def test_columns_of_a_persons_own_are_left_alone_where_a_table_may_have_them(
    tmp_path: Path,
) -> None:
    path = tmp_path / "table.csv"
    path.write_text("tape,name,length_m,sigma_m,names\nold,a,1,2,b\n")
    assert read_table(path, OWN).numbers["length_m"].tolist() == [1.0]
    assert find_own_columns(path, OWN) == ("tape", "names")


@pytest.mark.parametrize(
    "header", ["name,length_m,sigma", "name,length_m,Sigma_m", "name,length_m,"]
)
def test_what_may_be_a_misspelt_column_is_not_a_persons_own(tmp_path: Path, header: str) -> None:
    path = tmp_path / "table.csv"
    path.write_text(header + "\na,1,1\n")
    with pytest.raises(InputError, match="unknown column"):
        read_table(path, OWN)


@pytest.mark.parametrize("sigma", ["0", "-1", "1e-300", "1e7"])
def test_what_can_be_no_standard_deviation_is_named(read_own: ReadOwn, sigma: str) -> None:
    table = read_own(f"name,length_m,sigma_m\na,1,0.01\nb,1,\nc,2,{sigma}\n")
    ((line, text),) = table.faults
    assert line == 4
    assert text.startswith("sigma_m must ")


@pytest.mark.parametrize(
    "code", [*range(0x202A, 0x202F), *range(0x2066, 0x206A), 0x200E, 0x200F, 0x061C, 0xFEFF, 0xAD]
)
def test_what_turns_or_hides_what_is_read_is_no_part_of_a_name(code: int) -> None:
    assert f"U+{code:04X}" in find_unshowable(f"kerb{chr(code)}1")


@pytest.mark.parametrize(
    "name", ["بهـ\u200cها", "क्\u200dष", "👩\u200d🚒", "Straße 3", "ß é ñ 漢字"]
)
def test_names_in_any_script_are_names(name: str) -> None:
    assert not find_unshowable(name)


def test_semicolons_and_decimal_commas_are_read_as_spreadsheets_write_them(read: Read) -> None:
    plain = read("name,length_m,sigma_m\na,1.5,0.010\nb,22.125,\n")
    table = read("name;length_m;sigma_m\na;1,5;0,010\nb;22,125;\n")

    assert table.text == plain.text
    for name, numbers in plain.numbers.items():
        np.testing.assert_array_equal(table.numbers[name], numbers)


def test_one_comma_that_is_clear_answers_for_the_whole_table(read: Read) -> None:
    assert read("name;length_m;sigma_m\na;12,001;0,02\n").numbers["length_m"].tolist() == [12.001]


def test_a_quoted_decimal_comma_between_commas_is_read_too(read: Read) -> None:
    assert read('name,length_m\na,"1,5"\n').numbers["length_m"].tolist() == [1.5]


COMMAND = "=cmd|' /C calc'!A0"
FORMULA = re.compile(r"[\s]*[=+\-@＝＋－＠]|\t|\r|\n")
NUMBER = re.compile(r"[-+]?[0-9]*\.?[0-9]*([eE][-+]?[0-9]+)?")
TEXT = st.text(st.sampled_from("=+-@\t\r\n＝＋－＠'; \"a5.e\0,"), max_size=9) | st.text()


@given(TEXT)
def test_every_text_comes_back_and_no_part_of_it_begins_a_formula(text: str) -> None:
    cell = guard_formula(text)
    assert unguard_formula(cell) == text
    for part in cell.split(";"):
        assert not FORMULA.match(part) or NUMBER.fullmatch(part)
    assert not is_formula(cell)


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
    assert guard_formula(text) == cell
    assert unguard_formula(text if cell == text else cell) == text


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
    path.write_bytes(create_table(["name", "kind"], [{"name": n, "kind": "x"} for n in names]))
    table = read_table(path, Columns(text=("name", "kind")))
    assert table.text["name"] == tuple(names)
    with path.open(encoding="utf-8", newline="") as stream:
        assert not any(is_formula(cell) for row in csv.reader(stream) for cell in row)


def test_imported_labels_are_guarded(tmp_path: Path) -> None:
    picks = ImportedPicks(
        image=("-a.jpg",),
        label=(COMMAND,),
        pixel_px=np.array([[1.0, 2.0]]),
        known=None,
        messages=(),
    )
    content = create_picks(picks, tmp_path / "picks.csv").decode()
    assert f"'-a.jpg,'{COMMAND},1.0,2.0" in content
