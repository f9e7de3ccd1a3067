"""Writers of batch.csv and batch.parquet: a row for each survey, comparable over years."""

from __future__ import annotations

import json
import math
from pathlib import Path

import pyarrow as pa
from pyarrow import parquet

from uavgram.io.outputs import replace_text
from uavgram.io.tables.csv_tables import csv_text, guard_formula
from uavgram.model.batch import Batch, Fit, SurveyRow

_TEXT, _NUMBER, _COUNT = pa.string(), pa.float64(), pa.int64()
_COLUMNS: dict[str, pa.DataType] = {
    "name": _TEXT,
    "status": _TEXT,
    "verdict": _TEXT,
    "mean_sigma_m": _NUMBER,
    "worst_w": _NUMBER,
    "photos": _COUNT,
    "measurements": _COUNT,
    "warnings": _TEXT,
    "taken_utc": _TEXT,
    "latitude_deg": _NUMBER,
    "longitude_deg": _NUMBER,
    "camera": _TEXT,
    "drone": _TEXT,
    "checks_rms_sigmas": _NUMBER,
    "checks_count": _NUMBER,
    "pixels_rms_sigmas": _NUMBER,
    "lengths_rms_sigmas": _NUMBER,
    "telemetry_rms_sigmas": _NUMBER,
    "cpu_s": _NUMBER,
    "tries": _COUNT,
    "version": _TEXT,
    "project": _TEXT,
    "output": _TEXT,
    "message": _TEXT,
}
_LEARNT = ("value", "sigma", "stated", "stated_sigma")

Cell = str | float | int | None


def write_batch_csv(batch: Batch, path: Path) -> None:
    """Write batch.csv; cells are protected against execution by spreadsheets, missing ones empty.

    Raises
    ------
    OutputError
        The file cannot be written.
    """
    lines = ([_cell(cell) for cell in _cells(row, batch.version)] for row in batch.rows)
    replace_text(path, csv_text(tuple(_COLUMNS), lines))


def write_batch_parquet(batch: Batch, path: Path) -> None:
    """Write batch.parquet: the columns of batch.csv, and the adjusted camera parameters.

    Times are timestamps, numbers are not rounded, and NaN is null. Version and time of the batch
    are in the metadata, as JSON under ``uavgram``.
    """
    rows = [_cells(row, batch.version) for row in batch.rows]
    columns = {
        name: pa.array([row[k] for row in rows], kind)
        for k, (name, kind) in enumerate(_COLUMNS.items())
    }
    names = dict.fromkeys(one.name for row in batch.rows for one in row.seen)
    for name in names:
        seen = [next((s for s in row.seen if s.name == name), None) for row in batch.rows]
        for part in _LEARNT:
            values = [None if one is None else getattr(one, part) for one in seen]
            columns[f"camera_{name}_{part}"] = pa.array(values, _NUMBER)
    told = {"uavgram": json.dumps({"version": batch.version, "created_utc": batch.created_utc})}
    parquet.write_table(pa.table(columns).replace_schema_metadata(told), path)


def _cells(row: SurveyRow, version: str) -> tuple[Cell, ...]:
    fits = {one.kind: one for one in row.fits}
    checks = fits.get("checks")
    return (
        row.name,
        row.status,
        row.level,
        _replace_nan(row.mean_sigma_m),
        _replace_nan(row.worst_w),
        row.photos,
        row.measurements,
        ";".join(row.warnings),
        row.taken_utc,
        _replace_nan(row.latitude_deg),
        _replace_nan(row.longitude_deg),
        row.camera,
        row.drone,
        _rms(checks),
        None if checks is None else checks.freedom,
        *(_rms(fits.get(kind)) for kind in ("pixels", "lengths", "telemetry")),
        _replace_nan(row.seconds),
        row.tries,
        version if row.level else "",
        row.project,
        row.output,
        row.message,
    )


def _replace_nan(value: float) -> float | None:
    return value if math.isfinite(value) else None


def _rms(fit: Fit | None) -> float | None:
    return None if fit is None else math.sqrt(max(fit.squares, 0.0) / fit.freedom)


def _cell(value: Cell) -> str:
    if value is None:
        return ""
    return guard_formula(value) if isinstance(value, str) else repr(value)
