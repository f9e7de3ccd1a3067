"""The page accepts what the readers of the tables accept; the journal finds all of it again."""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Callable
from pathlib import Path

import pytest

from uavgram.errors import InputError
from uavgram.io.tables.known import read_lines
from uavgram.io.tables.measure import read_measure
from uavgram.io.tables.picks import read_picks
from uavgram.model.limits import LONGEST_NAME
from uavgram.model.options import OptionsError, TimeOptions
from uavgram.picking.document import commands as c
from uavgram.picking.document.commands import RefusedError
from uavgram.picking.document.history import apply_change
from uavgram.picking.document.state import Pick, State
from uavgram.picking.protocol.messages import Json
from uavgram.picking.protocol.parse import PhotoSize, parse_message
from uavgram.picking.storage.journal import Journal, load_journal

PHOTOS = (PhotoSize("P1.jpg", 640, 480),)
NUMBERS = (
    *(-1e11, -1e10, -1.0, -1e-9, 0.0, 5e-324, 1e-9, 9.9e-7, 1e-6, 0.5, 1e4, 1.1e4),
    *(1e6, 1.1e6, 1e7, 1.1e7, 1e10, 1.1e10, 1e16, 1e300),
)
PLACE: Json = {"t": "place", "image": 0, "label": "A", "u_px": 5, "v_px": 6}
LINE: Json = {
    "t": "line",
    "was": "",
    "name": "L",
    "start": "A",
    "end": "B",
    "length_m": 2,
    "sigma_m": 0.1,
}
SKID: Json = {"t": "measure", "was": "", "name": "S", "kind": "skid_speed", "points": ["A", "B"]}
VOLUME: Json = {"t": "measure", "was": "", "name": "V", "kind": "volume", "points": list("ABC")}

Reader = Callable[[Path], object]
FIELDS: dict[str, tuple[Callable[[float], Json], Reader, str]] = {
    "sigma of a pick": (
        lambda x: PLACE | {"sigma_px": x},
        read_picks,
        "image,label,u_px,v_px,sigma_px\nP1.jpg,A,5,6,{}\n",
    ),
    "its sigma, later": (
        lambda x: {"t": "sigma", "image": 0, "label": "A", "sigma_px": x},
        read_picks,
        "image,label,u_px,v_px,sigma_px\nP1.jpg,A,5,6,{}\n",
    ),
    "height": (
        lambda x: {"t": "height", "label": "A", "height_m": x},
        read_picks,
        "image,label,u_px,v_px,height_m\nP1.jpg,A,5,6,{}\n",
    ),
    "sigma of a height": (
        lambda x: {"t": "height", "label": "A", "height_m": 1, "height_sigma_m": x},
        read_picks,
        "image,label,u_px,v_px,height_m,height_sigma_m\nP1.jpg,A,5,6,1,{}\n",
    ),
    "level under a volume": (
        lambda x: VOLUME | {"parameters": {"level": x}},
        read_measure,
        "name,kind,points,parameters\nV,volume,A;B;C,level={}\n",
    ),
    "length": (
        lambda x: LINE | {"length_m": x},
        read_lines,
        "name,from,to,length_m,sigma_m\nL,A,B,{},0.1\n",
    ),
    "sigma of a length": (
        lambda x: LINE | {"sigma_m": x},
        read_lines,
        "name,from,to,length_m,sigma_m\nL,A,B,2,{}\n",
    ),
    "friction": (
        lambda x: SKID | {"parameters": {"mu": x, "mu_sigma": 0.1}},
        read_measure,
        "name,kind,points,parameters\nS,skid_speed,A;B,mu={};mu_sigma=0.1\n",
    ),
    "sigma of friction": (
        lambda x: SKID | {"parameters": {"mu": 0.5, "mu_sigma": x}},
        read_measure,
        "name,kind,points,parameters\nS,skid_speed,A;B,mu=0.5;mu_sigma={}\n",
    ),
}


