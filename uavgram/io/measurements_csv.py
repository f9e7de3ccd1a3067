"""measurements.csv: the measured values as a table for spreadsheets."""

from __future__ import annotations

import csv
import io
from pathlib import Path

from uavgram.io.outputs import replace_text
from uavgram.io.results_tables import plain
from uavgram.io.spreadsheet_cells import guarded
from uavgram.model.result import Result

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
    """Write the text of measurements.csv: as results.json has them, in the same order.

    Where other solutions, which explain the observations as well, put a value outside its
    interval, their values stand under ``alternatives``: then neither value nor interval is sure.
    """
    rows = result.measurements
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(HEADER)
    writer.writerows(
        zip(
            map(guarded, rows.name),
            rows.kind,
            (guarded(";".join(labels)) for labels in rows.points),
            plain(rows.value),
            plain(rows.sigma),
            rows.unit,
            plain(rows.interval_95[:, 0]),
            plain(rows.interval_95[:, 1]),
            (";".join(map(str, plain(values))) for values in rows.alternative_values),
            strict=True,
        )
    )
    return text.getvalue()
