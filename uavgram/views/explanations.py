"""Catalogue of messages as text: one entry, a list of all, and docs/messages.md."""

from __future__ import annotations

import re
import textwrap
from difflib import get_close_matches

from uavgram.errors import UavgramError, replace_lookalikes
from uavgram.model.message_catalogue import Effect, Entry, entries_by_code, list_subjects

TERMINAL_COLUMNS, PAGE_COLUMNS = 79, 118
MAX_SUGGESTED = 4
LEVEL_WORDS = {"error": "error", "warning": "warning", "info": "note"}

INTRODUCTION = (
    "Each message of the program ends with its code: on screen (`warning: ... [pick-suspect]`), in "
    "the report, in the recording, on the picking page and in `messages` of `results.json`. This "
    "page explains every code: the finding, its consequence for the numbers, its effect on the "
    "verdict, and the action. `uavgram explain CODE` prints the same.",
    "- *Error*: the result is unusable, or a requested value could not be computed.\n"
    "- *Warning*: check it before you use the numbers.\n"
    "- *Note*: a decision of the program, or a fact worth knowing.",
    "Messages are sorted by likely cause. Correct the first, then run again. In `results.json`, "
    "each of the verdict's `reasons` states the error in one sentence (`plain`). Where a "
    "correction is known, `mend` gives the change of each pick, label, length or height, in words "
    "and as data, and `instead` the alternatives that fit as well. The picking page shows them "
    "as buttons. In messages, *w* is the misfit of a reading in its own standard deviations, and "
    "*sigma* is a standard deviation.",
    "This page is generated from the catalogue, `uavgram/model/message_catalogue.ini`: "
    "`uavgram explain --markdown > docs/messages.md`.",
)
"""Paragraphs before the index of docs/messages.md."""


def explanation(code: str) -> list[str]:
    """Return the lines that explain a code.

    Raises
    ------
    UavgramError
        If no message has this code; names the nearest codes.
    """
    entry = entries_by_code().get(code.strip("[] ").lower())
    if entry is None:
        raise UavgramError(_explain_unknown_code(code))
    lines = [f"{entry.code}: {_levels(entry)}", ""]
    for head, text in _parts(entry):
        lines += textwrap.wrap(
            f"{head + ':':13}{text}", TERMINAL_COLUMNS, subsequent_indent=" " * 13
        )
    return lines


def list_codes() -> list[str]:
    """Return one line for each code, by subject: the first sentence of its finding."""
    width = max(map(len, entries_by_code()))
    lines = []
    for subject in list_subjects():
        rows = ((entry.code, entry.finding.split(". ")[0]) for entry in subject.entries)
        lines += ["", subject.title]
        lines += [f"  {code:{width}}  {finding.removesuffix('.')}" for code, finding in rows]
    return lines[1:]


def messages_page() -> str:
    """Return docs/messages.md: every entry, by subject."""
    titles = [subject.title for subject in list_subjects()]
    index = "\n".join(f"- [{title}](#{_anchor(title)})" for title in titles)
    intro = [one if one.startswith("-") else _fill(one) for one in INTRODUCTION]
    blocks = ["# Messages", *intro, index]
    for subject in list_subjects():
        blocks.append(f"## {subject.title}")
        if subject.introduction:
            blocks.append(_fill(subject.introduction))
        for entry in subject.entries:
            (_, finding), *rest = _parts(entry)
            level = _levels(entry)
            blocks += [f"### {entry.code}", _fill(f"*{level.capitalize()}.* {finding}")]
            blocks.append("\n".join(_fill(f"- *{head}:* {text}", "  ") for head, text in rest))
    return "\n\n".join(blocks) + "\n"


def _parts(entry: Entry) -> list[tuple[str, str]]:
    """Return heading and text of each part that an entry has; the finding is the first."""
    parts = (
        ("Finding", entry.finding),
        ("Consequence", entry.consequence),
        ("Verdict", "" if entry.effect is Effect.NONE else entry.effect.value),
        ("Action", entry.action or "Nothing has to be done."),
    )
    return [(head, text) for head, text in parts if text]


def _levels(entry: Entry) -> str:
    """Return ``warning or note``."""
    return " or ".join(LEVEL_WORDS[level] for level in entry.levels)


def _explain_unknown_code(code: str) -> str:
    by_look = {replace_lookalikes(known): known for known in entries_by_code()}
    near = get_close_matches(replace_lookalikes(code), by_look, n=MAX_SUGGESTED, cutoff=0.65)
    listed = ", ".join(by_look[one] for one in near)
    return (
        f"No message has the code {code!r}. "
        + (f"The nearest codes: {listed}. " if near else "")
        + "`uavgram explain` lists all codes."
    )


def _anchor(title: str) -> str:
    """Return the anchor that GitHub gives a heading."""
    return re.sub(r"[^\w\- ]", "", title.lower()).replace(" ", "-")


def _fill(text: str, indent: str = "") -> str:
    """Return a paragraph in lines of the page's width, all but the first indented."""
    return textwrap.fill(
        text,
        PAGE_COLUMNS,
        subsequent_indent=indent,
        break_long_words=False,
        break_on_hyphens=False,
    )
