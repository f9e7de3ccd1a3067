"""The verdict on an adjustment as JSON: reasons with remedies, and the status of each observation.

All words are made here and in `views`, and the verdict on the whole survey is applied to its rows
here, so that the page judges nothing itself.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import partial

import numpy as np

from uavgram.estimation.reliability.redundancy import MIN_REDUNDANCY
from uavgram.model.message import JUST_AS_LIKELY, Correction, Message, Remedy
from uavgram.model.message_catalogue import entry_of
from uavgram.model.naming import format_count
from uavgram.model.observations import KnownLines
from uavgram.model.result.reliability import MeasurementStatus, Reason, Verdict, WeakestLinks
from uavgram.model.result.result import Result
from uavgram.model.result.tables import MeasurementResults, PickResults
from uavgram.picking.protocol import messages as m
from uavgram.picking.protocol.ways_on_page import find_set_up
from uavgram.stages.judge.verdict import make_reason
from uavgram.views.formatting import size_text
from uavgram.views.survey.reliability import weakest_links
from uavgram.views.survey.verdict import (
    STATUS_WORDS,
    CheckedReadings,
    classify_readings,
    describe_height,
    describe_shift,
    describe_undetectable,
    list_named_picks,
    summarise_result,
)

NOTHING = Reason(cause="", text="")
MAX_NAMES = 3


def verdict_json(result: Result, lines: KnownLines, index: Mapping[str, int]) -> m.Verdict:
    """Return colour, reasons, and lengths in which a wrong reading would not show.

    ``first`` is the likeliest reason in a sentence or two. ``why`` holds all reasons, with their
    statistics where these add something, then all other warnings.

    Parameters
    ----------
    result
        Result of an adjustment.
    lines
        Known lengths of that adjustment.
    index
        Numbers of the photos by name.
    """
    verdict, remarks = result.verdict, Remarks(result.picks, lines, index)
    first = remarks.json(verdict.reasons[0] if verdict.reasons else NOTHING)
    found = [
        remarks.json(reason, _at_length(reason, result.messages)) for reason in verdict.reasons
    ]
    reasons = {one["text"] for one in found}
    warned = [one for one in dict.fromkeys(result.messages) if one.level != "info"]
    more = [remarks.of_message(one) for one in warned if one.text not in reasons]
    return {
        "level": verdict.level,
        "words": summarise_result(result),
        "first": first,
        "why": [one for one in (*found, *more) if one["text"] != first["text"]],
        "reasons": len(verdict.reasons),
        "unseen": describe_undetectable(result),
        "height": partial(describe_height, result),
    }


def _at_length(reason: Reason, messages: tuple[Message, ...]) -> Message | None:
    """Return the detailed message of a reason; None if there is none."""
    opening = reason.text.removesuffix(".")
    for message in messages:
        if message.code == reason.cause and message.text.startswith(opening):
            return message
    return None


@dataclass(frozen=True)
class Remarks:
    """Survey to which remarks refer.

    Attributes
    ----------
    picks
        Fit of each pick.
    lines
        Known lengths as adjusted.
    index
        Numbers of the photos by name.
    """

    picks: PickResults
    lines: KnownLines
    index: Mapping[str, int]

    def of_message(self, message: Message) -> m.Remark:
        """Encode a warning that is no reason of the verdict."""
        return self.json(make_reason(message), message)

    def json(self, reason: Reason, at_length: Message | None = None) -> m.Remark:
        """Encode a reason of the verdict.

        Parameters
        ----------
        reason
            The reason.
        at_length
            Message that describes it with its statistics, if there is one.
        """
        text = at_length.text if at_length else reason.text
        plain = reason.plain or reason.text
        if reason.plain and reason.mend is None and ". " not in plain:  # the finding alone
            plain = f"{plain} {entry_of(reason.cause).action}".rstrip()
        mends = remedies_json((reason.mend, *reason.instead), self.lines, self.index)
        if reason.equals and not _are_compared(mends):
            # No photo shows which cause is the right one: a change may make it worse.
            mends = [one for one in mends if "way" in one]
            rivals = [f"{JUST_AS_LIKELY} {one}" for one in reason.equals]
            plain = " ".join((plain, *rivals, "Look at each before you change anything."))
        if reason.cause == "mount-stated":
            recorded: m.Way = {"to": "recorded", "names": []}
            mends.append({"words": "Use the recorded angles", "changes": [], "way": recorded})
        if reason.plain and reason.mend and reason.mend.action == "tape":  # no button does that
            plain = f"{plain} {reason.mend.words}."
        if settings := find_set_up(f"{text} {plain}"):
            way: m.Way = {"to": "set-up", "names": settings}
            mends.append({"words": "Open the set-up", "changes": [], "way": way})
        return {
            "level": at_length.level if at_length else "warning",
            "code": reason.cause,
            "text": text,
            "plain": plain,
            "labels": list(reason.labels),
            "frames": [self.index[name] for name in reason.frames if name in self.index],
            "lengths": list(reason.lengths),
            "measurements": list(reason.measurements),
            "mends": mends,
            "show": self._show(reason),
        }

    def _show(self, reason: Reason) -> list[m.PhotoLabel]:
        """Return the most doubtful of the picks that a reason names; of each of a few points.

        Of one point whose picks contradict each other, in each of their photos.

        For a length, in a photo that shows both ends, if there is one: the length is drawn there.
        """
        frames, ends = set(reason.frames), self._ends(reason)
        groups = [set(reason.labels) | ends]
        if not frames and not ends and len(reason.labels) <= MAX_NAMES:
            groups = [{label} for label in reason.labels]
        if len(reason.labels) == 1 and not ends and 1 < len(frames) <= MAX_NAMES:
            each = (self._find_doubtful({frame}, groups[0]) for frame in reason.frames)
            return [one for one in each if one is not None]
        frames = frames or self._photos_of(ends)
        found = (self._find_doubtful(frames, labels) for labels in groups)
        return [one for one in found if one is not None]

    def _find_doubtful(self, frames: set[str], labels: set[str]) -> m.PhotoLabel | None:
        """Return a pick of some labels in some photos; empty: of any.

        The first that was left out, else the worst-fitting click of a person: what the program
        found depends on a click.
        """
        if not frames and not labels:
            return None
        picks = self.picks
        rows = [
            row
            for row, (image, label) in enumerate(zip(picks.image, picks.label, strict=True))
            if (not frames or image in frames) and (not labels or label in labels)
            if image in self.index
        ]
        if not rows:
            return None

        def doubt(row: int) -> tuple[bool, bool, float]:
            off = math.hypot(*picks.residual_px[row].tolist())
            is_used = math.isfinite(off)
            return not is_used, picks.source[row] == "hand", off if is_used else 0.0

        worst = max(rows, key=doubt)
        return {"image": self.index[picks.image[worst]], "label": picks.label[worst]}

    def _ends(self, reason: Reason) -> set[str]:
        """Return the end labels of the lengths that a reason names."""
        rows = [i for i, name in enumerate(self.lines.name) if name in reason.lengths]
        return {one for i in rows for one in (self.lines.start[i], self.lines.end[i])}

    def _photos_of(self, labels: set[str]) -> set[str]:
        """Return the photos in which all of some labels are picked."""
        seen: dict[str, set[str]] = {}
        for image, label in zip(self.picks.image, self.picks.label, strict=True):
            seen.setdefault(image, set()).add(label)
        return {image for image, here in seen.items() if labels and labels <= here}


def remedies_json(
    remedies: Iterable[Remedy | None], lines: KnownLines, index: Mapping[str, int]
) -> list[m.Mend]:
    """Return the button text and the changes of each remedy that edits the inputs.

    A remedy that asks to read a length again, or to leave a photo out, changes no pick by itself:
    it is a ``way`` to go.

    Parameters
    ----------
    remedies
        Remedies, likeliest first; None for a cause without one.
    lines
        Known lengths as adjusted.
    index
        Numbers of the photos by name.

    Notes
    -----
    A remedy for a photo or a length that the page does not have is left out: applying half of it
    would be worse than nothing.
    """
    found: list[m.Mend] = []
    for remedy in dict.fromkeys(one for one in remedies if one is not None):
        if (way := _way(remedy, lines, index)) is not None:
            found.append({"words": remedy.words, "changes": [], "way": way})
            continue
        every = (_change(one, lines, index) for one in remedy.corrections)
        changes = [change for change in every if change is not None]
        if changes and len(changes) == len(remedy.corrections):
            found.append({"words": remedy.words, "changes": changes})
    return found


def _are_compared(mends: Iterable[m.Mend]) -> bool:
    """Return whether the remedies swap labels in several photos, whose places the page shows."""
    swaps = [one for one in mends if any(change["t"] == "swap" for change in one["changes"])]
    return len(swaps) > 1


def _way(remedy: Remedy, lines: KnownLines, index: Mapping[str, int]) -> m.Way | None:
    """Return where a remedy leads that changes no pick; None if the page has no such place."""
    lengths = [one.length for one in remedy.corrections]
    frames = [one.frame for one in remedy.corrections]
    if remedy.action == "read" and all(lines.name.count(name) == 1 for name in lengths):
        return {"to": "length", "names": lengths}
    if remedy.action == "leave-out" and all(frame in index for frame in frames):
        return {"to": "leave-out", "names": frames}
    return None


def _change(one: Correction, lines: KnownLines, index: Mapping[str, int]) -> m.Json | None:
    """Return a change in the form that the page sends; None if the page has no such item."""
    if one.action in ("length", "ends", "remove-length"):
        return _line(one, lines)
    if one.frame and one.frame not in index:
        return None
    image = index.get(one.frame)
    what: m.Json = {"label": one.label}
    if one.action == "swap":
        what |= {"t": "swap", "image": image, "other": one.other}
    elif one.action == "unpick":
        what |= {"t": "unpick", "image": image}
    elif one.action == "take-back":
        what |= {"t": "unpick", "image": image, "is_repetition": True}
    elif one.action == "move":
        u, v = one.pixel_px
        what |= {"t": "place", "image": image, "u_px": u, "v_px": v}
    elif one.action in ("free", "on-ground"):
        what |= {"t": "height", "height_m": None, "is_free": one.action == "free"}
    else:
        return None
    return what


def _line(one: Correction, lines: KnownLines) -> m.Json | None:
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


UNCHECKED_POINT = (
    "Nothing checks it: a wrong click here would not show. Mark it in one more photo, or tape a "
    "length to it."
)
UNDETECTABLE_LENGTH = "Not used: mark both of its ends in photos."
REMOVED_LENGTH = "It does not fit and was left out: read the tape again."
REMOVED_PICK = "A mark of it does not fit and was left out: look at it in its photos."
SUSPECT_PICK = "A mark of it does not fit the others: look at it in its photos."
REJECTED_PHOTO = "It does not fit the others and was left out."


def encode_point_statuses(result: Result) -> dict[str, m.Trust]:
    """Return the status of each point, and its reason."""
    picks, named = result.picks, list_named_picks(result.verdict)
    redundancy: dict[str, float] = {}
    states: dict[str, set[str]] = {}
    for image, label, status, share in zip(
        picks.image, picks.label, picks.status, picks.redundancy.tolist(), strict=True
    ):
        shown = "suspect" if (image, label) in named else status
        states.setdefault(label, set()).add(shown)
        redundancy[label] = max(redundancy.get(label, 0.0), float(np.nan_to_num(share)))
    standings = {}
    for label in result.points.label:
        own: tuple[MeasurementStatus, str] = ("ok", "")
        if "removed" in states.get(label, ()):
            own = ("doubtful", REMOVED_PICK)
        elif "suspect" in states.get(label, ()):
            own = ("doubtful", SUSPECT_PICK)
        elif redundancy.get(label, 0.0) <= MIN_REDUNDANCY:
            own = ("not-checked", UNCHECKED_POINT)
        standings[label] = _worse_status(
            result.verdict, own, (r for r in result.verdict.reasons if label in r.labels)
        )
    return standings


def encode_length_statuses(result: Result) -> list[m.LengthTrust]:
    """Return the status of each known length, its reason, and its minimal detectable bias."""
    readings = classify_readings(result.lines)
    return [
        {**_length(result, i, readings), "shows": shows}
        for i, shows in enumerate(_describe_detectable(result))
    ]


def _length(result: Result, i: int, readings: CheckedReadings) -> m.Trust:
    lines = result.lines
    own: tuple[MeasurementStatus, str] = ("ok", "")
    if lines.status[i] == "removed":
        own = ("contradicted", REMOVED_LENGTH)
    elif lines.status[i] == "suspect":
        own = ("doubtful", "It does not fit the others: read the tape again.")
    elif lines.status[i] == "unseen":
        own = ("not-checked", UNDETECTABLE_LENGTH)
    elif any(mask[i] for mask in readings):
        own = ("not-checked", "A mistake of 0.10 m in reading the tape would not be noticed.")
    reasons = (r for r in result.verdict.reasons if lines.name[i] in r.lengths)
    found = _worse_status(result.verdict, own, reasons)
    is_rough = readings.roughly[i] and found["status"] == "not-checked"
    return {**found, "words": "roughly checked"} if is_rough else found


def encode_photo_statuses(result: Result) -> list[m.Trust]:
    """Return the status of each photo, and its reason."""
    frames, verdict = result.frames, result.verdict
    standings: list[m.Trust] = []
    for name, status in zip(frames.frame_id, frames.status, strict=True):
        reasons = [reason for reason in verdict.reasons if name in reason.frames]
        if status == "rejected":
            own: tuple[MeasurementStatus, str] = ("contradicted", REJECTED_PHOTO)
            standings.append(_worse_status(verdict, own, iter(reasons)))
        elif status == "refined" or reasons:
            standings.append(_worse_status(verdict, ("ok", ""), iter(reasons)))
        else:  # the photo takes no part: nothing shown depends on it
            standings.append({"status": "ok", "words": "", "why": ""})
    return standings


def encode_measurement_statuses(result: Result) -> list[m.Trust]:
    """Return the status of each measurement: a word unless it is ok, and the reason."""
    rows = result.measurements
    unseen = {link.name: _sentence(link.weakest) for link in weakest_links(result)}
    standings: list[m.Trust] = []
    is_red = result.verdict.level == "red"
    for name, points, value, found in zip(
        rows.name, rows.points, rows.value.tolist(), rows.status, strict=True
    ):
        if not math.isfinite(value):  # an absent value needs no further words
            standings.append({"status": "ok", "words": "", "why": ""})
            continue
        status = "doubtful" if is_red and found == "not-checked" else found
        reason = "" if status == "ok" else _reason(result.verdict, name, points)
        error = unseen.get(name, "")
        why = "\n".join(filter(None, (reason, error)))
        words = "" if status == "ok" else STATUS_WORDS[status]
        standings.append({"status": status, "words": words, "why": why})
    return standings


def _sentence(words: str) -> str:
    return f"{words[:1].upper()}{words[1:]}."


def _reason(verdict: Verdict, name: str, points: tuple[str, ...]) -> str:
    """Return the first reason that names a measurement or one of its points, else the first."""
    for reason in verdict.reasons:
        if name in reason.measurements or not set(points).isdisjoint(reason.labels):
            return reason.text
    return verdict.reasons[0].text if verdict.reasons else ""


_RANK: dict[MeasurementStatus, int] = {"ok": 0, "not-checked": 1, "doubtful": 2, "contradicted": 3}


def _worse_status(
    verdict: Verdict, own: tuple[MeasurementStatus, str], reasons: Iterator[Reason]
) -> m.Trust:
    """Return the worse of a row's own status and the status that follows from the verdict.

    In a red result no row is ok: a row that a reason names is contradicted, all others doubtful.
    """
    status, why = own
    reason = next(reasons, None)
    least: MeasurementStatus = "ok"
    if reason is not None:
        least = "not-checked" if reason.cause == "nothing-checks" else "doubtful"
    if verdict.level == "red":
        least = "doubtful" if reason is None else "contradicted"
        reason = reason or next(iter(verdict.reasons), None)
    if _RANK[least] >= _RANK[status] and least != "ok":
        status, why = least, why if reason is None else reason.text
    return {"status": status, "words": "" if status == "ok" else STATUS_WORDS[status], "why": why}


def _describe_detectable(result: Result) -> list[str]:
    """Return the minimal detectable bias of each used length in words, with its effect."""
    lines, found = result.lines, []
    for i, status in enumerate(lines.status):
        words = ""
        if status in ("used", "suspect"):
            words = "nothing checks it: however wrong the tape was read, it would not show"
            if math.isfinite(lines.mdb_m[i]):
                size = size_text(float(lines.mdb_m[i]))
                words = f"a tape misread by less than {size} would not be noticed"
                if moved := describe_shift(result, i):
                    words += f"; it would make {moved}"
        found.append(words)
    return found


def describe_unchecked(rows: MeasurementResults, links: WeakestLinks | None) -> list[str]:
    """Name the observation without redundancy of each unchecked measurement; empty for others.

    Parameters
    ----------
    rows
        The M measurements.
    links
        Unchecked observations of each measurement; None if they were not computed.
    """
    found = [""] * len(rows.name)
    for i, status in enumerate(rows.status):
        if links is None or status != "not-checked" or not links.unchecked[i]:
            continue
        unchecked = list(dict.fromkeys(links.unchecked[i]))  # a lens has several numbers
        own = [one for one in unchecked if any(repr(label) in one for label in rows.points[i])]
        others = len(unchecked) - 1
        more = f", nor one in {format_count(others, 'other value')}" if others else ""
        named = (own or unchecked)[0]
        where = named.replace("pick of", "click on")
        found[i] = f"an error in the {where} would not be noticed{more}"
    return found
