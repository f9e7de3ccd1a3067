"""A picking session that is killed again and again loses nothing that its page was told."""

from __future__ import annotations

import copy
import csv
import random
import threading
import time
from pathlib import Path

from pick_pages import HEIGHT, WIDTH, Page, Server, running, small_project
from websockets.exceptions import ConnectionClosed

from uavgram.picking.protocol.messages import Json

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
        with path.open(encoding="utf-8", newline="") as stream:
            return list(csv.DictReader(stream))

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
        server = Server(project, SAVE_AFTER_S)
        try:
            with Page(server) as page:
                model = Model(page.initial_state, _tables(tmp_path))
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


def test_undo_after_a_recovery_goes_to_the_tables_and_survives_a_second_kill(
    tmp_path: Path,
) -> None:
    project = small_project(tmp_path)
    server = Server(project)
    with Page(server) as page:
        page.do("place", image=0, label="A", u_px=10.25, v_px=20.5)
        page.do("place", image=0, label="B", u_px=11, v_px=21)
        server.kill()
    server = Server(project)
    with Page(server) as page:
        page.do("place", image=1, label="C", u_px=30, v_px=40)
        page.do("undo")
        server.kill()
    server = Server(project)
    with Page(server) as page:
        assert page.initial_state["recovered"]
        assert [pick["label"] for pick in page.initial_state["state"]["picks"]] == ["A", "B"]
        codes = [message["code"] for message in page.initial_state["messages"]]
        assert "pick-recovered" in codes
        page.do("undo")  # back to what the tables hold
        server.kill()
    with running(project) as server, Page(server) as page:
        assert page.initial_state["state"]["picks"] == []
        assert not page.initial_state["recovered"]
