"""Writers of batch.csv and batch.parquet: a row for each survey, comparable over years."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from pathlib import Path

import pyarrow as pa
from pyarrow import parquet

from uavgram.io.outputs import replace_text
from uavgram.io.tables.csv_tables import csv_text, guard_formula
from uavgram.model.batch import Batch, SurveyRow

Cell = str | float | int | None


def _field(name: str) -> Callable[[SurveyRow, str], Cell]:
    return lambda row, _: getattr(row, name)


def _rms(row: SurveyRow, kind: str) -> float:
    """Compute the root mean square of the errors of a kind, in sigmas; NaN without any."""
    fits = [one for one in row.fits if one.kind == kind]
    return math.sqrt(max(fits[0].squares, 0.0) / fits[0].freedom) if fits else math.nan


_TEXT, _NUMBER, _COUNT = pa.string(), pa.float64(), pa.int64()
_COLUMNS: dict[str, tuple[pa.DataType, Callable[[SurveyRow, str], Cell]]] = {
    "name": (_TEXT, _field("name")),
    "status": (_TEXT, _field("status")),
    "verdict": (_TEXT, _field("level")),
    "mean_sigma_m": (_NUMBER, _field("mean_sigma_m")),
    "worst_w": (_NUMBER, _field("worst_w")),
    "photos": (_COUNT, _field("photos")),
    "measurements": (_COUNT, _field("measurements")),
    "warnings": (_TEXT, lambda row, _: ";".join(row.warnings)),
    "taken_utc": (_TEXT, _field("taken_utc")),
    "latitude_deg": (_NUMBER, _field("latitude_deg")),
    "longitude_deg": (_NUMBER, _field("longitude_deg")),
    "camera": (_TEXT, _field("camera")),
    "drone": (_TEXT, _field("drone")),
    "checks_rms_sigmas": (_NUMBER, lambda row, _: _rms(row, "checks")),
    "checks_count": (
        _NUMBER,
        lambda row, _: next((one.freedom for one in row.fits if one.kind == "checks"), None),
    ),
    "pixels_rms_sigmas": (_NUMBER, lambda row, _: _rms(row, "pixels")),
    "lengths_rms_sigmas": (_NUMBER, lambda row, _: _rms(row, "lengths")),
    "telemetry_rms_sigmas": (_NUMBER, lambda row, _: _rms(row, "telemetry")),
    "cpu_s": (_NUMBER, _field("seconds")),
    "tries": (_COUNT, _field("tries")),
    "version": (_TEXT, lambda row, version: version if row.level else ""),
    "project": (_TEXT, _field("project")),
    "output": (_TEXT, _field("output")),
    "message": (_TEXT, _field("message")),
}
"""Columns of both files: type, and value from a survey and the version of the program."""

_LEARNT = ("value", "sigma", "stated", "stated_sigma")


def write_batch_csv(batch: Batch, path: Path) -> None:
    """Write batch.csv; cells are protected against execution by spreadsheets, missing ones empty.

    Raises
    ------
    OutputError
        The file cannot be written.
    """
    lines = zip(*(map(_cell, _values(batch, name)) for name in _COLUMNS), strict=True)
    replace_text(path, csv_text(tuple(_COLUMNS), lines))


def write_batch_parquet(batch: Batch, path: Path) -> None:
    """Write batch.parquet: the columns of batch.csv, and the adjusted camera parameters.

    Times are timestamps, numbers are not rounded, and NaN is null. Version and time of the batch
    are in the metadata, as JSON under ``uavgram``.
    """
    columns = {name: pa.array(_values(batch, name), one[0]) for name, one in _COLUMNS.items()}
    names = dict.fromkeys(one.name for row in batch.rows for one in row.seen)
    for name in names:
        seen = [next((s for s in row.seen if s.name == name), None) for row in batch.rows]
        for part in _LEARNT:
            values = [None if one is None else getattr(one, part) for one in seen]
            columns[f"camera_{name}_{part}"] = pa.array(values, _NUMBER)
    told = {"uavgram": json.dumps({"version": batch.version, "created_utc": batch.created_utc})}
    parquet.write_table(pa.table(columns).replace_schema_metadata(told), path)


def _values(batch: Batch, name: str) -> list[Cell]:
    """Return a column of all surveys; NaN becomes a missing value."""
    values = [_COLUMNS[name][1](row, batch.version) for row in batch.rows]
    return [None if isinstance(one, float) and not math.isfinite(one) else one for one in values]


def _cell(value: Cell) -> str:
    if value is None:
        return ""
    return guard_formula(value) if isinstance(value, str) else repr(value)
