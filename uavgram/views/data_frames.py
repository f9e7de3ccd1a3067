"""Tables of a result as pandas data frames; pandas is needed only here.

The columns follow from the fields of the tables: an array with an axis behind the rows gives a
column for each entry, a covariance one for each pair. Names end with the unit.
"""

from __future__ import annotations

import dataclasses
import importlib
from collections.abc import Callable, Iterator, Sequence
from typing import TYPE_CHECKING, Any, Literal, get_args

import numpy as np

from uavgram.errors import UavgramError, install_command
from uavgram.model.naming import Column, columns_of
from uavgram.model.result.reliability import Evidence
from uavgram.model.result.result import POSE_NAMES, Estimate, Result

if TYPE_CHECKING:
    import pandas as pd

Row = dict[str, object]

_AXES = {
    "boresight_deg": ("x", "y", "z"),
    "lever_arm_m": ("forward", "right", "down"),
    "position_bias_m": ("east", "north", "up"),
}
_PIXELS = ("fx", "fy", "cx", "cy")


def shared_rows(result: Result) -> list[Row]:
    """List the parameters shared by all photos: name, adjusted value, sigma, unit."""
    shared = result.shared
    single = ("heading_bias_deg", "clock_offset_s", "clock_drift_ppm", "readout_s")
    rows: list[Row] = []
    for field in (*_AXES, *single):
        name, unit = field.rsplit("_", 1)
        rows += _rows(getattr(shared, field), name, _AXES.get(field, ("",)), unit)
    for tape, scale in shared.tape_scale.items():
        rows += _rows(scale, "tape_scale", (tape,), "")
    return rows


def _rows(found: Estimate | None, name: str, axes: tuple[str, ...], unit: str) -> Iterator[Row]:
    if found is None:
        return
    for axis, value, sigma in zip(axes, found.value, found.sigma, strict=True):
        whole = " ".join(filter(None, (name.replace("_", " "), axis)))
        yield {"name": whole, "value": float(value), "sigma": float(sigma), "unit": unit}


def camera_rows(result: Result) -> list[Row]:
    """List the parameters of the lens model as stated and as adjusted, with sigmas."""
    camera, adjusted = result.camera, result.shared.intrinsics
    stated = np.sqrt(np.diag(camera.covariance))
    return [
        {
            "name": name,
            "stated": float(camera.parameters[k]),
            "stated_sigma": float(stated[k]),
            "adjusted": float(adjusted.value[k]),
            "adjusted_sigma": float(adjusted.sigma[k]),
            "unit": "px" if name in _PIXELS else "",
        }
        for k, name in enumerate(camera.parameter_names)
    ]


def orientation_rows(result: Result) -> list[Row]:
    """List the correlations among the shared parameters, and of each pose with them."""
    found = result.orientation
    if found is None:
        return []
    sources = [("", name, row) for name, row in zip(found.parameters, found.shared, strict=True)]
    for frame, rows in zip(found.frame_id, found.with_pose, strict=True):
        sources += [(frame, name, row) for name, row in zip(POSE_NAMES, rows, strict=True)]
    return [
        {"frame": frame, "unknown": name, **dict(zip(found.parameters, row.tolist(), strict=True))}
        for frame, name, row in sources
    ]


TableName = Literal[
    "measurements",
    "correlation",
    "error_budget",
    "weakest_links",
    "second_order",
    "monte_carlo",
    "points",
    "lines",
    "known",
    "control_lines",
    "picks",
    "frames",
    "areas",
    "profiles",
    "point_checks",
    "line_checks",
    "groups",
    "alternatives",
    "removals",
    "priors",
    "line_effects",
    "pick_effects",
    "shared",
    "camera",
    "orientation",
    "pick_noise",
    "roughness",
    "reasons",
    "messages",
    "inputs",
]
"""Tables of a result."""

_OF_MEASUREMENTS = ("correlation", "error_budget", "weakest_links", "second_order", "monte_carlo")

_RECORDS: dict[str, Callable[[Result], Sequence[object]]] = {
    "areas": lambda result: result.areas,
    "groups": lambda result: result.solution.groups,
    "alternatives": lambda result: result.solution.alternatives,
    "removals": lambda result: result.removals,
    "shared": shared_rows,
    "camera": camera_rows,
    "orientation": orientation_rows,
    "pick_noise": lambda result: result.noise.picks if result.noise else (),
    "roughness": lambda result: result.noise.roughness if result.noise else (),
    "reasons": lambda result: result.verdict.reasons,
    "messages": lambda result: result.messages,
    "inputs": lambda result: result.provenance.inputs,
}
"""Tables stored as one object per row."""

_EVIDENCE: dict[str, Callable[[Evidence], object]] = {
    "priors": lambda evidence: evidence.priors,
    "line_effects": lambda evidence: evidence.lines,
    "pick_effects": lambda evidence: evidence.picks,
}
"""Tables of the effects of undetected errors; `lines` and `picks` have the same rows."""

_KEYS = ("name", "label", "frame_id")
"""Columns that name a row: the first that a table has is its index if its names are unique."""

_UNITS = ("m", "m2", "px", "deg", "rad", "s", "percent")


