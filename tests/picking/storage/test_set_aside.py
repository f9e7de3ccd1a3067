"""What a killed session confirmed while another program changed the tables is offered again."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pytest
from open_projects import ask, change, opened
from pick_pages import small_project

from uavgram.picking.document.errors import RefusedError
from uavgram.picking.protocol.messages import Json

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
