"""picks.csv -> `Picks`."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from uavgram.io.tables.csv_tables import Columns, Table, read_table
from uavgram.model.survey.observations import Picks

PICKS_COLUMNS = Columns(
    text=("image", "label"),
    numbers=("u_px", "v_px"),
    optional_text=("area", "note"),
    optional_numbers=("sigma_px", "height_m"),
    others=True,
)


def read_picks(path: str | Path, *, may_be_empty: bool = False) -> Picks:
    """Read picked pixels; `may_be_empty`: a table without any is no mistake.

    Raises
    ------
    InputError
        Names file and line of every mistake: those of any table, no pick at all, a path where a
        file name is wanted, a semicolon in a label, a label picked twice in one image, a label
        with two different heights or in two areas, a sigma that is not greater than 0.
    """
    table = read_table(path, PICKS_COLUMNS)
    if not len(table.line) and not may_be_empty:
        table.faults.append(
            (1, "holds no pick: pick points with `uavgram pick`, or add a line each")
        )
    table.require_sigma("sigma_px")
    table.require_short("label")
    _check_names(table)
    _check_doubles(table)
    _check_heights(table)
    _check_areas(table)
    table.raise_faults()
    return Picks(
        image=table.text["image"],
        label=table.text["label"],
        pixel_px=np.stack([table.numbers["u_px"], table.numbers["v_px"]], axis=1),
        sigma_px=table.numbers["sigma_px"],
        height_m=table.numbers["height_m"],
        area=table.text["area"],
        line=tuple(table.line.tolist()),
    )


def _check_names(table: Table) -> None:
    if not any(map(re.compile(r"[/\\]").search, set(table.text["image"]))) and not any(
        ";" in label for label in set(table.text["label"])
    ):
        return
    for row, (image, label) in enumerate(
        zip(table.text["image"], table.text["label"], strict=True)
    ):
        if re.search(r"[/\\]", image):
            name = re.split(r"[/\\]", image)[-1]
            table.blame(row, f"image must be the file's name alone: {name!r} (got {image!r})")
        if ";" in label:
            table.blame(
                row, f"label {label!r} holds a semicolon, which separates labels in measure.csv"
            )


def _check_doubles(table: Table) -> None:
    if len(set(zip(table.text["image"], table.text["label"], strict=True))) == len(table.line):
        return
    first: dict[tuple[str, str], int] = {}
    for row, pick in enumerate(zip(table.text["image"], table.text["label"], strict=True)):
        if all(pick) and pick in first:
            image, label = pick
            table.blame(
                row,
                f"label {label!r} is picked twice in image {image!r}, first in line "
                f"{table.line[first[pick]]}: one physical point has one pick in an image; remove "
                "one, or rename it if it is another point",
            )
        first.setdefault(pick, row)


def _check_heights(table: Table) -> None:
    first: dict[str, int] = {}
    heights = table.numbers["height_m"].tolist()
    for row in np.flatnonzero(np.isfinite(table.numbers["height_m"])).tolist():
        label = table.text["label"][row]
        earlier = first.setdefault(label, row)
        if heights[earlier] != heights[row]:
            table.blame(
                row,
                f"height_m of label {label!r} is {heights[row]:g} here, but {heights[earlier]:g} "
                f"in line {table.line[earlier]}: one physical point has one height",
            )


def _check_areas(table: Table) -> None:
    first: dict[str, int] = {}
    areas = table.text["area"]
    if not any(areas):
        return
    for row, (label, area) in enumerate(zip(table.text["label"], areas, strict=True)):
        if not area:
            continue
        earlier = first.setdefault(label, row)
        if areas[earlier] != area:
            table.blame(
                row,
                f"area of label {label!r} is {area!r} here, but {areas[earlier]!r} in line "
                f"{table.line[earlier]}: one physical point lies in one area",
            )