def page_takes(message: Json) -> bool:
    try:
        parse_message(json.dumps({"seq": 1, **message}), PHOTOS)
    except RefusedError:
        return False
    return True


def reader_takes(read: Reader, path: Path, text: str) -> bool:
    path.write_text(text, encoding="utf-8")
    try:
        read(path)
    except InputError:
        return False
    return True


@pytest.mark.parametrize("field", FIELDS)
def test_the_page_takes_the_numbers_that_the_reader_takes(field: str, tmp_path: Path) -> None:
    message, read, table = FIELDS[field]
    on_the_page = {x: page_takes(message(x)) for x in NUMBERS}
    in_the_table = {
        x: reader_takes(read, tmp_path / "t.csv", table.format(repr(x))) for x in NUMBERS
    }
    assert on_the_page == in_the_table
    assert set(on_the_page.values()) == {True, False}


@pytest.mark.parametrize("length", [1, 64, 65, LONGEST_NAME, LONGEST_NAME + 1])
def test_the_page_takes_the_names_that_the_readers_take(length: int, tmp_path: Path) -> None:
    name, path = "x" * length, tmp_path / "t.csv"
    measured = SKID | {"parameters": {"mu": 0.5, "mu_sigma": 0.1}}
    end = "mu=0.5;mu_sigma=0.1"
    pairs: list[tuple[Json, Reader, str]] = [
        (PLACE | {"label": name}, read_picks, f"image,label,u_px,v_px\nP1.jpg,{name},5,6\n"),
        (
            LINE | {"name": name},
            read_lines,
            f"name,from,to,length_m,sigma_m\n{name},A,B,2,0.1\n",
        ),
        (LINE | {"end": name}, read_lines, f"name,from,to,length_m,sigma_m\nL,A,{name},2,0.1\n"),
        (
            measured | {"name": name},
            read_measure,
            f"name,kind,points,parameters\n{name},skid_speed,A;B,{end}\n",
        ),
        (
            measured | {"points": ["A", name]},
            read_measure,
            f"name,kind,points,parameters\nS,skid_speed,A;{name},{end}\n",
        ),
    ]
    for message, read, table in pairs:
        assert page_takes(message) == reader_takes(read, path, table) == (length <= LONGEST_NAME)


@pytest.mark.parametrize(
    ("value", "words"), [(0.0, "greater than 0"), (1e7, "between 0.000001 and")]
)
def test_project_file_table_and_page_refuse_a_sigma_in_the_same_words(
    value: float, words: str, tmp_path: Path
) -> None:
    table = tmp_path / "lines.csv"
    table.write_text(f"name,from,to,length_m,sigma_m\nL,A,B,2,{value}\n")
    with pytest.raises(InputError) as in_table:
        read_lines(table)
    with pytest.raises(RefusedError) as on_page:
        parse_message(json.dumps({"seq": 1} | LINE | {"sigma_m": value}), PHOTOS)
    with pytest.raises(OptionsError) as in_project:
        TimeOptions(offset_sigma_s=value)

    assert words in on_page.value.args[0]
    said = str(on_page.value.args[0]).removeprefix("sigma ")
    assert said in in_table.value.message
    assert said in str(in_project.value)


@pytest.mark.parametrize("fields", [PLACE, LINE, VOLUME], ids=["pick", "length", "measurement"])
def test_null_is_the_same_as_no_field(fields: Json) -> None:
    command = type(parse_message(json.dumps({"seq": 1, **fields}), PHOTOS).body)
    absent = dict.fromkeys({one.name for one in dataclasses.fields(command)} - {*fields})
    with_nulls = parse_message(json.dumps({"seq": 1, **absent, **fields}), PHOTOS)

    assert absent
    assert with_nulls == parse_message(json.dumps({"seq": 1, **fields}), PHOTOS)


# Labels merged and split: as the page says it, and as the journal finds it again.


