"""Writer of profiles.csv: the points of measured profiles as a table for spreadsheets."""

from __future__ import annotations

from itertools import chain
from pathlib import Path

from uavgram.io.exports.measurements_csv import rounded
from uavgram.io.outputs import replace_text
from uavgram.io.tables.csv_tables import csv_text, guarded
from uavgram.model.result.result import Result
from uavgram.model.result.tables import PLACE_KEYS, SIGMA_KEYS

HEADER = (
    "profile",
    "label",
    *chain.from_iterable(zip(PLACE_KEYS, SIGMA_KEYS, strict=True)),
)


def write_profiles_csv(result: Result, path: str | Path) -> None:
    """Write profiles.csv.

    Stations and offsets (to the right positive) are along the line from a profile's first point to
    its last; heights, also those of the ground below, are above its first point.

    Raises
    ------
    OutputError
        The file cannot be written.
    """
    replace_text(Path(path), dump_profiles_csv(result))


def dump_profiles_csv(result: Result) -> str:
    """Return the text of profiles.csv, with as many digits as measurements.csv."""
    rows = result.profiles
    cells = []
    for i, label in enumerate(rows.label):
        pairs = zip(rows.place_m[i].tolist(), rows.sigma_m[i].tolist(), strict=True)
        numbers = [rounded(one, sigma) for place, sigma in pairs for one in (place, sigma)]
        cells.append((guarded(rows.profile[i]), guarded(label), *numbers))
    return csv_text(HEADER, cells)
