"""Tables of known values: lines.csv, known.csv, control.csv, check.csv, control_lines.csv."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Literal, TypeVar

import numpy as np

from uavgram.errors import InputError, suggest_spelling
from uavgram.estimation.survey.known_kinds import KNOWN_KINDS
from uavgram.io.tables.csv_tables import Columns, Table, read_table
from uavgram.io.tables.measure import read_parameters, read_points, request_fault
from uavgram.model import observations
from uavgram.model.arrays import Floats
from uavgram.model.naming import format_digits

_USES = ("adjust", "check")
"""Words of the column `use`; the first one is the default of an empty cell."""

LINES_COLUMNS = Columns(
    text=("name", "from", "to"),
    numbers=("length_m", "sigma_m"),
    optional_text=("use", "tape", "along", "note"),
    choices={"use": _USES, "along": ("slope", "horizontal")},
    others=True,
)


def read_lines(path: str | Path) -> observations.KnownLines:
    """Read known lengths.

    Raises
    ------
    InputError
        Names file and line of every mistake: those of any table, a length or sigma that is not
        greater than 0, a line from a label to itself, a name used twice, an unknown `use` or
        `along`.
    """
    table = read_table(path, LINES_COLUMNS)
    table.require_unique("name", "line")
    for row, (start, end) in enumerate(zip(table.text["from"], table.text["to"], strict=True)):
        if start and start == end:
            table.add_fault(row, f"goes from {start!r} to itself: 'to' must be another label")
    table.raise_faults()
    return observations.KnownLines(
        name=table.text["name"],
        start=table.text["from"],
        end=table.text["to"],
        length_m=table.numbers["length_m"],
        sigma_m=table.numbers["sigma_m"],
        adjust=np.array([use != "check" for use in table.text["use"]], dtype=np.bool_),
        tape=table.text["tape"],
        # An empty column means that the way of taping is unknown.
        along=tuple(
            "horizontal" if word == "horizontal" else "slope" for word in table.text["along"]
        )
        if any(table.text["along"])
        else (),
    )


GEODETIC = ("latitude_deg", "longitude_deg", "height_m")
_COORDINATES: dict[Literal["geodetic", "local"], tuple[str, str, str]] = {
    "geodetic": GEODETIC,
    "local": ("east_m", "north_m", "up_m"),
}
_ONE_SIGMA = ("sigma_m",)
Choice = TypeVar("Choice", bound=str)
THREE_SIGMAS = ("sigma_east_m", "sigma_north_m", "sigma_up_m")
_ALL = (*_COORDINATES["geodetic"], *_COORDINATES["local"], *_ONE_SIGMA, *THREE_SIGMAS)


def read_known_points(path: str | Path) -> observations.KnownPoints:
    """Read points with known coordinates.

    Raises
    ------
    InputError
        Names file and line of every mistake: those of any table, geodetic and local columns (or one
        sigma and three) side by side, an empty cell, a label used twice, a latitude or longitude
        out of range, a sigma that is not greater than 0.
    """
    table = read_table(path, Columns(text=("label",), optional_numbers=_ALL))
    kind = _choose_columns(table, _COORDINATES)
    choices = {"one": _ONE_SIGMA, "three": THREE_SIGMAS}
    sigmas = choices[_choose_columns(table, choices)]
    names = _COORDINATES[kind]
    _check_cells(table, (*names, *sigmas))
    table.require_unique("label", "label")
    table.raise_faults()
    sigma_m = np.stack([table.numbers[name] for name in sigmas], axis=1)
    return observations.KnownPoints(
        label=table.text["label"],
        kind=kind,
        coordinates=np.stack([table.numbers[name] for name in names], axis=1),
        sigma_m=np.broadcast_to(sigma_m, (len(table.line), 3)),
    )


def _choose_columns(table: Table, choices: Mapping[Choice, Sequence[str]]) -> Choice:
    """Choose the one of two sets of columns that the header has: one complete set, or an error."""
    present = {
        key: have
        for key, names in choices.items()
        if (have := [name for name in names if name in table.header])
    }
    written = " or ".join(", ".join(names) for names in choices.values())
    if len(present) > 1:
        mixed = " and ".join(have[0] for have in present.values())
        raise InputError(table.path, f"has both {mixed}: give either {written}", 1)
    for key, have in present.items():
        missing = [name for name in choices[key] if name not in have]
        if missing:
            raise InputError(table.path, f"column {missing[0]!r} is missing beside {have[0]}", 1)
        return key
    raise InputError(table.path, f"columns are missing: give either {written}", 1)


def _check_cells(table: Table, names: tuple[str, ...]) -> None:
    blamed = {line for line, _ in table.faults}  # a wrong number is NaN too: one message is enough
    for name in names:
        for row in np.flatnonzero(np.isnan(table.numbers[name])):
            if int(table.line[row]) not in blamed:
                table.add_fault(int(row), f"{name} is empty")


KNOWN_COLUMNS = Columns(
    text=("name", "kind", "points"),
    numbers=("sigma",),
    optional_text=("parameters", "use", "note"),
    optional_numbers=("value",),
    choices={"use": _USES},
    others=True,
)


def read_known(path: str | Path) -> observations.KnownThings:
    """Read known values of the scene.

    Raises
    ------
    InputError
        Names file and line of every mistake: those of any table, an unknown kind or one that cannot
        be known, a wrong number of points, a value that is missing, impossible or given where none
        belongs, an invalid sigma, a name used twice, an unknown `use`.
    """
    table = read_table(path, KNOWN_COLUMNS)
    table.require_unique("name", "known thing")
    points, parameters = [], []
    for row, kind in enumerate(table.text["kind"]):
        if kind and kind not in KNOWN_KINDS:
            table.add_fault(row, _explain_unknown_kind(kind))
        is_known = kind in KNOWN_KINDS
        parameters.append(
            read_parameters(table, row, kind, (), KNOWN_KINDS[kind].parameters) if is_known else ()
        )
        points.append(_points(table, row, kind, parameters[-1]) if is_known else ())
        if is_known:
            _check_value(table, row, kind)
    table.raise_faults()
    return observations.KnownThings(
        name=table.text["name"],
        kind=table.text["kind"],
        points=tuple(points),
        value=table.numbers["value"],
        sigma=table.numbers["sigma"],
        adjust=np.array([use != "check" for use in table.text["use"]], dtype=np.bool_),
        parameters=tuple(parameters),
    )


def _explain_unknown_kind(kind: str) -> str:
    """Describe the mistake in a kind."""
    if kind in observations.NOT_KNOWN:
        return f"kind {kind!r} cannot be known: {observations.NOT_KNOWN[kind]}"
    hint = suggest_spelling(kind, KNOWN_KINDS) or f"known are {', '.join(KNOWN_KINDS)}"
    return f"unknown kind {kind!r}: {hint}"


def _points(
    table: Table, row: int, kind: str, parameters: tuple[tuple[str, float], ...]
) -> tuple[str, ...]:
    least, most = KNOWN_KINDS[kind].points
    points = read_points(table, row, kind, (least, most))
    if kind in observations.MEASUREMENT_FORMS and points:
        request = observations.MeasurementRequest(
            name="", kind=kind, points=points, parameters=parameters
        )
        if fault := request_fault(request):
            table.add_fault(row, fault)
    is_right = least <= len(points) <= (most or len(points))
    if is_right and (fault := KNOWN_KINDS[kind].points_fault(points)):
        table.add_fault(row, f"kind {kind} {fault}")
    return points


def _check_value(table: Table, row: int, kind: str) -> None:
    """Report a mistake if a value is missing, superfluous or impossible."""
    value = float(table.numbers["value"][row])
    if not KNOWN_KINDS[kind].has_value:
        if np.isfinite(value):
            table.add_fault(
                row, f"kind {kind} has no value: leave it empty (got {format_digits(value, 6)})"
            )
        return
    if not np.isfinite(value):
        if not _has_fault(table, row):
            table.add_fault(row, f"kind {kind} needs a value")
        return
    fault = KNOWN_KINDS[kind].fault(value)
    if fault:
        table.add_fault(row, f"value of kind {kind} {fault} (got {format_digits(value, 6)})")


def _has_fault(table: Table, row: int) -> bool:
    """Return whether the cell of the value is already reported as not being a number."""
    line = int(table.line[row])
    return any(where == line and text.startswith("value ") for where, text in table.faults)


_ENDS = ("start", "end")
_ENDS_SEEN_FROM_ABOVE = {
    kind: [f"{end}_{axis}" for end in _ENDS for axis in axes[:2]]
    for kind, axes in _COORDINATES.items()
}
_SIGMAS = ("sigma_m", "sigma_up_m", "straightness_m")

CONTROL_LINES_COLUMNS = Columns(
    text=("name", "points"),
    numbers=("sigma_m",),
    optional_text=("use", "note"),
    optional_numbers=(
        *(f"{end}_{axis}" for axes in _COORDINATES.values() for end in _ENDS for axis in axes),
        *_SIGMAS[1:],
    ),
    choices={"use": _USES},
    others=True,
)

SHORTEST_M = 0.5
"""Least plan distance of a line's ends for a useful direction."""
_DEGREE_M = 111_000.0


