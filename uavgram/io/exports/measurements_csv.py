"""measurements.csv: the measured values as a table for spreadsheets."""

from __future__ import annotations

import math
from pathlib import Path

from uavgram.io.outputs import replace_text
from uavgram.io.tables.csv_rows import csv_text
from uavgram.io.tables.spreadsheet_cells import guarded
from uavgram.model.result.result import Result
from uavgram.model.result.sources import sources_behind

DIGITS = 4
"""Of sigma: the two that it deserves, and two more."""

HEADER = (
    "name",
    "kind",
    "points",
    "value",
    "sigma",
    "unit",
    "lower_95",
    "upper_95",
    "alternatives",
    "shift_relief_10cm",
    "shift_tape_1pct",
    "sigma_stated",
    "status",
    "picked_by",
)


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
    made = sources_behind(result.picks, result.measurements.points)
    rows = result.measurements
    cells = []
    for i, sigma in enumerate(rows.sigma):
        value, own, low, high, *others = (
            rounded(number, float(sigma))
            for number in (rows.value[i], sigma, *rows.interval_95[i], *rows.alternative_values[i])
        )
        name, points = guarded(rows.name[i]), guarded(";".join(rows.points[i]))
        alternatives, unit = ";".join(others), rows.unit[i]
        shifts = (
            rounded(float(shift), abs(float(shift)))  # four digits
            for shift in (rows.shift_relief_10cm[i], rows.shift_tape_1pct[i])
        )
        stated = rounded(rows.sigma_stated[i], float(sigma))
        known = (name, rows.kind[i], points, value, own, unit, low, high, alternatives)
        cells.append((*known, *shifts, stated, rows.status[i], ";".join(made[i])))
    return csv_text(HEADER, cells)


def rounded(number: float, sigma: float) -> str:
    """A number with the decimals of four digits of its sigma; empty for NaN.

    Nothing is rounded away before the decimal point, nor where the sigma says nothing.
    """
    if not math.isfinite(number):
        return ""
    if not (math.isfinite(sigma) and sigma > 0):
        return str(float(number))
    return f"{number:.{max(DIGITS - 1 - math.floor(math.log10(sigma)), 0)}f}"
