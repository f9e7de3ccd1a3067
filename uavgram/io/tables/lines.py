"""lines.csv -> `KnownLines`."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from uavgram.errors import near_miss
from uavgram.io.tables.csv_tables import Columns, read_table
from uavgram.model.survey.observations import KnownLines

LINES_COLUMNS = Columns(
    text=("name", "from", "to"),
    numbers=("length_m", "sigma_m"),
    optional_text=("use", "note"),
    others=True,
)
_USES = ("adjust", "check")


def read_lines(path: str | Path) -> KnownLines:
    """Read known lengths.

    Raises
    ------
    InputError
        Names file and line of every mistake: those of any table, a length or sigma that is not
        greater than 0, a line from a label to itself, a name used twice, an unknown `use`.
    """
    table = read_table(path, LINES_COLUMNS)
    table.require_length("length_m")
    table.require_short("name", "from", "to")
    table.require_sigma("sigma_m")
    table.require_unique("name", "line")
    rows = zip(table.text["from"], table.text["to"], table.text["use"], strict=True)
    for row, (start, end, use) in enumerate(rows):
        if start and start == end:
            table.blame(row, f"goes from {start!r} to itself: 'to' must be another label")
        if use and use not in _USES:
            hint = f": {guess}" if (guess := near_miss(use, _USES)) else ""
            table.blame(row, f"use must be adjust or check (got {use!r}){hint}")
    table.raise_faults()
    return KnownLines(
        name=table.text["name"],
        start=table.text["from"],
        end=table.text["to"],
        length_m=table.numbers["length_m"],
        sigma_m=table.numbers["sigma_m"],
        adjust=np.array([use != "check" for use in table.text["use"]], dtype=np.bool_),
    )
