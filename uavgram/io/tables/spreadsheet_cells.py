"""Text of others in cells that a spreadsheet would take for a formula, and back.

A spreadsheet runs what a cell begins with ``=``, ``+``, ``-`` or ``@`` (also in their full-width
forms, and behind a tab or a line break), so ``=cmd|...`` as the name of a measurement would start a
program (owasp.org, "CSV Injection"). An apostrophe before it makes it text. Where a semicolon
separates cells, as in half of Europe, what follows one begins a cell too. A number stays a number.

``readable(guarded(text)) == text`` for every text, and what was never guarded is read as it is,
but for text that begins with an apostrophe and a formula: that one apostrophe is taken for ours.
"""

from __future__ import annotations

import re

_NUMBER = re.compile(r"[-+]?([0-9]+[.,]?[0-9]*|[.,][0-9]+)([eE][-+]?[0-9]+)?")
_RUNS = re.compile(r"[\s'\0]*[=+\-@\uff1d\uff0b\uff0d\uff20]|[ ']*[\t\r\n]")
"""The beginning of what runs, behind any apostrophes, so that one more changes nothing in it."""


def runs(text: str) -> bool:
    """Whether a cell, or what follows a semicolon in it, begins as a formula does."""
    parts = text.split(";")
    return any(_begins_a_formula(part) and not part.startswith("'") for part in parts)


def guarded(text: str) -> str:
    """Text as a cell that no spreadsheet runs."""
    if not _RUNS.match(text) and ";" not in text:
        return text
    return ";".join("'" + part if _begins_a_formula(part) else part for part in text.split(";"))


def readable(cell: str) -> str:
    """Text of a cell as it was before it was guarded."""
    if "'" not in cell:
        return cell
    parts = cell.split(";")
    return ";".join(
        part[1:] if part.startswith("'") and _begins_a_formula(part) else part for part in parts
    )


def _begins_a_formula(part: str) -> bool:
    return _RUNS.match(part) is not None and not _NUMBER.fullmatch(part.lstrip("'"))
