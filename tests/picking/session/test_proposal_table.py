"""A click finds the same point in the other photos: proposed, accepted, refused, kept on disk."""

from __future__ import annotations

import math
import shutil
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from open_projects import change, opened
from textured_ground import LABELS, NAMES, Textured, write_textured

from uavgram.io.tables.picks import read_picks
from uavgram.picking.document import commands as c
from uavgram.picking.document.commands import RefusedError
from uavgram.picking.protocol import messages as m
from uavgram.picking.session.project import OpenProject
from uavgram.pipeline.match.run import match_picks

Json = dict[str, Any]
LONGEST_WAIT_S = 30.0
NEW = "P6"
"""A label that is not picked to begin with: the tests click it."""


@pytest.fixture(scope="module")
def once(tmp_path_factory: pytest.TempPathFactory) -> Textured:
    return write_textured(tmp_path_factory.mktemp("textured"))


@pytest.fixture
def textured(once: Textured, tmp_path: Path) -> Textured:
    shutil.copytree(once.path.parent, tmp_path / "copy")
    copy = Textured(tmp_path / "copy" / once.path.name, once.pixel_px)
    rows = copy.picks.read_text().splitlines(keepends=True)
    copy.picks.write_text("".join(row for row in rows if NEW not in row))
    return copy


@pytest.fixture
def project(textured: Textured) -> Iterator[tuple[OpenProject, list[Json]]]:
    with opened(textured.path) as (project, sent):
        project.open()
        yield project, sent
        project.picking.stop()


def wait(holds: Callable[[], bool]) -> None:
    latest = time.monotonic() + LONGEST_WAIT_S
    while not holds():
        assert time.monotonic() < latest
        time.sleep(0.005)


def told(project: OpenProject, label: str) -> tuple[list[m.Proposal], list[m.Asked]]:
    """What a page that opens now is told of a label: what was found, and what is asked for."""
    now = project.picking.initial_state()["proposals"]
    found = [one for one in now["found"] if one["label"] == label]
    return found, [one for one in now["asked"] if one["label"] == label]


def click(project: OpenProject, textured: Textured) -> None:
    wait(lambda: project.picking.initial_state()["live"] is not None)
    u, v = textured.pixel_px[NAMES[0], NEW].tolist()
    change(project, "place", image=0, label=NEW, u_px=u, v_px=v)


def test_a_click_is_proposed_in_the_photos_that_show_it_and_accepted_ones_are_saved(
    project: tuple[OpenProject, list[Json]], textured: Textured
) -> None:
    opened_, sent = project
    click(opened_, textured)
    wait(lambda: len(told(opened_, NEW)[0]) == 2)
    found, _ = told(opened_, NEW)
    for one in found:
        truth = textured.pixel_px[NAMES[one["image"]], NEW]
        off = np.hypot(one["u_px"] - truth[0], one["v_px"] - truth[1])
        assert off < 5 * (one["sigma_px"] or 0.0)
        assert one["from_image"] == 0
    assert any(m["t"] == "proposals" and NEW in m["labels"] for m in sent)
    assert len(opened_.picking.state.picks) == 6  # nothing is picked before somebody says so

    answer = change(opened_, "accept", pairs=[[one["image"], NEW] for one in found])
    assert {pick["source"] for pick in answer["diff"]["picks"]["put"]} == {"match"}
    opened_.picking.save()
    picks = read_picks(textured.picks)
    rows = np.flatnonzero(picks.of_source("match"))
    assert {picks.image[i] for i in rows} == {NAMES[one["image"]] for one in found}
    assert {picks.from_image[i] for i in rows} == {NAMES[0]}
    u, v = textured.pixel_px[NAMES[0], NEW]
    assert picks.from_px[rows] == pytest.approx(np.tile([u, v], (2, 1)), abs=0.01)
    assert np.isfinite(picks.sigma_px[rows]).all()
    assert np.isfinite(picks.score[rows]).all()
    change(opened_, "undo")
    assert len(opened_.picking.state.picks) == 6


def test_what_is_refused_is_asked_for_and_the_rest_can_still_be_accepted(
    project: tuple[OpenProject, list[Json]], textured: Textured
) -> None:
    opened_, _ = project
    click(opened_, textured)
    wait(lambda: len(told(opened_, NEW)[0]) == 2)
    opened_.picking.refuse(c.Refuse(pairs=((NAMES[1], NEW),)))
    found, asked = told(opened_, NEW)
    assert [one["image"] for one in found] == [2]
    assert [one["image"] for one in asked] == [1]
    change(opened_, "accept", pairs=[[1, NEW], [2, NEW]])
    assert opened_.picking.state.pick(NAMES[1], NEW) is None
    assert opened_.picking.state.pick(NAMES[2], NEW) is not None
    with pytest.raises(RefusedError, match="not proposed"):
        change(opened_, "accept", pairs=[[1, NEW]])


def test_a_click_that_moves_is_sought_anew(
    project: tuple[OpenProject, list[Json]], textured: Textured
) -> None:
    opened_, _ = project
    click(opened_, textured)
    wait(lambda: len(told(opened_, NEW)[0]) == 2)
    before = {one["image"]: one["u_px"] for one in told(opened_, NEW)[0]}
    u, v = textured.pixel_px[NAMES[0], NEW].tolist()
    change(opened_, "place", image=0, label=NEW, u_px=u + 4.0, v_px=v)
    wait(lambda: {one["u_px"] for one in told(opened_, NEW)[0]}.isdisjoint(before.values()))
    wait(lambda: len(told(opened_, NEW)[0]) == 2)
    for one in told(opened_, NEW)[0]:  # the photos are of about one scale
        assert 2.0 < abs(one["u_px"] - before[one["image"]]) + 1.0 < 7.0


