"""Labels merged and split: as the page says it, and as the journal finds it again."""

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

NAMES = ("P1.jpg", "P2.jpg")
PHOTOS = tuple(PhotoSize(name, 640, 480) for name in NAMES)
MERGE: Json = {"t": "merge", "label": "A", "into": "B"}
SPLIT: Json = {"t": "split", "label": "C", "new": "D", "images": [1]}


def parsed(body: Json) -> object:
    return parse_message(json.dumps({"seq": 1, **body}), PHOTOS).body


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
