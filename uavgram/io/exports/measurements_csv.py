"""Writers of measurements.csv and profiles.csv: measured values as tables for spreadsheets."""

from __future__ import annotations

import math
from itertools import chain
from pathlib import Path

from uavgram.io.outputs import replace_text
from uavgram.io.tables.csv_tables import csv_text, guard_formula
from uavgram.model.result.result import Result
from uavgram.model.result.tables import PLACE_KEYS, SIGMA_KEYS
from uavgram.stages.products.columns import MEASUREMENTS

SIGMA_DIGITS = 4
"""Significant digits of a sigma: the two that are justified, and two more."""

COLUMNS = [one for one in MEASUREMENTS if "csv" in one.files]


def write_measurements_csv(result: Result, path: str | Path) -> None:
    """Write measurements.csv; cells that cannot be computed are empty.

    Names and labels are `guard_formula`: no spreadsheet executes them. `read_table` restores them.

    Raises
    ------
    OutputError
        The file cannot be written.
    """
    replace_text(Path(path), dump_measurements_csv(result))


def dump_measurements_csv(result: Result) -> str:
    """Return the text of measurements.csv, in the order of results.json.

    Numbers are rounded to four digits of their sigma, two more than justified, so that no further
    digits appear known and further computations lose none; results.json has all digits. Values of
    other solutions with an equal fit are listed under ``alternatives`` if they are outside the
    interval: then neither value nor interval is certain. The last columns are the shifts by 10 cm
    of relief at the points, and by 1 % of tape. ``sigma_stated`` is the sigma if all errors were as
    large as stated. ``status`` is the trustworthiness of the value: ok, not-checked, doubtful or
    contradicted. ``picked_by`` is the source of the picks of its points: hand, match or target.
    """
    columns = [one.values(result) for one in COLUMNS]
    cells = [
        [
            _cell(value, abs(value) if one.has_own_digits else float(sigma))
            for one, value in zip(COLUMNS, row, strict=True)
        ]
        for sigma, *row in zip(result.measurements.sigma, *columns, strict=True)
    ]
    return csv_text([one.name for one in COLUMNS], cells)


def _cell(value: str | float | tuple[str | float, ...], sigma: float) -> str:
    """Return the text of a value, of a list its entries; numbers with the digits of a sigma."""
    if isinstance(value, tuple):
        return ";".join(_cell(one, sigma) for one in value)
    return guard_formula(value) if isinstance(value, str) else round_by_sigma(value, sigma)


def round_by_sigma(number: float, sigma: float) -> str:
    """Format a number with the decimals of four digits of its sigma; empty for NaN.

    Digits before the decimal point are never rounded, nor numbers without a valid sigma.
    """
    if not math.isfinite(number):
        return ""
    if not (math.isfinite(sigma) and sigma > 0):
        return str(float(number))
    return f"{number:.{max(SIGMA_DIGITS - 1 - math.floor(math.log10(sigma)), 0)}f}"


PROFILES_HEADER = (
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
        numbers = [round_by_sigma(one, sigma) for place, sigma in pairs for one in (place, sigma)]
        cells.append((guard_formula(rows.profile[i]), guard_formula(label), *numbers))
    return csv_text(PROFILES_HEADER, cells)
