"""Writer of measurements.csv: the measured values as a table for spreadsheets."""

from __future__ import annotations

import math
from pathlib import Path

from uavgram.io.outputs import replace_text
from uavgram.io.tables.csv_tables import csv_text, guarded
from uavgram.model.result.result import Result
from uavgram.stages.products.columns import MEASUREMENTS

DIGITS = 4
"""Significant digits of a sigma: the two that are justified, and two more."""

COLUMNS = [one for one in MEASUREMENTS if "csv" in one.files]


def write_measurements_csv(result: Result, path: str | Path) -> None:
    """Write measurements.csv; cells that cannot be computed are empty.

    Names and labels are `guarded`: no spreadsheet executes them. `read_table` restores them.

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
    return guarded(value) if isinstance(value, str) else rounded(value, sigma)


def rounded(number: float, sigma: float) -> str:
    """Format a number with the decimals of four digits of its sigma; empty for NaN.

    Digits before the decimal point are never rounded, nor numbers without a valid sigma.
    """
    if not math.isfinite(number):
        return ""
    if not (math.isfinite(sigma) and sigma > 0):
        return str(float(number))
    return f"{number:.{max(DIGITS - 1 - math.floor(math.log10(sigma)), 0)}f}"
