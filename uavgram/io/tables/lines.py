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
    optional_text=("use", "tape", "along", "note"),
    others=True,
)
_WORDS = {"use": ("adjust", "check"), "along": ("slope", "horizontal")}
"""Of columns that hold one of a few words; the first one is meant where a cell is empty."""


def read_lines(path: str | Path) -> KnownLines:
    """Read known lengths.

    Raises
    ------
    InputError
        Names file and line of every mistake: those of any table, a length or sigma that is not
        greater than 0, a line from a label to itself, a name used twice, an unknown
        `use` or `along`.
    """
    table = read_table(path, LINES_COLUMNS)
    table.require_length("length_m")
    table.require_short("name", "from", "to", "tape")
    table.require_sigma("sigma_m")
    table.require_unique("name", "line")
    for row, (start, end) in enumerate(zip(table.text["from"], table.text["to"], strict=True)):
        if start and start == end:
            table.blame(row, f"goes from {start!r} to itself: 'to' must be another label")
    for column, words in _WORDS.items():
        for row, word in enumerate(table.text[column]):
            if word and word not in words:
                hint = f": {guess}" if (guess := near_miss(word, words)) else ""
                table.blame(row, f"{column} must be {' or '.join(words)} (got {word!r}){hint}")
    table.raise_faults()
    return KnownLines(
        name=table.text["name"],
        start=table.text["from"],
        end=table.text["to"],
        length_m=table.numbers["length_m"],
        sigma_m=table.numbers["sigma_m"],
        adjust=np.array([use != "check" for use in table.text["use"]], dtype=np.bool_),
        tape=table.text["tape"],
        # Where nothing is written in the whole column, how the tape was held is not known.
        along=tuple(
            "horizontal" if word == "horizontal" else "slope" for word in table.text["along"]
        )
        if any(table.text["along"])
        else (),
    )
