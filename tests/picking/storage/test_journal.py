"""A picking session that is killed again and again loses nothing that its page was told."""

from __future__ import annotations

import copy
import json
import random
import threading
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pytest
from csv_rows import read_rows
from open_projects import ask, change, opened
from pick_pages import HEIGHT, WIDTH, Page, Server, running, small_project
from websockets.exceptions import ConnectionClosed

from uavgram.errors import InputError
from uavgram.io.tables.picks import read_picks
from uavgram.io.tables.updates import create_table, update_picks
from uavgram.picking.document import commands as c
from uavgram.picking.document.commands import Command, RefusedError
from uavgram.picking.document.history import Session, apply
from uavgram.picking.document.state import State, make_observations, make_state
from uavgram.picking.protocol.encode_survey import state_json
from uavgram.picking.protocol.messages import Json
from uavgram.picking.protocol.parse import PhotoSize, parse_message
from uavgram.picking.storage.journal import Journal, SetAside, list_changes, load_journal
from uavgram.pipeline.measure.inputs import read_inputs
from uavgram.pipeline.new import PICKED

KILLS = 20
SAVE_AFTER_S = 0.05  # sooner than for people, so that many kills fall into the writing
LABELS = [f"L{k}" for k in range(12)]


class Model:
    """What the page should hold, in the simplest words: whole states and a list of earlier ones."""

    def __init__(self, initial_state: Json, tables: Json) -> None:
        self.state = _sorted(initial_state["state"])
        self.past: list[Json] = [tables] if initial_state["recovered"] else []
        self.future: list[Json] = []

    def after(self, kind: str, fields: Json) -> Json:
        """The state that a command would lead to."""
        if kind == "undo":
            return self.past[-1] if self.past else self.state
        if kind == "redo":
            return self.future[-1] if self.future else self.state
        state = copy.deepcopy(self.state)
        _CHANGES[kind](state, fields)
        return _sorted(state)

    def take(self, kind: str, fields: Json) -> None:
        """Do it: it was confirmed."""
        after = self.after(kind, fields)
        if kind == "undo":
            self.future.append(self.state)
            self.past.pop()
        elif kind == "redo":
            self.past.append(self.state)
            self.future.pop()
        elif after != self.state:
            self.past.append(self.state)
            self.future = []
        self.state = after


def _sorted(state: Json) -> Json:
    picks = sorted(state["picks"], key=lambda pick: (pick["image"], pick["label"]))
    return {"picks": picks, "lines": state["lines"], "measurements": state["measurements"]}


UNSTATED: Json = {
    "sigma_px": None,
    "height_m": None,
    "height_sigma_m": None,
    "is_free": False,
    "area": "",
}
"""What nobody said of a pick."""


def _tables(folder: Path) -> Json:
    """What the CSV files hold, as the page would be told it."""

    def rows(name: str) -> list[dict[str, str]]:
        path = folder / name
        if not path.is_file():
            return []
        return read_rows(path)

    picks = [
        {
            "image": int(row["image"].removeprefix("P").removesuffix(".jpg")) - 1,
            "label": row["label"],
            "u_px": float(row["u_px"]),
            "v_px": float(row["v_px"]),
            **UNSTATED,
        }
        for row in rows("picks.csv")
    ]
    lines = [
        {
            "name": row["name"],
            "start": row["from"],
            "end": row["to"],
            "length_m": float(row["length_m"]),
            "sigma_m": float(row["sigma_m"]),
            "adjust": True,
            "tape": "",
            "along": "slope",
        }
        for row in rows("lines.csv")
    ]
    measurements = [
        {
            "name": row["name"],
            "kind": row["kind"],
            "points": row["points"].split(";"),
            "parameters": {},
        }
        for row in rows("measure.csv")
    ]
    return _sorted({"picks": picks, "lines": lines, "measurements": measurements})


