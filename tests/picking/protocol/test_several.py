"""Several changes in one message: as the page sends them, and as the journal finds them again."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from uavgram.picking.document import commands as c
from uavgram.picking.document.errors import RefusedError
from uavgram.picking.document.history import apply_change
from uavgram.picking.document.state import Pick, State
from uavgram.picking.protocol.messages import Json
from uavgram.picking.protocol.parse import PhotoSize, parse_message
from uavgram.picking.storage.journal import Journal, load_journal

PHOTOS = (PhotoSize("P1.jpg", 640, 480), PhotoSize("P2.jpg", 640, 480))
STATE = State(
    picks=(
        Pick(image="P1.jpg", label="A", u_px=1, v_px=2),
        Pick(image="P1.jpg", label="B", u_px=3, v_px=4),
    )
)
SWAP: Json = {"t": "swap", "image": 0, "label": "A", "other": "B"}
MEASURE: Json = {"t": "measure", "was": "", "name": "d", "kind": "distance", "points": ["A", "B"]}


def parsed(body: Json) -> object:
    return parse_message(json.dumps({"seq": 1, **body}), PHOTOS).body


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
