"""control_lines.csv -> `ControlLines`."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

import numpy as np

from uavgram.errors import InputError, near_miss
from uavgram.io.tables.csv_tables import Columns, Table, read_table
from uavgram.io.tables.measure import points_of
from uavgram.model.arrays import Floats
from uavgram.model.survey.control_lines import ON_LINE, STRAIGHTNESS_M, ControlLines

_ENDS = ("start", "end")
_AXES: dict[Literal["geodetic", "local"], tuple[str, str, str]] = {
    "geodetic": ("latitude_deg", "longitude_deg", "height_m"),
    "local": ("east_m", "north_m", "up_m"),
}
_SIGMAS = ("sigma_m", "sigma_up_m", "straightness_m")
_USES = ("adjust", "check")

CONTROL_LINES_COLUMNS = Columns(
    text=("name", "points"),
    numbers=("sigma_m",),
    optional_text=("use", "note"),
    optional_numbers=(
        *(f"{end}_{axis}" for axes in _AXES.values() for end in _ENDS for axis in axes),
        *_SIGMAS[1:],
    ),
    others=True,
)

SHORTEST_M = 0.5
"""Ends closer than this in plan give no direction that is worth anything."""
_DEGREE_M = 111_000.0


def read_control_lines(path: str | Path) -> ControlLines:
    """Read lines with known coordinates.

    Raises
    ------
    InputError
        Names file and line of every mistake: those of any table, geodetic and local columns side
        by side, an empty coordinate, a height at one end alone, ends that are one place seen from
        above, no label, a label or name used twice, a latitude or longitude out of range, a sigma
        that is not greater than 0, an unknown `use`.
    """
    table = read_table(path, CONTROL_LINES_COLUMNS)
    kind = _kind(table)
    names = [[f"{end}_{axis}" for axis in _AXES[kind]] for end in _ENDS]
    table.require_unique("name", "line")
    table.require_short("name")
    for name in _SIGMAS:
        table.require_sigma(name)
    if kind == "geodetic":
        for end in _ENDS:
            table.require_range(f"{end}_latitude_deg", 90.0)
            table.require_range(f"{end}_longitude_deg", 360.0)
    ends = np.stack([np.stack([table.numbers[n] for n in of], axis=1) for of in names], axis=1)
    _check_ends(table, names, ends, kind)
    points = tuple(_points(table, row) for row in range(len(table.line)))
    for row, word in enumerate(table.text["use"]):
        if word and word not in _USES:
            hint = f": {guess}" if (guess := near_miss(word, _USES)) else ""
            table.blame(row, f"use must be {' or '.join(_USES)} (got {word!r}){hint}")
    table.raise_faults()
    plan, up, own = (table.numbers[name] for name in _SIGMAS)
    up = np.where(np.isnan(up), plan, up)
    sigma = np.broadcast_to(np.stack([plan, plan, up], axis=1)[:, None], ends.shape)
    return ControlLines(
        name=table.text["name"],
        points=points,
        kind=kind,
        coordinates=ends,
        sigma_m=np.where(np.isnan(ends), np.nan, sigma),
        straightness_m=np.where(np.isnan(own), STRAIGHTNESS_M, own),
        adjust=np.array([use != "check" for use in table.text["use"]], dtype=np.bool_),
    )


def _kind(table: Table) -> Literal["geodetic", "local"]:
    """Which coordinates the header has: of one kind, plan at both ends, or an error."""
    found: list[Literal["geodetic", "local"]] = []
    for kind, axes in _AXES.items():
        plan = [f"{end}_{axis}" for end in _ENDS for axis in axes[:2]]
        have = [name for name in plan if name in table.header]
        if have and len(have) < len(plan):
            missing = next(name for name in plan if name not in have)
            raise InputError(table.path, f"column {missing!r} is missing beside {have[0]}", 1)
        if have:
            found.append(kind)
    if len(found) == 1:
        return found[0]
    written = " or ".join(
        ", ".join(f"{end}_{axis}" for end in _ENDS for axis in axes[:2]) for axes in _AXES.values()
    )
    what = "has both" if found else "columns are missing"
    raise InputError(table.path, f"{what}: give either {written}", 1)


def _check_ends(
    table: Table, names: list[list[str]], ends: Floats, kind: Literal["geodetic", "local"]
) -> None:
    """Note ends (L, 2, 3) that are not there, half of a height, and lines without a direction."""
    blamed = {line for line, _ in table.faults}
    for row in range(len(ends)):
        if int(table.line[row]) in blamed:
            continue
        empty = [name for of in names for name in of[:2] if np.isnan(table.numbers[name][row])]
        for name in empty:
            table.blame(row, f"{name} is empty")
        if empty:
            continue
        heights = np.isnan(ends[row, :, 2])
        if heights.any() and not heights.all():
            lacks = names[int(np.flatnonzero(heights)[0])][2]
            table.blame(
                row,
                f"{lacks} is empty, but the other end has a height: give both heights or none",
            )
        ahead = ends[row, 1, :2] - ends[row, 0, :2]
        if kind == "geodetic":
            ahead = ahead * _DEGREE_M * np.array([1.0, np.cos(np.deg2rad(ends[row, 0, 0]))])
        if np.hypot(*ahead) < SHORTEST_M:
            table.blame(
                row,
                f"start and end are {np.hypot(*ahead):.2f} m apart seen from above, which gives "
                f"the line no direction: give two points at least {SHORTEST_M:g} m apart",
            )


def _points(table: Table, row: int) -> tuple[str, ...]:
    points = points_of(table, row, ON_LINE, (1, None))
    if len(set(points)) < len(points):
        table.blame(row, f"points names a label twice (got {table.text['points'][row]!r})")
    return points