def _place(state: Json, do: Json) -> None:
    where = {"u_px": do["u_px"], "v_px": do["v_px"]}
    for pick in state["picks"]:
        if (pick["image"], pick["label"]) == (do["image"], do["label"]):
            pick.update(where)
            return
    state["picks"].append({"image": do["image"], "label": do["label"], **where, **UNSTATED})


def _unpick(state: Json, do: Json) -> None:
    state["picks"] = [
        p for p in state["picks"] if (p["image"], p["label"]) != (do["image"], do["label"])
    ]


def _rename(state: Json, do: Json) -> None:
    ends = {line[end] for line in state["lines"] for end in ("start", "end")}
    used = {pick["label"] for pick in state["picks"]} | ends
    used |= {label for one in state["measurements"] for label in one["points"]}
    if do["new"] in used:
        return

    def named(label: str) -> str:
        return do["new"] if label == do["label"] else label

    for pick in state["picks"]:
        pick["label"] = named(pick["label"])
    for line in state["lines"]:
        line.update(start=named(line["start"]), end=named(line["end"]))
    for one in state["measurements"]:
        one["points"] = [named(label) for label in one["points"]]


def _line(state: Json, do: Json) -> None:
    line = {name: do[name] for name in ("name", "start", "end", "length_m", "sigma_m")}
    if line["name"] not in {one["name"] for one in state["lines"]}:
        state["lines"] = [*state["lines"], {**line, "adjust": True, "tape": "", "along": "slope"}]


def _measure(state: Json, do: Json) -> None:
    one = {"name": do["name"], "kind": do["kind"], "points": do["points"], "parameters": {}}
    if one["name"] not in {other["name"] for other in state["measurements"]}:
        state["measurements"] = [*state["measurements"], one]


_CHANGES = {
    "place": _place,
    "unpick": _unpick,
    "rename": _rename,
    "line": _line,
    "measure": _measure,
}


def _command(state: Json, rng: random.Random) -> tuple[str, Json]:
    """Something that a person might do next."""
    roll = rng.random()
    if len(state["picks"]) < 4 or roll < 0.55:
        place = {"u_px": rng.uniform(0, WIDTH - 1), "v_px": rng.uniform(0, HEIGHT - 1)}
        return "place", {"image": rng.randrange(2), "label": rng.choice(LABELS), **place}
    pick = rng.choice(state["picks"])
    image, label = pick["image"], pick["label"]
    if roll < 0.63:
        return "unpick", {"image": image, "label": label}
    if roll < 0.70:
        return "rename", {"label": label, "new": rng.choice(LABELS)}
    if roll < 0.77:
        ends = {"start": label, "end": f"far {label}"}
        name = f"known {len(state['lines'])}"
        return "line", {"was": "", "name": name, **ends, "length_m": 3.5, "sigma_m": 0.01}
    if roll < 0.84:
        name, points = f"D{len(state['measurements'])}", [label, f"far {label}"]
        return "measure", {"was": "", "name": name, "kind": "distance", "points": points}
    return ("undo" if roll < 0.95 else "redo"), {}


def _work_until_killed(
    page: Page, model: Model, rng: random.Random, server: Server
) -> tuple[str, Json]:
    """Do one thing after the other; the one that was not confirmed any more.

    The kill is a random moment after so many things: a busy machine gets as far as an idle one.
    """
    done, last = 0, rng.randint(1, 16)
    while True:
        if done == last:
            threading.Timer(rng.uniform(0.0, 0.05), server.strike).start()
        kind, fields = _command(model.state, rng)
        try:
            if page.do(kind, **fields)["t"] == "changed":
                model.take(kind, fields)
        except (ConnectionClosed, OSError):
            return kind, fields
        done += 1
        if done % 12 == 0:  # a rest, in which the tables may be written
            time.sleep(rng.uniform(0.0, 2.0 * SAVE_AFTER_S))


