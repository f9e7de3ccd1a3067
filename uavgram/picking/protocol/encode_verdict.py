"""The verdict on an adjustment as JSON: colour, reasons, and status of each measurement.

All words are made here and in `views`, so that the page judges nothing itself.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

from uavgram.model.message import Message
from uavgram.model.observations import KnownLines
from uavgram.model.result.reliability import Reason, Verdict
from uavgram.model.result.result import Result
from uavgram.picking.protocol import messages as m
from uavgram.picking.protocol.encode_remarks import NOTHING, Remarks
from uavgram.picking.protocol.encode_statuses import describe_undetectable
from uavgram.views.survey.reliability import weakest_links
from uavgram.views.survey.verdict import STATUS_WORDS, summarise_result


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
    }


def _at_length(reason: Reason, messages: tuple[Message, ...]) -> Message | None:
    """Return the detailed message of a reason; None if there is none."""
    opening = reason.text.removesuffix(".")
    for message in messages:
        if message.code == reason.cause and message.text.startswith(opening):
            return message
    return None


def encode_measurement_statuses(result: Result) -> list[m.Trust]:
    """Return the status of each measurement: a word unless it is ok, and the reason."""
    rows = result.measurements
    unseen = {link["name"]: _sentence(link["weakest"]) for link in weakest_links(result)}
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
