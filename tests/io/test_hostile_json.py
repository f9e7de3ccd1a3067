"""JSON that a stranger wrote: endless brackets and numbers without end are one clear message."""

import json
from collections.abc import Callable
from pathlib import Path

import pytest

from uavgram.errors import UavgramError
from uavgram.io.cameras.odm import read_odm_camera
from uavgram.io.imports import read_labelme
from uavgram.io.json_text import parse_json
from uavgram.io.results.results_json import load_results
from uavgram.picking.storage.journal import JournalContent, load_journal

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