def test_twenty_kills_lose_nothing_that_the_page_had_confirmed(tmp_path: Path) -> None:
    project = small_project(tmp_path)
    rng = random.Random(7)  # noqa: S311  (clicks, not keys)
    confirmed, recoveries = 0, 0
    expected: list[Json] = []
    for _ in range(KILLS):
        tables = _tables(tmp_path)  # before what was lost is saved by opening
        server = Server(project, SAVE_AFTER_S)
        try:
            with Page(server) as page:
                model = Model(page.initial_state, tables)
                assert not expected or model.state in expected
                recoveries += page.initial_state["recovered"]
                last = _work_until_killed(page, model, rng, server)
        finally:
            server.kill()
        # What was under way may have come to the journal, but not its answer to the page.
        expected = [model.state, model.after(*last)]
        confirmed += page.seq - 1
    with running(project) as server, Page(server) as page:
        found = _sorted(page.initial_state["state"])
        assert found in expected
    with running(project) as server, Page(server) as page:  # Ctrl+C has saved it
        assert _sorted(page.initial_state["state"]) == found == _tables(tmp_path)
        assert not page.initial_state["recovered"]
    assert confirmed > 4 * KILLS
    assert recoveries > KILLS / 3


def test_a_recovery_is_saved_by_opening_can_be_undone_and_survives_a_second_kill(
    tmp_path: Path,
) -> None:
    project = small_project(tmp_path)
    for name, header in PICKED.items():
        (tmp_path / f"{name}.csv").write_bytes(create_table(header, ()))
    server = Server(project)
    with Page(server) as page:
        page.do("place", image=0, label="A", u_px=10.25, v_px=20.5)
        page.do("place", image=0, label="B", u_px=11, v_px=21)
        server.kill()
    with pytest.raises(InputError, match="ended before they were in the tables"):
        read_inputs(project, unpicked=True)
    server = Server(project)
    with Page(server) as page:
        assert page.initial_state["recovered"]
        codes = [message["code"] for message in page.initial_state["messages"]]
        assert "pick-recovered" in codes
        assert set(read_inputs(project).picks.label) == {"A", "B"}  # by opening alone
        page.do("undo")  # back to what the tables held
        page.do("redo")
        page.do("place", image=1, label="C", u_px=30, v_px=40)
        page.do("undo")
        server.kill()
    with running(project) as server, Page(server) as page:
        assert [pick["label"] for pick in page.initial_state["state"]["picks"]] == ["A", "B"]
        assert not page.initial_state["recovered"]


# What a killed session confirmed while another program changed the tables is offered again.


PICKS = b"image,label,u_px,v_px\nP1.jpg,A,10,20\nP1.jpg,B,30,40\n"


def labels(said: Mapping[str, Any]) -> set[str]:
    return {pick["label"] for pick in said["state"]["picks"]}


@pytest.fixture
def project(tmp_path: Path) -> Path:
    """A session was killed before it had saved; then somebody edited its tables."""
    path = small_project(tmp_path)
    (tmp_path / "picks.csv").write_bytes(PICKS)
    with opened(path, killed=True) as (open_project, _):
        change(open_project, "place", image=0, label="A", u_px=11, v_px=21)
        change(open_project, "place", image=1, label="C", u_px=50, v_px=60)
        change(open_project, "height", label="C", height_m=0.5, height_sigma_m=0.02)
        change(open_project, "height", label="A", height_m=None, is_free=True)
        change(open_project, "unpick", image=0, label="B")
        change(open_project, "line", was="", name="L", start="A", end="C", length_m=2, sigma_m=0.1)
        change(open_project, "measure", was="", name="D", kind="distance", points=["A", "C"])
    (tmp_path / "picks.csv").write_bytes(PICKS + b"P2.jpg,Z,7,8\n")
    return path


Height = tuple[float | None, float | None, bool]


def place_of(begun: Mapping[str, Any], label: str) -> tuple[float, float, Height]:
    pick = next(pick for pick in begun["state"]["picks"] if pick["label"] == label)
    height = pick["height_m"], pick["height_sigma_m"], pick["is_free"]
    return pick["u_px"], pick["v_px"], height


