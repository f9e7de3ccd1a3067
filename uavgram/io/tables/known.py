"""known.csv -> `KnownThings`."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from uavgram.errors import near_miss
from uavgram.estimation.survey.known_kinds.kinds import KNOWN_KINDS
from uavgram.io.tables.csv_tables import Columns, Table, read_table
from uavgram.io.tables.measure import POINT_COUNTS, parameters_of, points_of, request_fault
from uavgram.model.survey.known import NOT_KNOWN, KnownThings
from uavgram.model.survey.observations import MeasurementRequest

KNOWN_COLUMNS = Columns(
    text=("name", "kind", "points"),
    numbers=("sigma",),
    optional_text=("parameters", "use", "note"),
    optional_numbers=("value",),
    others=True,
)
_USES = ("adjust", "check")


_COUNTS = {name: kind.points for name, kind in KNOWN_KINDS.items()} | {
    str(kind): count for kind, count in POINT_COUNTS.items()
}


def read_known(path: str | Path) -> KnownThings:
    """Read what is known of the scene.

    Raises
    ------
    InputError
        Names file and line of every mistake: those of any table, an unknown kind or one that
        cannot be known, a wrong number of points, a value that is missing, impossible or given
        where none belongs, a sigma that is none, a name used twice, an unknown `use`.
    """
    table = read_table(path, KNOWN_COLUMNS)
    table.require_unique("name", "known thing")
    table.require_short("name")
    table.require_sigma("sigma")
    points, parameters = [], []
    for row, kind in enumerate(table.text["kind"]):
        if kind and kind not in KNOWN_KINDS:
            table.blame(row, _unknown(kind))
        is_known = kind in KNOWN_KINDS
        parameters.append(
            parameters_of(table, row, kind, (), KNOWN_KINDS[kind].parameters) if is_known else ()
        )
        points.append(_points(table, row, kind, parameters[-1]) if is_known else ())
        if is_known:
            _check_value(table, row, kind)
    for row, word in enumerate(table.text["use"]):
        if word and word not in _USES:
            hint = f": {guess}" if (guess := near_miss(word, _USES)) else ""
            table.blame(row, f"use must be {' or '.join(_USES)} (got {word!r}){hint}")
    table.raise_faults()
    return KnownThings(
        name=table.text["name"],
        kind=table.text["kind"],
        points=tuple(points),
        value=table.numbers["value"],
        sigma=table.numbers["sigma"],
        adjust=np.array([use != "check" for use in table.text["use"]], dtype=np.bool_),
        parameters=tuple(parameters),
    )


def _unknown(kind: str) -> str:
    """What is wrong with a kind."""
    if kind in NOT_KNOWN:
        return f"kind {kind!r} cannot be known: {NOT_KNOWN[kind]}"
    hint = near_miss(kind, KNOWN_KINDS) or f"known are {', '.join(KNOWN_KINDS)}"
    return f"unknown kind {kind!r}: {hint}"


def _points(
    table: Table, row: int, kind: str, parameters: tuple[tuple[str, float], ...]
) -> tuple[str, ...]:
    least, most = _COUNTS[kind]
    points = points_of(table, row, kind, (least, most))
    if kind in POINT_COUNTS and points:
        request = MeasurementRequest(name="", kind=kind, points=points, parameters=parameters)
        if fault := request_fault(request):
            table.blame(row, fault)
    is_right = least <= len(points) <= (most or len(points))
    if is_right and (fault := KNOWN_KINDS[kind].points_fault(points)):
        table.blame(row, f"kind {kind} {fault}")
    return points


def _check_value(table: Table, row: int, kind: str) -> None:
    """Note a value that is missing, that does not belong there, or that cannot be."""
    value = float(table.numbers["value"][row])
    if not KNOWN_KINDS[kind].has_value:
        if np.isfinite(value):
            table.blame(row, f"kind {kind} has no value: leave it empty (got {value:g})")
        return
    if not np.isfinite(value):
        if not _blamed(table, row):
            table.blame(row, f"kind {kind} needs a value")
        return
    fault = KNOWN_KINDS[kind].fault(value)
    if fault:
        table.blame(row, f"value of kind {kind} {fault} (got {value:g})")


def _blamed(table: Table, row: int) -> bool:
    """Whether what stands in the cell of the value is no number, as was said already."""
    line = int(table.line[row])
    return any(where == line and text.startswith("value ") for where, text in table.faults)
