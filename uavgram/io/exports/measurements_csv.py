"""measurements.csv: the measured values as a table for spreadsheets."""

from __future__ import annotations

import math
from pathlib import Path

from uavgram.io.outputs import replace_text
from uavgram.io.tables.csv_tables import csv_text, guarded
from uavgram.model.result.result import Result
from uavgram.stages.products.columns import MEASUREMENTS

DIGITS = 4
"""Of sigma: the two that it deserves, and two more."""

COLUMNS = [one for one in MEASUREMENTS if "csv" in one.files]


def write_measurements_csv(result: Result, path: str | Path) -> None:
    """Write measurements.csv; cells that cannot be computed are empty.

    Names and labels are `guarded`: no spreadsheet runs them. `read_table` reads them as they are.

    Raises
    ------
    OutputError
        The file cannot be written.
    """
    replace_text(Path(path), dump_measurements_csv(result))


def dump_measurements_csv(result: Result) -> str:
    """Write the text of measurements.csv: what results.json has, in the same order.

    Numbers are rounded to four digits of their sigma, two more than it deserves, so that nobody
    takes further ones for known and nobody who computes on loses any; results.json has them all.
    Where other solutions, which explain the observations as well, put a value outside its
    interval, their values stand under ``alternatives``: then neither value nor interval is sure.
    In the last columns are the shifts by 10 cm of relief at the points, and by 1 % of tape.
    ``sigma_stated`` is what the sigma would be, were all errors as large as stated. ``status`` says
    how far the value can be trusted: ok, not-checked, doubtful or contradicted. ``picked_by`` says
    who made the picks of its points: hand, match or target.
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
    """A number with the decimals of four digits of its sigma; empty for NaN.

    Nothing is rounded away before the decimal point, nor where the sigma says nothing.
    """
    if not math.isfinite(number):
        return ""
    if not (math.isfinite(sigma) and sigma > 0):
        return str(float(number))
    return f"{number:.{max(DIGITS - 1 - math.floor(math.log10(sigma)), 0)}f}"
