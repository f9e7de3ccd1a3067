"""Changes confirmed by an earlier session that could not be saved: a journal put aside.

The page offers them. Once accepted, each change is handled like one that the page sends: all are
checked, kept, and undone in one step. Nothing is deleted: a journal that was dealt with is renamed.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from uavgram.errors import UavgramError
from uavgram.model.observations import MeasurementRequest
from uavgram.picking.document.state import Line, Pick, State
from uavgram.picking.storage.journal import JOURNAL, load_journal

Json = dict[str, Any]
Changes = tuple[Json, ...]

ON_GROUND: Json = {"height_m": None, "height_sigma_m": None, "is_free": False}
"""Height fields of a pick without a stated height."""


@dataclass(frozen=True)
class SetAside:
    """Journal that was put aside: its file, and the states before and after its commands."""

    path: Path
    before: State
    after: State

    def rename(self, end: str) -> None:
        """Rename the file, so that its name shows what became of it."""
        self.path.replace(self.path.with_name(f"{self.path.name}.{end}"))


def find_oldest(folder: Path) -> SetAside | None:
    """Return the oldest journal of a folder that was put aside and holds changes; None if none."""
    for path in sorted(folder.glob(f"{Path(JOURNAL).stem}-*{Path(JOURNAL).suffix}")):
        try:
            left = load_journal(path)
        except (UavgramError, OSError):
            continue
        if left.session is None or left.saved is None or left.saved == left.session.state:
            continue
        return SetAside(path, left.saved, left.session.state)
    return None


def list_changes(aside: SetAside, now: State, index: Mapping[str, int]) -> Changes:
    """Return the changes of the journal as messages that a page would send.

    Parameters
    ----------
    aside
        Changes that an earlier session could not save.
    now
        State to which the messages are to be applied.
    index
        Numbers of the photos by name.
    """
    return (
        *_removals(aside, now, index),
        *_picks(aside, now, index),
        *_list_additions("line", aside.before.lines, aside.after.lines, now.lines),
        *(
            one | {"parameters": dict(one["parameters"])}
            for one in _list_additions(
                "measure", aside.before.requests, aside.after.requests, now.requests
            )
        ),
    )


def _removals(aside: SetAside, now: State, index: Mapping[str, int]) -> Changes:
    kept = {pick.key for pick in aside.after.picks}
    return (
        *(
            {"t": "unpick", "image": index.get(pick.image, -1), "label": pick.label}
            for pick in aside.before.picks
            if pick.key not in kept and now.pick(*pick.key) is not None
        ),
        *_list_removals("remove-line", aside.before.lines, aside.after.lines, now.lines),
        *_list_removals(
            "remove-measurement", aside.before.requests, aside.after.requests, now.requests
        ),
    )


Named = Sequence[Line] | Sequence[MeasurementRequest]


def _list_removals(kind: str, before: Named, after: Named, now: Named) -> Changes:
    """Return removals of the items that were removed then and still exist now."""
    kept, there = ({one.name for one in some} for some in (after, now))
    names = (one.name for one in before)
    return tuple({"t": kind, "name": name} for name in names if name in there - kept)


def _picks(aside: SetAside, now: State, index: Mapping[str, int]) -> Changes:
    earlier = {pick.key: pick for pick in aside.before.picks if not pick.again}
    heights = {pick.label: pick.height for pick in aside.before.picks}
    changes: list[Json] = []
    for pick in aside.after.picks:
        if pick.again:
            if pick not in now.picks:
                where = {"image": index.get(pick.image, -1), "label": pick.label}
                changes.append({"t": "repeat", **where, "u_px": pick.u_px, "v_px": pick.v_px})
            continue
        if earlier.get(pick.key) == pick:
            continue
        which = {"image": index.get(pick.image, -1), "label": pick.label}
        place = {"u_px": pick.u_px, "v_px": pick.v_px, "sigma_px": pick.sigma_px}
        changes.append({"t": "place", **which, **place, **_origin(pick, index)})
        there = now.pick(*pick.key)
        if pick.sigma_px is None and there is not None and there.sigma_px is not None:
            changes.append({"t": "sigma", **which, "sigma_px": None})
        if heights.setdefault(pick.label, ON_GROUND) != pick.height:
            heights[pick.label] = pick.height
            changes.append({"t": "height", "label": pick.label, **pick.height})
    return tuple(changes)


def _origin(pick: Pick, index: Mapping[str, int]) -> Json:
    """Return the origin of a pick found by the program; empty for a person's pick."""
    if pick.source == "hand":
        return {}
    names = ("source", "score", "from_u_px", "from_v_px")
    fields = {name: getattr(pick, name) for name in names}
    return fields | {"from_image": index.get(pick.from_image)}


def _list_additions(kind: str, before: Named, after: Named, now: Named) -> Changes:
    """Return additions and changes; an existing item of that name is changed."""
    there = {one.name for one in now}
    return tuple(
        {"t": kind, "was": one.name if one.name in there else "", **vars(one)}
        for one in after
        if one not in before
    )
