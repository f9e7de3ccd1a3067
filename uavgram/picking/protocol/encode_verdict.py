"""The one verdict on an adjustment as JSON: light, reasons, and how far each row can be trusted.

All words are made here and in `views`, so that the page judges nothing itself.
"""

from __future__ import annotations

import math
from typing import Any

from uavgram.model.message import Message
from uavgram.model.result.result import Result
from uavgram.model.result.verdict import Reason, Verdict
from uavgram.views.survey.reliability import weakest_links
from uavgram.views.survey.verdict import STATUS_WORDS, headline

Json = dict[str, Any]


def verdict_json(result: Result) -> Json:
    """Light and reasons.

    ``first`` is the likeliest reason in a sentence or two. ``why`` are all reasons with their
    statistics, where that says more, then whatever else was warned of.
    """
    verdict = result.verdict
    first = Message("warning", "", "")
    if verdict.reasons:
        reason = verdict.reasons[0]
        first = Message("warning", reason.cause, reason.text, labels=reason.labels)
    told = [_at_length(reason, result.messages) for reason in verdict.reasons]
    warned = [message for message in result.messages if message.level != "info"]
    return {
        "level": verdict.level,
        "words": headline(result),
        "first": _remark(first),
        "why": [_remark(m) for m in dict.fromkeys((*told, *warned)) if m.text != first.text],
    }


def _remark(message: Message) -> Json:
    return {
        "level": message.level,
        "code": message.code,
        "text": message.text,
        "labels": list(message.labels),
    }


def _at_length(reason: Reason, messages: tuple[Message, ...]) -> Message:
    """The message that tells a reason at length; where there is none, the reason itself."""
    opening = reason.text.removesuffix(".")
    for message in messages:
        if message.code == reason.cause and message.text.startswith(opening):
            return message
    return Message("warning", reason.cause, reason.text, labels=reason.labels)


def measurement_standings(result: Result) -> list[Json]:
    """How far each measurement can be trusted: a word where it is not in order, and why."""
    rows = result.measurements
    unseen = {link["name"]: _sentence(link["weakest"]) for link in weakest_links(result)}
    standings = []
    for name, points, value, status in zip(
        rows.name, rows.points, rows.value.tolist(), rows.status, strict=True
    ):
        if not math.isfinite(value):  # that there is none says it all
            standings.append({"status": "ok", "words": "", "why": ""})
            continue
        reason = "" if status == "ok" else _reason(result.verdict, name, points)
        error = unseen.get(name, "")
        why = "\n".join(filter(None, (reason, error)))
        words = "" if status == "ok" else STATUS_WORDS[status]
        standings.append({"status": status, "words": words, "why": why})
    return standings


def _sentence(words: str) -> str:
    return f"{words[:1].upper()}{words[1:]}."


def _reason(verdict: Verdict, name: str, points: tuple[str, ...]) -> str:
    """The first reason that names a measurement or one of its points; else the first of all."""
    for reason in verdict.reasons:
        if name in reason.measurements or not set(points).isdisjoint(reason.labels):
            return reason.text
    return verdict.reasons[0].text if verdict.reasons else ""