def test_a_run_reports_it_until_it_is_dealt_with(project: Path, tmp_path: Path) -> None:
    for name, header in PICKED.items():
        if not (tmp_path / f"{name}.csv").exists():
            (tmp_path / f"{name}.csv").write_bytes(create_table(header, ()))
    code = "pick-not-recovered"
    with opened(project) as (open_project, _):
        (told,) = [one for one in read_inputs(project).messages if one.code == code]
        assert "pick-journal-" in told.text
        ask(open_project, "discard-aside")
    assert code not in [one.code for one in read_inputs(project).messages]


def test_it_is_taken_over_in_one_step_beside_what_the_other_did(
    project: Path, tmp_path: Path
) -> None:
    with opened(project) as (open_project, sent):
        begun: Mapping[str, Any] = open_project.initial_state()
        assert begun["aside"] == 7
        assert labels(begun) == {"A", "B", "Z"}
        assert ask(open_project, "take-aside")["refused"] == 0
        begun = sent[-1]  # every page begins anew
        assert begun["t"] == "initial-state"
        assert labels(begun) == {"A", "C", "Z"}
        assert place_of(begun, "A") == (11, 21, (None, None, True))
        assert place_of(begun, "C") == (50, 60, (0.5, 0.02, False))
        assert [line["name"] for line in begun["state"]["lines"]] == ["L"]
        assert begun["state"]["measurements"][0]["points"] == ["A", "C"]
        assert (begun["undo"], begun["aside"]) == (1, None)
        assert b"P2.jpg,C,50" in (tmp_path / "picks.csv").read_bytes()
        with pytest.raises(RefusedError, match="set aside"):
            ask(open_project, "take-aside")
        change(open_project, "undo")
        assert labels(open_project.initial_state()) == {"A", "B", "Z"}
    (kept,) = (tmp_path / "out").glob("pick-journal-*")
    assert kept.name.endswith(".jsonl.taken")


def test_it_is_discarded_and_kept_and_not_offered_again(project: Path, tmp_path: Path) -> None:
    with opened(project) as (open_project, sent):
        assert ask(open_project, "discard-aside")["t"] == "done"
        assert labels(sent[-1]) == {"A", "B", "Z"}
    with opened(project) as (open_project, _):
        assert open_project.initial_state()["aside"] is None
    (kept,) = (tmp_path / "out").glob("pick-journal-*")
    assert kept.name.endswith(".jsonl.discarded")


def test_what_is_no_change_of_the_page_is_not_taken(project: Path, tmp_path: Path) -> None:
    """A journal in an archive can hold anything; all of it goes the way of a page's message."""
    state: Json = {"picks": [], "lines": [], "requests": []}
    place = {"do": "Place", "step": 0, "image": "P1.jpg", "label": "Q", "u_px": 1, "v_px": 1}
    entries = [
        {"do": "open", "pid": 1, "state": state, "files": {}, "resumed": False},
        *({**place, "label": name, "sigma_px": s} for name, s in (("Q", 1.0), ("R", 1e-9))),
        {**place, "label": "S", "image": "../../x", "sigma_px": 1.0},
        {**place, "label": "T", "u_px": "many", "sigma_px": 1.0},
        {**place, "label": "a;b", "sigma_px": 1.0},
    ]
    with opened(project) as (open_project, _):
        assert open_project.initial_state()["aside"] == 7
        ask(open_project, "discard-aside")
    text = "".join(json.dumps(entry) + "\n" for entry in entries)
    (tmp_path / "out" / "pick-journal-1.jsonl").write_text(text)
    with opened(project) as (open_project, sent):
        assert ask(open_project, "take-aside")["refused"] == 4
        assert labels(sent[-1]) == {"A", "B", "Z", "Q"}


# Who made a pick outlives a kill, is offered again, and is written beside what people noted.


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
    for sent in list_changes(SetAside(tmp_path, State(), after), State(), INDEX):
        command = parse_message(json.dumps({"seq": 1, **sent}), PHOTOS).body
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
