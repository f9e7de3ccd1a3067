"""Text and tables for Rerun's Markdown."""

from __future__ import annotations

import re
from collections.abc import Sequence

# Longer tables are in the files beside the recording.
MOST_ROWS = 200


def plain(text: str) -> str:
    """Escape text written by a person so that Markdown shows it unchanged."""
    return re.sub(r"([\\`*_{}\[\]<>#|~$!])", r"\\\1", " ".join(text.split()))


def table(header: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Format a Markdown table, with a note if rows are omitted."""
    body = ["| " + " | ".join(cells) + " |" for cells in rows[:MOST_ROWS]]
    more = len(rows) - MOST_ROWS
    note = [f"\n{more} more rows are in the report and in results.json."] if more > 0 else []
    rule = "|" + " --- |" * len(header)
    return "\n".join(["| " + " | ".join(header) + " |", rule, *body, *note])
