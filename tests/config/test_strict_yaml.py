"""The YAML reader against the traps of YAML 1.1 and the slips of people."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path

import pytest

from uavgram.config.strict_yaml import Document, Plain, format_key_path, read_yaml, resolve_scalar
from uavgram.errors import InputError

Read = Callable[[str | bytes], Document]


@pytest.fixture
def read(tmp_path: Path) -> Read:
    def _read(content: str | bytes) -> Document:
        path = tmp_path / "p.yaml"
        path.write_bytes(content.encode() if isinstance(content, str) else content)
        return read_yaml(path)

    return _read


@pytest.mark.parametrize(
    ("written", "value"),
    [
        ("1e-3", 0.001),
        ("-2.5E+2", -250.0),
        (".5", 0.5),
        ("1.", 1.0),
        ("0", 0),
        ("-17", -17),
        ("true", True),
        ("False", False),
        ("~", None),
        ("", None),
        # Text, though YAML 1.1 reads something else:
        ("010", "010"),
        ("12:30", "12:30"),
        ("no", "no"),
        ("on", "on"),
        ("0x10", "0x10"),
        ("1_000", "1_000"),
        (".nan", ".nan"),
        ("-.inf", "-.inf"),
        ("1e999", "1e999"),
        ("2024-01-01", "2024-01-01"),
    ],
)
def test_a_plain_scalar_is_what_yaml_1_2_says(written: str, value: Plain) -> None:
    found = resolve_scalar(written)

    assert found == value
    assert type(found) is type(value)


def test_quoted_and_block_scalars_stay_text(read: Read) -> None:
    data = read("a: '1'\nb: \"true\"\nc: |\n  3\n").data

    assert data == {"a": "1", "b": "true", "c": "3\n"}


def test_keys_stay_text_as_written(read: Read) -> None:
    assert read("no: 1\n1: 2\n").data == {"no": 1, "1": 2}


def test_every_key_and_item_has_its_line(read: Read) -> None:
    document = read("# head\na:\n  b: 1\n  c:\n    - 2\n    - 3\nd: 4\n")

    assert document.line_of(("a",)) == 2
    assert document.line_of(("a", "b")) == 3
    assert document.line_of(("a", "c", 1)) == 6
    assert document.line_of(("d",)) == 7
    assert document.line_of(("a", "absent")) == 2


def test_a_byte_order_mark_is_no_part_of_the_first_key(read: Read) -> None:
    assert read(b"\xef\xbb\xbfa: 1\n").data == {"a": 1}


def test_a_duplicate_key_is_a_fault_that_names_both_lines(read: Read) -> None:
    document = read("a: 1\nb:\n  c: 1\n  c: 2\na: 3\n")

    assert [line for line, _ in document.faults] == [4, 5]
    assert "b.c: is given twice, first in line 3" in document.faults[0][1]
    assert document.data == {"a": 1, "b": {"c": 1}}


@pytest.mark.parametrize(
    ("content", "line", "words"),
    [
        ("", 1, "empty"),
        ("# only a comment\n", 1, "empty"),
        ("a:\n\tb: 1\n", 2, "tab"),
        ("a: 1\nb: *.jpg\n", 2, "quotes"),
        ("a: 1\nb: *name\n", 2, "quotes"),
        ("a: &x 1\n", 1, "anchor"),
        ("a: !!python/object:os.system 1\n", 1, "tag"),
        ("a: !!float '1'\n", 1, "tag"),
        ("a: 'x' y\nb: 1\n", 1, "does not go on as the lines above"),
        ("a: 1\nb: c: d\n", 2, "colon"),
        ("a: 1\nb\nc: 2\n", 3, "colon"),
        ("a: 1\n---\nb: 2\n", 2, "second document"),
        ("a: [1, 2\n", 1, "bracket"),
        ("a: [1, 2}\n", 1, "not valid YAML"),
        ("a: 1\nb: 'c\n", 2, "quote"),
        ("a: 1\nb: @c\n", 2, "quotes"),
        ("a: 1\n[b]: 2\n", 2, "key must be plain text"),
        ("a: 1\nb: \x07\n", 2, "not allowed"),
        (b"a: 1\nb: \xe9\n", 2, "UTF-8"),
        ("a: " + "[" * 3000 + "\n", 1, "nesting"),
    ],
)
def test_broken_yaml_is_refused_with_its_line(
    read: Read, content: str | bytes, line: int, words: str
) -> None:
    with pytest.raises(InputError) as caught:
        read(content)

    assert caught.value.line == line
    assert words in caught.value.message


def test_a_missing_file_is_an_input_error(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="No such file"):
        read_yaml(tmp_path / "absent.yaml")


def test_a_path_is_written_as_people_name_it() -> None:
    assert format_key_path(("telemetry", "position_sigma_m", 0)) == "telemetry.position_sigma_m[0]"


def test_no_number_is_ever_infinite() -> None:
    numbers = [resolve_scalar(f"{sign}1e{power}") for sign in "+-" for power in (308, 309, 400)]

    assert all(math.isfinite(n) for n in numbers if isinstance(n, float))
    assert [type(n) for n in numbers] == [float, str, str] * 2