def read_control_lines(path: str | Path) -> observations.ControlLines:
    """Read lines with known coordinates.

    Raises
    ------
    InputError
        Names file and line of every mistake: those of any table, geodetic and local columns side by
        side, an empty coordinate, a height at one end alone, ends that are one place seen from
        above, no label, a label or name used twice, a latitude or longitude out of range, a sigma
        that is not greater than 0, an unknown `use`.
    """
    table = read_table(path, CONTROL_LINES_COLUMNS)
    kind = _choose_columns(table, _ENDS_SEEN_FROM_ABOVE)
    names = [[f"{end}_{axis}" for axis in _COORDINATES[kind]] for end in _ENDS]
    table.require_unique("name", "line")
    ends = np.stack([np.stack([table.numbers[n] for n in of], axis=1) for of in names], axis=1)
    _check_ends(table, names, ends, kind)
    points = tuple(_line_points(table, row) for row in range(len(table.line)))
    table.raise_faults()
    # Defaults: the vertical sigma is the horizontal one, the straightness a constant.
    plan, up, own = (table.numbers[name] for name in _SIGMAS)
    up = np.where(np.isnan(up), plan, up)
    sigma = np.broadcast_to(np.stack([plan, plan, up], axis=1)[:, None], ends.shape)
    return observations.ControlLines(
        name=table.text["name"],
        points=points,
        kind=kind,
        coordinates=ends,
        sigma_m=np.where(np.isnan(ends), np.nan, sigma),
        straightness_m=np.where(np.isnan(own), observations.STRAIGHTNESS_M, own),
        adjust=np.array([use != "check" for use in table.text["use"]], dtype=np.bool_),
    )


