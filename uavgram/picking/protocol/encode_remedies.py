"""Remedies of a result as JSON: the changes that the page's buttons send."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from uavgram.model.message import Correction, Remedy
from uavgram.model.observations import KnownLines
from uavgram.picking.protocol import messages as m
from uavgram.picking.protocol.messages import Json


def remedies_json(
    remedies: Iterable[Remedy | None], lines: KnownLines, index: Mapping[str, int]
) -> list[m.Mend]:
    """Return the button text and the changes of each remedy that edits the inputs.

    A remedy that asks to read a length again changes nothing by itself: it ``opens`` that length.

    Parameters
    ----------
    remedies
        Remedies, likeliest first; None for a cause without one.
    lines
        Known lengths as adjusted.
    index
        Numbers of the photos by name.

    Notes ----- A remedy for a photo or a length that the page does not have is left out: applying
    half of it would be worse than nothing.
    """
    found: list[m.Mend] = []
    for remedy in dict.fromkeys(one for one in remedies if one is not None):
        if remedy.action == "read":
            names = [one.length for one in remedy.corrections]
            if all(lines.name.count(name) == 1 for name in names):
                found.append({"words": remedy.words, "changes": [], "opens": names[0]})
            continue
        changes = [
            change
            for one in remedy.corrections
            if (change := _change(one, lines, index)) is not None
        ]
        if changes and len(changes) == len(remedy.corrections):
            found.append({"words": remedy.words, "changes": changes})
    return found


def _change(one: Correction, lines: KnownLines, index: Mapping[str, int]) -> Json | None:
    """Return a change in the form that the page sends; None if the page has no such item."""
    if one.action in ("length", "ends", "remove-length"):
        return _line(one, lines)
    if one.frame and one.frame not in index:
        return None
    image = index.get(one.frame)
    what: Json = {"label": one.label}
    if one.action == "swap":
        what |= {"t": "swap", "image": image, "other": one.other}
    elif one.action == "unpick":
        what |= {"t": "unpick", "image": image}
    elif one.action == "move":
        u, v = one.pixel_px
        what |= {"t": "place", "image": image, "u_px": u, "v_px": v}
    elif one.action in ("free", "on-ground"):
        what |= {"t": "height", "height_m": None, "is_free": one.action == "free"}
    else:
        return None
    return what


def _line(one: Correction, lines: KnownLines) -> Json | None:
    if lines.name.count(one.length) != 1:
        return None
    if one.action == "remove-length":
        return {"t": "remove-line", "name": one.length}
    i = lines.name.index(one.length)
    start, end = one.ends or (lines.start[i], lines.end[i])
    return {
        "t": "line",
        "was": one.length,
        "name": one.length,
        "start": start,
        "end": end,
        "length_m": float(lines.length_m[i]) if one.length_m is None else one.length_m,
        "sigma_m": float(lines.sigma_m[i]),
        "adjust": bool(lines.adjust[i]),
    }
