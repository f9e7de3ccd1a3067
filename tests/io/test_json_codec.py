"""JSON that a stranger wrote: endless brackets and numbers without end are one clear message."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import numpy as np
import pytest
from results_schema import row_schema

from uavgram.errors import UavgramError
from uavgram.io.cameras import read_odm_camera
from uavgram.io.imports import read_labelme
from uavgram.io.json_codec import Table, encode, from_record, parse_json
from uavgram.io.results.results_json import load_results
from uavgram.model.arrays import NAN_IS_NONE, Floats, FrozenArrays
from uavgram.model.naming import OPTIONAL, Column
from uavgram.picking.storage.journal import JournalContent, load_journal
from uavgram.views.data_frames import columns

DEEP = "[" * 200_000 + "]" * 200_000
LONG = "9" * 5000
HUGE = "9" * 400  # an integer to Python, and no float


def read_journal(path: Path) -> JournalContent:
    path.write_bytes(path.read_bytes() + b"\n")
    return load_journal(path)


READERS = (load_results, read_odm_camera, read_labelme, read_journal)


@pytest.mark.parametrize("read", READERS)
@pytest.mark.parametrize(
    ("text", "said"),
    [
        (DEEP, "too many brackets inside each other"),
        ('{"a": ' * 200_000 + "1" + "}" * 200_000, "too many brackets inside each other"),
        (f'{{"schema": {LONG}}}', "holds a number of 5000 digits"),
        (f'{{"schema": -{HUGE}}}', "holds a number of 401 digits"),
    ],
    ids=["lists", "objects", "digits", "no float"],
)
def test_a_hostile_file_is_one_message(
    tmp_path: Path, read: Callable[[Path], object], text: str, said: str
) -> None:
    path = tmp_path / "file.json"
    path.write_text(text)
    with pytest.raises(UavgramError, match=said) as caught:
        read(path)
    assert str(path) in str(caught.value)
    assert len(str(caught.value)) < 400


@pytest.mark.parametrize("number", ["1e400", "-1e400", "NaN", "Infinity"])
def test_a_camera_of_no_finite_size_is_one_message(tmp_path: Path, number: str) -> None:
    path = tmp_path / "cameras.json"
    camera = f'{{"projection_type": "perspective", "width": {number}, "height": 9, "focal": 1}}'
    path.write_text(f'{{"a": {camera}}}')
    with pytest.raises(UavgramError, match="width is no finite number"):
        read_odm_camera(path)


@pytest.mark.parametrize("content", ["[]", "1", '{"shapes": 1, "imagePath": "a"}', "1e400"])
def test_json_that_is_no_labelme_file_is_one_message(tmp_path: Path, content: str) -> None:
    path = tmp_path / "a.json"
    path.write_text(content)
    with pytest.raises(UavgramError, match="is no LabelMe file"):
        read_labelme(path)


@pytest.mark.parametrize(
    "entry",
    [
        {},
        {"do": "open", "state": 1, "resumed": False, "files": {}},
        {"do": "open", "state": {"picks": [1]}, "resumed": False, "files": {}},
    ],
)
def test_a_journal_of_other_things_is_one_message_with_the_way_out(
    tmp_path: Path, entry: dict[str, object]
) -> None:
    path = tmp_path / "pick.journal"
    path.write_text(json.dumps(entry) + "\n")
    with pytest.raises(UavgramError, match="is no journal of this program: move it away"):
        load_journal(path)


def test_other_json_is_what_it_was(tmp_path: Path) -> None:
    text = '{"a": [1, -2, 3.5, 1e-3, "x", null, true], "seed": 18446744073709551615}'
    assert parse_json(tmp_path, text) == json.loads(text)


# One annotation names a column in results.json, in its schema and in data frames.


@dataclass(frozen=True, kw_only=True, eq=False)
class Marks(FrozenArrays):
    """Two marks.

    Attributes
    ----------
    start
        Where it begins.
    pixel_px, drift_m
        (N, 2) in the photo; by how much it moved.
    """

    name: Annotated[tuple[str, ...], "n"]
    start: Annotated[tuple[str, ...], "n", Column("from")]
    pixel_px: Annotated[Floats, "n", 2, Column(keys=("u_px", "v_px"), axes=("u", "v"), stem="")]
    drift_m: Annotated[Floats, "n", 2, NAN_IS_NONE]
    age_s: Annotated[Floats, "n", NAN_IS_NONE]


MARKS = Marks(
    name=("a", "b"),
    start=("P", "Q"),
    pixel_px=np.array([[1.0, 2.0], [3.0, 4.0]]),
    drift_m=np.array([[0.1, 0.2], [np.nan, np.nan]]),
    age_s=np.array([5.0, np.nan]),
)


def test_its_keys_are_those_of_the_file_in_both_directions() -> None:
    table = Table(Marks)
    first, second = table.dump(MARKS)

    assert first == {
        "name": "a",
        "from": "P",
        "u_px": 1.0,
        "v_px": 2.0,
        "drift_m": [0.1, 0.2],
        "age_s": 5.0,
    }
    assert (second["drift_m"], second["age_s"]) == ([None, None], None)
    again = table.load([first, second])
    np.testing.assert_array_equal(again.pixel_px, MARKS.pixel_px, strict=True)
    np.testing.assert_array_equal(again.drift_m, MARKS.drift_m, strict=True)
    assert again.start == MARKS.start


def test_the_schema_has_the_same_keys_with_the_words_of_the_docstring() -> None:
    row = row_schema(Table(Marks))

    assert list(row) == ["name", "from", "u_px", "v_px", "drift_m", "age_s"]
    assert row["from"] == {"type": "string", "description": "Where it begins."}
    assert row["u_px"]["type"] == "number"
    assert row["drift_m"]["items"] == {"type": ["number", "null"]}
    assert (row["drift_m"]["minItems"], row["drift_m"]["maxItems"]) == (2, 2)


def test_data_frames_have_a_column_for_each_entry() -> None:
    assert list(dict(columns(MARKS))) == [
        *("name", "start", "u_px", "v_px", "drift_east_m", "drift_north_m", "age_s")
    ]


def test_a_name_for_each_row_is_still_asked_for() -> None:
    with pytest.raises(ValueError, match=r"Marks\.start"):
        Marks(
            name=("a",),
            start=(),
            pixel_px=np.zeros((1, 2)),
            drift_m=np.zeros((1, 2)),
            age_s=np.zeros(1),
        )


# A data class as one record: optional fields, single numbers, pairs and empty arrays.


@dataclass(frozen=True, kw_only=True, eq=False)
class Clock(FrozenArrays):
    """Clock with a note, its rate, and the places where it was read."""

    name: str
    note: Annotated[str, OPTIONAL] = ""
    rate: Annotated[Floats, "n", Column(is_single=True)]
    place_m: Annotated[Floats, "k", 3]
    versions: tuple[tuple[str, int], ...] = ()


def test_a_record_leaves_optional_fields_out_and_reads_them_as_their_defaults() -> None:
    clock = Clock(
        name="a", rate=np.array([2.0]), place_m=np.zeros((0, 3)), versions=(("x", 1), ("y", 2))
    )
    record = encode(clock)
    assert record == {
        "name": "a", "rate": 2.0, "place_m": [], "versions": [["x", 1], ["y", 2]],
    }  # fmt: skip
    for versions in (record["versions"], {"x": 1, "y": 2}):  # pairs may be an object
        again = from_record(Clock, record | {"versions": versions})
        assert (again.note, again.versions) == ("", clock.versions)
        assert (again.rate.tolist(), again.place_m.shape) == ([2.0], (0, 3))
    two = from_record(Clock, record | {"rate": [1.0, 2.0], "note": "late"})
    assert (encode(two)["rate"], encode(two)["note"]) == ([1.0, 2.0], "late")


def test_a_key_of_no_optional_field_is_required_whatever_its_default() -> None:
    record = encode(Clock(name="a", rate=np.array([2.0]), place_m=np.zeros((0, 3))))
    del record["versions"]
    with pytest.raises(KeyError, match="versions"):
        from_record(Clock, record)