def _check_ends(
    table: Table, names: list[list[str]], ends: Floats, kind: Literal["geodetic", "local"]
) -> None:
    """Report mistakes of ends (L, 2, 3): missing ones, a height at one end, or no direction."""
    blamed = {line for line, _ in table.faults}
    for row in range(len(ends)):
        if int(table.line[row]) in blamed:
            continue
        empty = [name for of in names for name in of[:2] if np.isnan(table.numbers[name][row])]
        for name in empty:
            table.add_fault(row, f"{name} is empty")
        if empty:
            continue
        heights = np.isnan(ends[row, :, 2])
        if heights.any() and not heights.all():
            lacks = names[int(np.flatnonzero(heights)[0])][2]
            table.add_fault(
                row,
                f"{lacks} is empty, but the other end has a height: give both heights or none",
            )
        ahead = ends[row, 1, :2] - ends[row, 0, :2]
        if kind == "geodetic":
            ahead = ahead * _DEGREE_M * np.array([1.0, np.cos(np.deg2rad(ends[row, 0, 0]))])
        if np.hypot(*ahead) < SHORTEST_M:
            table.add_fault(
                row,
                f"start and end are {np.hypot(*ahead):.2f} m apart seen from above, which gives "
                f"the line no direction: give two points at least {format_digits(SHORTEST_M, 6)} m "
                "apart",
            )


def _line_points(table: Table, row: int) -> tuple[str, ...]:
    points = read_points(table, row, observations.ON_LINE, (1, None))
    if len(set(points)) < len(points):
        table.add_fault(row, f"points names a label twice (got {table.text['points'][row]!r})")
    return points
