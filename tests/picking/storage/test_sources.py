"""Who made a pick outlives a kill, is offered again, and is written beside what people noted."""

from __future__ import annotations

import json
from pathlib import Path

from uavgram.io.tables.picks import read_picks
from uavgram.io.tables.updates import update_picks
from uavgram.picking.document import commands as c
from uavgram.picking.document.commands import Command
from uavgram.picking.document.history import Session, apply
from uavgram.picking.document.state import State, make_observations, make_state
from uavgram.picking.protocol.encode_survey import state_json
from uavgram.picking.protocol.parse import PhotoSize, parse_message
from uavgram.picking.storage.journal import Journal, load_journal
from uavgram.picking.storage.set_aside import SetAside, list_changes

INDEX = {"P1.jpg": 0, "P2.jpg": 1, "P3.jpg": 2}
PHOTOS = tuple(PhotoSize(name, 640, 480) for name in INDEX)
TABLE = (
    b"image,label,u_px,v_px,sigma_px,source,score,from_image,from_u_px,from_v_px\n"
    b"P1.jpg,A,010.0,20,,as Ada saw it,,,,\n"
    b"P2.jpg,A,30,40,0.06,match,0.93,P1.jpg,10.0,20.0\n"
    b"P3.jpg,A,50,60,0.07,match,0.88,P1.jpg,10.0,20.0\n"
    b"P1.jpg,T,70,80,0.05,target,0.99,,,\n"
)


def state_in(path: Path) -> State:
    path.write_bytes(TABLE)
    _, lines = make_observations(State())
    return make_state(read_picks(path), lines, ())


def written(path: Path, before: State, after: State) -> bytes:
    (old, _), (new, _) = make_observations(before), make_observations(after)
    content = update_picks(path.read_bytes(), old, new)
    assert content is not None
    return content


def done(state: State, command: Command) -> State:
    return apply(Session(state=state), command).state


def test_a_match_that_is_moved_is_written_as_a_persons_and_a_note_stays(tmp_path: Path) -> None:
    before = state_in(tmp_path / "picks.csv")
    assert [pick.source for pick in before.picks] == ["hand", "match", "match", "target"]
    after = done(before, c.Place(image="P2.jpg", label="A", u_px=31.5, v_px=40.0))
    lines, now = TABLE.splitlines(), written(tmp_path / "picks.csv", before, after).splitlines()
    assert now[2] == b"P2.jpg,A,31.5,40,,,,,,"
    assert [row for k, row in enumerate(now) if k != 2] == [lines[k] for k in (0, 1, 3, 4)]


def test_a_pick_that_is_removed_takes_its_matches_out_of_the_table(tmp_path: Path) -> None:
    before = state_in(tmp_path / "picks.csv")
    after = done(before, c.Unpick(image="P1.jpg", label="A"))
    lines = TABLE.splitlines(keepends=True)
    assert written(tmp_path / "picks.csv", before, after) == lines[0] + lines[4]
    assert written(tmp_path / "picks.csv", before, before) == TABLE


def test_what_a_person_noted_in_these_columns_stays_when_the_pick_is_moved(tmp_path: Path) -> None:
    path = tmp_path / "picks.csv"
    path.write_bytes(b"image,label,u_px,v_px,source,score\nP1.jpg,A,10,20,the officer,7\n")
    _, lines = make_observations(State())
    before = make_state(read_picks(path), lines, ())
    after = done(before, c.Place(image="P1.jpg", label="A", u_px=11.5, v_px=20.0))
    assert written(path, before, after).splitlines()[1] == b"P1.jpg,A,11.5,20,the officer,7"


def test_a_journal_knows_who_made_a_pick(tmp_path: Path) -> None:
    state = state_in(tmp_path / "picks.csv")
    journal = Journal(tmp_path / "j.jsonl", fresh=True)
    journal.open(State(), {}, resumed=False)
    for pick in state.picks:
        fields = {name: getattr(pick, name) for name in c.Place.__dataclass_fields__}
        journal.record(c.Place(**fields), 0)
    journal.close()
    left = load_journal(tmp_path / "j.jsonl").session
    assert left is not None
    assert left.state == state


def test_what_was_set_aside_comes_back_with_who_made_it(tmp_path: Path) -> None:
    after = state_in(tmp_path / "picks.csv")
    session = Session(state=State())
    for change in list_changes(SetAside(tmp_path, State(), after), State(), INDEX):
        command = parse_message(json.dumps({"seq": 1, **change}), PHOTOS).body
        assert isinstance(command, c.Place)
        session = apply(session, command)
    assert session.state == after


def test_the_page_is_told_who_made_a_pick(tmp_path: Path) -> None:
    by_hand, match, _, target = state_json(state_in(tmp_path / "picks.csv"), INDEX)["picks"]
    assert "source" not in by_hand
    told = {name: match[name] for name in ("source", "score", "from_image", "from_u_px")}
    assert told == {"source": "match", "score": 0.93, "from_image": 0, "from_u_px": 10.0}
    assert (target["source"], target["from_image"]) == ("target", None)


def test_a_journal_knows_what_was_accepted_in_one_step(tmp_path: Path) -> None:
    after = state_in(tmp_path / "picks.csv")
    hand, *found, target = after.picks
    before = State(picks=(hand, target))
    names = c.Place.__dataclass_fields__
    do = c.PlaceAll(
        places=tuple(c.Place(**{name: getattr(pick, name) for name in names}) for pick in found)
    )
    journal = Journal(tmp_path / "j.jsonl", fresh=True)
    journal.open(before, {}, resumed=False)
    journal.record(do, 0)
    journal.close()
    left = load_journal(tmp_path / "j.jsonl").session
    assert left == apply(Session(state=before), do)
