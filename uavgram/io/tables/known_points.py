"""control.csv and check.csv -> `KnownPoints`."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

import numpy as np

from uavgram.errors import InputError
from uavgram.io.tables.csv_tables import Columns, Table, read_table
from uavgram.model.survey.observations import KnownPoints

GEODETIC = ("latitude_deg", "longitude_deg", "height_m")
_COORDINATES: dict[Literal["geodetic", "local"], tuple[str, str, str]] = {
    "geodetic": GEODETIC,
    "local": ("east_m", "north_m", "up_m"),
}
_ONE_SIGMA = ("sigma_m",)
THREE_SIGMAS = ("sigma_east_m", "sigma_north_m", "sigma_up_m")
_ALL = (*_COORDINATES["geodetic"], *_COORDINATES["local"], *_ONE_SIGMA, *THREE_SIGMAS)


def read_known_points(path: str | Path) -> KnownPoints:
    """Read points with known coordinates.

    Raises
    ------
    InputError
        Names file and line of every mistake: those of any table, geodetic and local columns (or
        one sigma and three) side by side, an empty cell, a label used twice, a latitude or
        longitude out of range, a sigma that is not greater than 0.
    """
    table = read_table(path, Columns(text=("label",), optional_numbers=_ALL))
    kind: Literal["geodetic", "local"] = (
        "geodetic" if _chosen(table, *_COORDINATES.values()) == 0 else "local"
    )
    sigmas = (_ONE_SIGMA, THREE_SIGMAS)[_chosen(table, _ONE_SIGMA, THREE_SIGMAS)]
    names = _COORDINATES[kind]
    _check_cells(table, (*names, *sigmas))
    for name in sigmas:
        table.require_sigma(name)
    table.require_unique("label", "label")
    if kind == "geodetic":
        table.require_range("latitude_deg", 90.0)
        table.require_range("longitude_deg", 360.0)
    table.raise_faults()
    sigma_m = np.stack([table.numbers[name] for name in sigmas], axis=1)
    return KnownPoints(
        label=table.text["label"],
        kind=kind,
        coordinates=np.stack([table.numbers[name] for name in names], axis=1),
        sigma_m=np.broadcast_to(sigma_m, (len(table.line), 3)),
    )


def _chosen(table: Table, *choices: tuple[str, ...]) -> int:
    """Which of two sets of columns the header has: exactly one, complete, or an error."""
    present = [[name for name in choice if name in table.header] for choice in choices]
    written = " or ".join(", ".join(choice) for choice in choices)
    if all(present):
        mixed = " and ".join(names[0] for names in present)
        raise InputError(table.path, f"has both {mixed}: give either {written}", 1)
    for i, (have, choice) in enumerate(zip(present, choices, strict=True)):
        missing = [name for name in choice if name not in have]
        if have and missing:
            raise InputError(table.path, f"column {missing[0]!r} is missing beside {have[0]}", 1)
        if have:
            return i
    raise InputError(table.path, f"columns are missing: give either {written}", 1)


def _check_cells(table: Table, names: tuple[str, ...]) -> None:
    blamed = {line for line, _ in table.faults}  # a wrong number is NaN too: one message is enough
    for name in names:
        for row in np.flatnonzero(np.isnan(table.numbers[name])):
            if int(table.line[row]) not in blamed:
                table.blame(int(row), f"{name} is empty")