def to_pandas(result: Result, table: TableName) -> pd.DataFrame:
    """Return one table of a result as a data frame: a row for each measurement, point, photo...

    >>> uavgram.to_pandas(result, "measurements")[["value", "sigma", "unit"]]    # doctest: +SKIP

    Parameters
    ----------
    result
        Result of `uavgram.run` or `uavgram.load_results`.
    table
        ``measurements``, ``points``, ``lines``, ``picks``, ``frames`` and so on (`TableName`).

    Returns
    -------
    Rows are named by measurement, label or photo where these are unique. Columns are the fields of
    the result, with their units; vectors and covariances in a column for each number, NaN for
    missing values. Values are in SI units.

    Raises
    ------
    UavgramError
        If there is no such table, or pandas is not installed.
    """
    names = get_args(TableName)
    if table not in names:
        raise UavgramError(f"There is no table {table!r}. There are: {', '.join(names)}.")
    if table in _OF_MEASUREMENTS:
        return _of_measurements(result, table)
    if table in _RECORDS:
        return _set_index(_pandas().DataFrame([_record(one) for one in _RECORDS[table](result)]))
    if table in _EVIDENCE:
        found = _EVIDENCE[table](result.evidence) if result.evidence else None
        return _pandas().DataFrame({} if found is None else dict(columns(found)))
    return _set_index(_pandas().DataFrame(dict(columns(getattr(result, table)))))


def _pandas() -> Any:  # noqa: ANN401
    try:
        return importlib.import_module("pandas")
    except ImportError as fault:
        raise UavgramError(
            "Tables as data frames need pandas, which is not installed: "
            f"{install_command('pandas')}."
        ) from fault


def _set_index(frame: pd.DataFrame) -> pd.DataFrame:
    key = next((key for key in _KEYS if key in frame), None)
    return frame.set_index(key) if key and frame[key].is_unique else frame


def _of_measurements(result: Result, table: str) -> pd.DataFrame:
    """Return a table with a row per measurement, without a name column; may be empty."""
    frame, names = _pandas().DataFrame, list(result.measurements.name)
    if table == "correlation":
        return frame(result.measurements.correlation, index=names, columns=names)
    if table == "error_budget":
        budget = result.error_budget
        return frame() if budget is None else frame(budget.share, names, list(budget.source))
    if table == "weakest_links":
        found: object = result.evidence.weakest if result.evidence else None
    else:
        found = getattr(result, table)
    return frame() if found is None else frame(dict(columns(found)), index=names)


def columns(table: object, before: str = "") -> Iterator[tuple[str, object]]:
    """Yield the column names and columns of a table."""
    for field in dataclasses.fields(table):  # type: ignore[arg-type]
        value = getattr(table, field.name)
        if not field.repr:
            continue  # no column: the field describes this computer
        if dataclasses.is_dataclass(value):
            yield from columns(value, f"{before}{field.name}_")
        elif isinstance(value, np.ndarray) and value.ndim > 1:
            yield from _split(value, field.name, columns_of(type(table))[field.name], before)
        elif isinstance(value, (np.ndarray, tuple)):
            yield before + field.name, list(value) if isinstance(value, tuple) else value
        else:
            yield before + field.name, value  # one number for all rows


def _split(
    value: np.ndarray[Any, Any], name: str, column: Column, before: str
) -> Iterator[tuple[str, object]]:
    """Yield a named column for each number of a row; of a symmetric matrix each number once."""
    if name == "correlation":
        return  # a table of its own
    stem, unit = _unit_of(name)
    stem = stem if column.stem is None else column.stem
    unit = unit if column.unit is None else column.unit
    for index in np.ndindex(value.shape[1:]):
        if len(index) > 1 and stem.endswith("covariance") and index[0] > index[1]:
            continue
        words = (before.rstrip("_"), stem, *(column.axes[k] for k in index), unit)
        yield "_".join(filter(None, words)), value[(slice(None), *index)]


def _unit_of(name: str) -> tuple[str, str]:
    """Split a name and its unit: ``residual_px`` gives ``("residual", "px")``."""
    stem, _, unit = name.rpartition("_")
    return (stem, unit) if stem and unit in _UNITS else (name, "")


def _record(one: object) -> dict[str, object]:
    """Convert an object to a row; a value with sigma gives two columns, a vector several."""
    row: dict[str, object] = {}
    if isinstance(one, dict):
        return one
    for field in dataclasses.fields(one):  # type: ignore[arg-type]
        value = getattr(one, field.name)
        if field.compare or isinstance(value, (str, int, float, tuple)):
            row |= _cells(field.name, value, columns_of(type(one))[field.name].axes)
    return row


def _cells(name: str, value: object, axes: Sequence[str]) -> dict[str, object]:
    stem, unit = _unit_of(name)
    if dataclasses.is_dataclass(value):  # an estimate
        parts = {part.name: getattr(value, part.name) for part in dataclasses.fields(value)}
        named = {(stem if part == "value" else f"{stem}_{part}"): v for part, v in parts.items()}
        return {
            k: v for s, one in named.items() for k, v in _cells(f"{s}_{unit}", one, axes).items()
        }
    if isinstance(value, np.ndarray):
        if value.size == 1:
            return {name: float(value.ravel()[0])}
        base = stem.removesuffix("_sigma")
        sigma = "_sigma" if base != stem else ""
        return {f"{base}_{axes[k]}{sigma}_{unit}": float(v) for k, v in enumerate(value)}
    return {name: value}