def test_without_poses_page_and_command_find_the_same_in_whatever_order_it_is_picked(
    textured: Textured,
) -> None:
    settings = textured.path.read_text().splitlines(keepends=True)
    left = [line for line in settings if not line.startswith(("poses", "world"))]
    textured.path.write_text("".join(left))
    ends = [("P2", "P4"), ("P3", "P4"), ("P4", "P5")]
    taped = [f"{a}{b},{a},{b},{math.dist(LABELS[a], LABELS[b])},0.01\n" for a, b in ends]
    with textured.path.with_name("lines.csv").open("a") as lines:
        lines.writelines(taped)

    def found(project: OpenProject) -> dict[tuple[int, str], tuple[float, float]]:
        proposals = project.picking.initial_state()["proposals"]["found"]
        return {(one["image"], one["label"]): (one["u_px"], one["v_px"]) for one in proposals}

    def agrees(project: OpenProject, wanted: dict[tuple[int, str], tuple[float, float]]) -> bool:
        now = found(project)
        same = now.keys() == wanted.keys()
        return same and all(math.dist(now[pair], at) < 0.01 for pair, at in wanted.items())

    with opened(textured.path) as (project, _):
        project.open()
        wait(lambda: len(found(project)) == 2 * (len(LABELS) - 1))
        click(project, textured)  # after the others were found
        project.picking.save()
        record = match_picks(textured.path, dry_run=True).record
        matched = {
            (NAMES.index(name), label): one.pixel_px for (name, label), one in record.found.items()
        }
        assert len(matched) == 2 * len(LABELS)
        wait(lambda: agrees(project, matched))
        project.picking.stop()
    with opened(textured.path) as (project, _):
        project.open()
        wait(lambda: agrees(project, matched))
        project.picking.stop()


Places = dict[tuple[int, str], tuple[float, float, float | None]]


@pytest.fixture(scope="module")
def tilted(tmp_path_factory: pytest.TempPathFactory) -> Textured:
    """A project without picks and lengths, and directions 15 degrees beyond their sigma of 1."""
    textured = write_textured(tmp_path_factory.mktemp("tilted"))
    for table in (textured.picks, textured.path.with_name("lines.csv")):
        table.write_text(table.read_text().splitlines(keepends=True)[0])
    poses = textured.path.with_name("poses.csv")
    poses.write_text(poses.read_text().replace(",-90,", ",-75,"))
    return textured


ENDS = [("P1", "P2"), ("P3", "P4"), ("P5", "P6"), ("P2", "P4")]
PICKS: list[tuple[str, Any]] = [("place", label) for label in LABELS]
LINES: list[tuple[str, Any]] = [("line", name) for name in ENDS]
ORDERS: dict[str, list[tuple[str, Any]]] = {
    "points first": [*PICKS, *LINES],
    "backwards": [*PICKS[::-1], *LINES[::-1]],
    "each length at once": [
        *(PICKS[:2] + LINES[:1]),
        *(PICKS[2:4] + LINES[1:2] + LINES[3:]),
        *(PICKS[4:] + LINES[2:3]),
    ],
    "one moved back": [*PICKS[:4], ("aside", "P1"), *PICKS[4:], *LINES, ("place", "P1")],
}
SEARCHED_BETWEEN = {"points first", "one moved back"}
"""Orders at a person's pace: all is found before the next click, as lengths come and picks move."""


def play(tilted: Textured, folder: Path, order: list[tuple[str, Any]], *, waits: bool) -> Places:
    """Click and type in an order, wait or not between two actions; return what is then proposed."""
    shutil.copytree(tilted.path.parent, folder)
    with opened(folder / tilted.path.name) as (project, _):
        project.open()
        picking = project.picking

        def is_searched() -> bool:
            return picking.initial_state()["proposals"]["searched"] == picking.version

        for kind, what in order:
            if kind == "line":
                length = math.dist(*(LABELS[end] for end in what))
                ends = {"start": what[0], "end": what[1], "name": "-".join(what), "was": ""}
                change(project, "line", **ends, length_m=length, sigma_m=0.01, adjust=True)
            else:
                u, v = tilted.pixel_px[NAMES[0], what].tolist()
                at = {"u_px": u + (kind == "aside") * 5.0, "v_px": v}
                change(project, "place", image=0, label=what, **at)
            if waits:
                wait(is_searched)
        wait(is_searched)
        picking.stop()
        found = picking.initial_state()["proposals"]["found"]
    return {(one["image"], one["label"]): (one["u_px"], one["v_px"], one["score"]) for one in found}


def test_proposals_depend_neither_on_the_order_nor_on_the_pace_of_the_clicks(
    tilted: Textured, tmp_path: Path
) -> None:
    wanted = play(tilted, tmp_path / "first", ORDERS["points first"], waits=False)
    assert len(wanted) == 2 * len(LABELS)
    for name, order in ORDERS.items():
        waits = name in SEARCHED_BETWEEN
        assert play(tilted, tmp_path / name, order, waits=waits) == wanted, name
