"""What an earlier session confirmed, could not save, and left in a journal that was put aside.

It is offered: taken over, each change goes the way of one that the page sends, so all of it is
checked, kept, and undone in one step. Nothing is deleted: a journal that was dealt with is renamed.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from uavgram.errors import UavgramError
from uavgram.io.own_files import check_own
from uavgram.picking.document.state import State
from uavgram.picking.storage.journal import JOURNAL, left_in

Json = dict[str, Any]
Changes = tuple[Json, ...]


@dataclass(frozen=True)
class SetAside:
    """A journal that was put aside: its file, the tables before it, and what it made of them."""

    path: Path
    before: State
    after: State

    def rename(self, end: str) -> None:
        """Say in the file's name what became of it."""
        self.path.rename(self.path.with_name(f"{self.path.name}.{end}"))


def oldest_set_aside(folder: Path) -> SetAside | None:
    """The first journal of a folder that was put aside and holds changes; None: there is none."""
    for path in sorted(folder.glob(f"{Path(JOURNAL).stem}-*{Path(JOURNAL).suffix}")):
        try:
            check_own(path)
            left = left_in(path)
        except (UavgramError, OSError):
            continue
        if left.session is None or left.saved is None or left.saved == left.session.state:
            continue
        return SetAside(path, left.saved, left.session.state)
    return None


def changes_of(aside: SetAside, now: State, index: Mapping[str, int]) -> Changes:
    """What was changed, as messages of a page that has `now` before it; `index` numbers photos."""
    return (
        *_removals(aside, now, index),
        *_picks(aside, now, index),
        *_lines(aside, now),
        *_requests(aside, now),
    )


def _removals(aside: SetAside, now: State, index: Mapping[str, int]) -> Changes:
    kept = {pick.key for pick in aside.after.picks}
    lines = {line.name for line in aside.after.lines}
    requests = {one.name for one in aside.after.requests}
    there = {line.name for line in now.lines}, {one.name for one in now.requests}
    return (
        *(
            {"t": "unpick", "image": index.get(pick.image, -1), "label": pick.label}
            for pick in aside.before.picks
            if pick.key not in kept and now.pick(*pick.key) is not None
        ),
        *(
            {"t": "remove-line", "name": line.name}
            for line in aside.before.lines
            if line.name not in lines and line.name in there[0]
        ),
        *(
            {"t": "remove-measurement", "name": one.name}
            for one in aside.before.requests
            if one.name not in requests and one.name in there[1]
        ),
    )


def _picks(aside: SetAside, now: State, index: Mapping[str, int]) -> Changes:
    earlier = {pick.key: pick for pick in aside.before.picks}
    heights = {pick.label: pick.height_m for pick in aside.before.picks}
    said: list[Json] = []
    for pick in aside.after.picks:
        if earlier.get(pick.key) == pick:
            continue
        which = {"image": index.get(pick.image, -1), "label": pick.label}
        said.append(
            {"t": "place", **which, "u_px": pick.u_px, "v_px": pick.v_px, "sigma_px": pick.sigma_px}
        )
        there = now.pick(*pick.key)
        if pick.sigma_px is None and there is not None and there.sigma_px is not None:
            said.append({"t": "sigma", **which, "sigma_px": None})
        if heights.setdefault(pick.label, None) != pick.height_m:
            heights[pick.label] = pick.height_m
            said.append({"t": "height", "label": pick.label, "height_m": pick.height_m})
    return tuple(said)


def _lines(aside: SetAside, now: State) -> Changes:
    there = {line.name for line in now.lines}
    return tuple(
        {
            "t": "line",
            "was": line.name if line.name in there else "",
            "name": line.name,
            "start": line.start,
            "end": line.end,
            "length_m": line.length_m,
            "sigma_m": line.sigma_m,
            "adjust": line.adjust,
        }
        for line in aside.after.lines
        if line not in aside.before.lines
    )


def _requests(aside: SetAside, now: State) -> Changes:
    there = {one.name for one in now.requests}
    return tuple(
        {
            "t": "measure",
            "was": one.name if one.name in there else "",
            "name": one.name,
            "kind": one.kind,
            "points": list(one.points),
            "parameters": dict(one.parameters),
        }
        for one in aside.after.requests
        if one not in aside.before.requests
    )