NAMES = ("P1.jpg", "P2.jpg")
TWO_PHOTOS = tuple(PhotoSize(name, 640, 480) for name in NAMES)
MERGE: Json = {"t": "merge", "label": "A", "into": "B"}
SPLIT: Json = {"t": "split", "label": "C", "new": "D", "images": [1]}


def parsed(body: Json) -> object:
    return parse_message(json.dumps({"seq": 1, **body}), TWO_PHOTOS).body


def test_photos_are_named_by_their_numbers_and_which_picks_stay_may_be_left_open() -> None:
    assert parsed(MERGE) == c.Merge(label="A", into="B")
    assert parsed(MERGE | {"keep": "A"}) == c.Merge(label="A", into="B", keep="A")
    assert parsed(SPLIT) == c.Split(label="C", new="D", images=("P2.jpg",))


@pytest.mark.parametrize(
    ("images", "why"),
    [([], "a list of 1 to 2 photos"), ("01", "a list of"), ([2], "no photo 2"), ([0] * 3, "1 to")],
)
def test_a_split_is_of_photos_that_are_there(images: object, why: str) -> None:
    with pytest.raises(RefusedError, match=why):
        parsed(SPLIT | {"images": images})


@pytest.mark.parametrize("body", [MERGE, SPLIT, {"t": "all", "changes": [SPLIT, MERGE]}])
def test_both_are_found_again_after_a_crash(body: Json, tmp_path: Path) -> None:
    picks = [(0, "A"), (1, "B"), (0, "C"), (1, "C")]
    state = State(
        picks=tuple(Pick(image=NAMES[k], label=label, u_px=1, v_px=2) for k, label in picks)
    )
    command = parsed(body)
    assert isinstance(command, c.Change)
    journal = Journal(tmp_path / "journal.jsonl", fresh=True)
    journal.open(state, {}, resumed=False)
    journal.record(command, 0)
    journal.close()
    left = load_journal(journal.path).session

    assert left is not None
    assert left.state == apply_change(state, command)


# Several changes in one message: as the page sends them, and as the journal finds them again.


STATE = State(
    picks=(
        Pick(image="P1.jpg", label="A", u_px=1, v_px=2),
        Pick(image="P1.jpg", label="B", u_px=3, v_px=4),
    )
)
SWAP: Json = {"t": "swap", "image": 0, "label": "A", "other": "B"}
MEASURE: Json = {"t": "measure", "was": "", "name": "d", "kind": "distance", "points": ["A", "B"]}


def test_a_swap_names_a_photo_or_means_all_of_them() -> None:
    assert parsed(SWAP) == c.Swap(image="P1.jpg", label="A", other="B")
    assert parsed(SWAP | {"image": None}) == c.Swap(image="", label="A", other="B")


@pytest.mark.parametrize(
    ("changes", "why"),
    [
        ([], "a list of 1 to"),
        (["swap"], "must hold objects"),
        ([SWAP | {"image": 7}], "no photo 7"),
        ([SWAP | {"seq": 1}], "unknown field 'seq'"),
        ([{"t": "undo"}], "'undo' is no change"),
        ([{"t": "all", "changes": [SWAP]}], "'all' is no change"),
        ([{"t": "explode"}], "'explode' is no change"),
    ],
)
def test_changes_that_cannot_be_made_together_are_refused(changes: list[object], why: str) -> None:
    with pytest.raises(RefusedError, match=why):
        parsed({"t": "all", "changes": changes})


def test_several_changes_are_found_again_after_a_crash(tmp_path: Path) -> None:
    command = parsed({"t": "all", "changes": [SWAP, MEASURE]})
    assert isinstance(command, c.All)
    journal = Journal(tmp_path / "journal.jsonl", fresh=True)
    journal.open(STATE, {}, resumed=False)
    journal.record(command, 0)
    journal.close()
    left = load_journal(journal.path).session

    assert left is not None
    assert left.state == apply_change(STATE, command)
    assert len(left.past) == 1
