"""Status of each point, length and photo as JSON, and minimal detectable biases.

The verdict on the whole survey is applied to its rows here, so that the page judges nothing.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from uavgram.estimation.reliability.redundancy import MIN_REDUNDANCY
from uavgram.model.naming import counted, listed
from uavgram.model.result.reliability import MeasurementStatus, Reason, Verdict, WeakestLinks
from uavgram.model.result.result import Result
from uavgram.model.result.tables import MeasurementResults
from uavgram.picking.protocol import messages as m
from uavgram.views.formatting import UNIT_WORDS, number, size_text
from uavgram.views.survey.verdict import STATUS_WORDS, list_named_picks

READING_ERROR_M = 0.1
"""Assumed error of a misread tape [m]: one digit of the decimetres, at least.

A length with a larger minimal detectable bias does not check its own reading.
"""

UNCHECKED_POINT = (
    "Nothing checks it: a wrong click here would not show. Mark it in one more photo, or tape a "
    "length to it."
)
UNDETECTABLE_LENGTH = "Not used: mark both of its ends in photos."
REMOVED_LENGTH = "It does not fit and was left out: read the tape again."
REMOVED_PICK = "A mark of it does not fit and was left out: look at it in its photos."
SUSPECT_PICK = "A mark of it does not fit the others: look at it in its photos."
_CAMERA_WORDS = {
    **dict.fromkeys(("fx", "fy"), "camera's focal length"),
    **dict.fromkeys(("cx", "cy"), "middle of the camera's picture"),
    **dict.fromkeys(
        ("k1", "k2", "k3", "k4", "k5", "k6", "p1", "p2"), "distortion of the camera's lens"
    ),
}
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
    return [
        {**_length(result, i), "shows": shows}
        for i, shows in enumerate(_describe_detectable(result))
    ]


def _length(result: Result, i: int) -> m.Trust:
    lines = result.lines
    own: tuple[MeasurementStatus, str] = ("ok", "")
    if lines.status[i] == "removed":
        own = ("contradicted", REMOVED_LENGTH)
    elif lines.status[i] == "suspect":
        own = ("doubtful", "It does not fit the others: read the tape again.")
    elif lines.status[i] == "unseen":
        own = ("not-checked", UNDETECTABLE_LENGTH)
    elif lines.status[i] == "used" and not lines.mdb_m[i] <= READING_ERROR_M:
        own = ("not-checked", "A tape read 0.10 m wrong would not show in it.")
    reasons = (r for r in result.verdict.reasons if lines.name[i] in r.lengths)
    return _worse_status(result.verdict, own, reasons)


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
    lines, evidence, unit_of = result.lines, result.evidence, _units(result)
    found = []
    for i, status in enumerate(lines.status):
        words = ""
        if status in ("used", "suspect"):
            words = "nothing checks it: no error in it would show"
            if math.isfinite(lines.mdb_m[i]):
                words = f"an error shows from {size_text(float(lines.mdb_m[i]))} on"
                on = "" if evidence is None else evidence.lines.on[i]
                if evidence is not None and on:
                    by = number(abs(float(evidence.lines.change[i])), 2)
                    words += f"; it would move {on} by {by} {unit_of[on]}"
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
        unchecked = links.unchecked[i]
        own = [one for one in unchecked if any(repr(label) in one for label in rows.points[i])]
        others = len(unchecked) - 1
        more = f", nor in {counted(others, 'other given value')}" if others else ""
        named = (own or unchecked)[0]
        found[i] = f"no error would show in the {_CAMERA_WORDS.get(named, named)}{more}"
    return found


def describe_undetectable(result: Result) -> str:
    """Return a sentence on lengths in which a misread tape would not show; empty without one."""
    lines = result.lines
    weak = [
        name
        for name, status, mdb_m in zip(lines.name, lines.status, lines.mdb_m.tolist(), strict=True)
        if status == "used" and not mdb_m <= READING_ERROR_M
    ]
    if not weak:
        return ""
    names = listed(weak, MAX_NAMES)
    return f"A tape read 0.10 m wrong would not show in {names}: tape one more length near it."


MAX_NAMES = 3


def _units(result: Result) -> dict[str, str]:
    rows = result.measurements
    return {n: UNIT_WORDS.get(unit, unit) for n, unit in zip(rows.name, rows.unit, strict=True)}
