"""Reading of picks.csv and ties.csv, and updates of ties.csv."""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from uavgram.input_files import read_bytes
from uavgram.io.tables.csv_tables import Columns, Table, read_table
from uavgram.io.tables.updates import Cells, create_table, rewrite_table
from uavgram.model.arrays import Floats
from uavgram.model.observations import Picks, Source
from uavgram.model.survey import TiePicks

PICKS_COLUMNS = Columns(
    text=("image", "label"),
    numbers=("u_px", "v_px"),
    optional_text=("area", "note", "source", "score", "from_image", "from_u_px", "from_v_px"),
    optional_numbers=("sigma_px", "height_m", "height_sigma_m"),
    words={"height_m": "free"},
    others=True,
)
_SOURCES: dict[str, Source] = {"match": "match", "target": "target"}
"""Texts of the column `source` for picks of the program; other texts are users' notes."""

_PROGRAM_NUMBERS = ("score", "from_u_px", "from_v_px")

_FOLDER, _SEMICOLON = re.compile(r"[/\\]"), re.compile(";")


def read_picks(path: str | Path, *, may_be_empty: bool = False) -> Picks:
    """Read picked pixels; with `may_be_empty` a table without any is no mistake.

    Raises
    ------
    InputError
        Names file and line of every mistake: those of any table, no pick at all, a path instead of
        a file name, a semicolon in a label, a label that the program found twice in one image, a
        label with two different heights or in two areas, a sigma that is not greater than 0.
    """
    table = read_table(path, PICKS_COLUMNS)
    if not len(table.line) and not may_be_empty:
        table.faults.append(
            (1, "holds no pick: pick points with `uavgram pick`, or add a line each")
        )
    _check_names(table)
    _check_doubles(table)
    _check_heights(table)
    areas = [area and repr(area) for area in table.text["area"]]
    _check_same(table, "area", areas, "is in one area")
    score, from_u, from_v = (_read_program_numbers(table, name) for name in _PROGRAM_NUMBERS)
    table.raise_faults()
    return Picks(
        image=table.text["image"],
        label=table.text["label"],
        pixel_px=np.stack([table.numbers["u_px"], table.numbers["v_px"]], axis=1),
        sigma_px=table.numbers["sigma_px"],
        height_m=table.numbers["height_m"],
        height_sigma_m=table.numbers["height_sigma_m"],
        is_free=table.has_word["height_m"],
        area=table.text["area"],
        source=tuple(_SOURCES.get(text, "hand") for text in table.text["source"]),
        score=score,
        from_image=table.text["from_image"],
        from_px=np.stack([from_u, from_v], axis=1),
        line=tuple(table.line.tolist()),
    )


def _read_program_numbers(table: Table, name: str) -> Floats:
    """Read the numbers (P,) of rows made by the program; in others the column is the user's own."""
    numbers = np.full(len(table.line), np.nan)
    for row, (text, source) in enumerate(zip(table.text[name], table.text["source"], strict=True)):
        if text and source in _SOURCES:
            try:
                numbers[row] = float(text.replace(",", "."))
            except ValueError:
                numbers[row] = np.inf
            if not math.isfinite(numbers[row]):
                table.add_fault(row, f"{name} must be a number (got {text!r})")
    return numbers


def _check_heights(table: Table) -> None:
    """Report labels with two different heights or sigmas, and sigmas without a height."""
    is_free, sigmas = table.has_word["height_m"], table.numbers["height_sigma_m"]
    heights = _format_numbers(table.numbers["height_m"])
    words = ["free" if free else text for free, text in zip(is_free, heights, strict=True)]
    _check_same(table, "height_m", words, "has one height")
    _check_same(table, "height_sigma_m", _format_numbers(sigmas), "has one height")
    stated = {label for label, text in zip(table.text["label"], heights, strict=True) if text}
    for row in np.flatnonzero(np.isfinite(sigmas)).tolist():
        if table.text["label"][row] not in stated:
            table.add_fault(
                row,
                f"height_sigma_m of label {table.text['label'][row]!r} is the sigma of no height: "
                "state height_m too, or leave the sigma away",
            )


def _format_numbers(numbers: Floats) -> list[str]:
    return ["" if math.isnan(number) else repr(number) for number in numbers.tolist()]


def _check_names(table: Table) -> None:
    for row, image in _rows_with(table, "image", _FOLDER):
        name = _FOLDER.split(image)[-1]
        table.add_fault(row, f"image must be the file's name alone: {name!r} (got {image!r})")
    for row, label in _rows_with(table, "label", _SEMICOLON):
        text = f"label {label!r} holds a semicolon, which separates a measurement's labels"
        table.add_fault(row, text)


def _rows_with(table: Table, name: str, pattern: re.Pattern[str]) -> Iterator[tuple[int, str]]:
    """Find the rows whose text matches, with the text; each distinct text is searched once."""
    odd = {text for text in set(table.text[name]) if pattern.search(text)}
    return ((row, text) for row, text in enumerate(table.text[name]) if odd and text in odd)


def _check_doubles(table: Table) -> None:
    """Report labels that the program found twice in one photo: only clicks may be repeated."""
    picks = list(zip(*(table.text[name] for name in ("image", "label", "source")), strict=True))
    for row, line in table.find_repeated(picks):
        image, label, source = picks[row]
        if source in _SOURCES:
            table.add_fault(
                row,
                f"label {label!r} is found twice in image {image!r} (source {source}), first in "
                f"line {line}: only a click is repeated; remove one",
            )


def _check_same(table: Table, name: str, values: Sequence[str], remedy: str) -> None:
    """Report every row whose value (if it has one) differs from that of its label's first row."""
    if not any(values):
        return
    first: dict[str, int] = {}
    for row, (label, value) in enumerate(zip(table.text["label"], values, strict=True)):
        earlier = first.setdefault(label, row) if value else row
        if values[earlier] != value:
            table.add_fault(
                row,
                f"{name} of label {label!r} is {value} here, but {values[earlier]} in line "
                f"{table.line[earlier]}: one physical point {remedy}",
            )


TIES_COLUMNS = Columns(
    text=("image", "tie"),
    numbers=("u_px", "v_px", "sigma_px"),
    optional_text=("source", "note"),
    others=True,
)
TIES_HEADER = ("image", "tie", "u_px", "v_px", "sigma_px", "source")
TIE_SOURCE = "tie"
"""Text of the column `source` for rows made by the program."""


def read_ties(path: str | Path) -> TiePicks:
    """Read tie points.

    Raises
    ------
    InputError
        Names file and line of every mistake: those of any table, a path instead of a file name, a
        tie point twice in one image or in one image only, an invalid sigma.
    """
    table = read_table(path, TIES_COLUMNS)
    for row, image in enumerate(table.text["image"]):
        name = image.replace("\\", "/").split("/")[-1]
        if name != image:
            table.add_fault(row, f"image must be the file's name alone: {name!r} (got {image!r})")
    _check_images(table)
    table.raise_faults()
    return TiePicks(
        image=table.text["image"],
        tie=table.text["tie"],
        pixel_px=np.stack([table.numbers["u_px"], table.numbers["v_px"]], axis=1),
        sigma_px=table.numbers["sigma_px"],
        line=tuple(table.line.tolist()),
    )


def _check_images(table: Table) -> None:
    """Report tie points that occur twice in one image, or in one image only."""
    sightings = list(zip(table.text["image"], table.text["tie"], strict=True))
    for row, line in table.find_repeated(sightings):
        image, tie = sightings[row]
        table.add_fault(
            row,
            f"tie point {tie!r} occurs twice in image {image!r}, first in line {line}: a photo "
            "shows one point once; remove one, or rename it",
        )
    count = Counter(tie for image, tie in sightings if image)
    for row, (image, tie) in enumerate(sightings):
        if image and tie and count[tie] == 1:
            table.add_fault(
                row,
                f"tie point {tie!r} is in one image only, and ties nothing: remove it, or add "
                "its place in another image",
            )


def update_ties(path: Path, found: TiePicks) -> bytes | None:
    """Update ties.csv with other tie points of the program; rows from other sources stay.

    Parameters
    ----------
    path
        The table, which may not exist yet.
    found
        Tie points found by the program; if empty, the program's rows are removed.

    Returns
    -------
    bytes or None
        The file; None where it would be empty.

    Raises
    ------
    InputError
        The existing table has mistakes.
    """
    before: list[Cells] = []
    if path.exists():
        read_ties(path)
        before = _cells_of(read_table(path, TIES_COLUMNS))
    others = [row for row in before if row["source"] != TIE_SOURCE]
    taken = {row["tie"] for row in others}
    prefix = ""
    while any(prefix + name in taken for name in set(found.tie)):
        prefix += "new-"
    places = zip(found.image, found.tie, found.pixel_px, found.sigma_px, strict=True)
    made: list[Cells] = [
        {
            "image": image,
            "tie": prefix + tie,
            "u_px": f"{u:.3f}",
            "v_px": f"{v:.3f}",
            "sigma_px": f"{sigma:.3f}",
            "source": TIE_SOURCE,
        }
        for image, tie, (u, v), sigma in places
    ]
    if others:
        return rewrite_table(read_bytes(path), before, [*others, *made], ("image", "tie"))
    return create_table(TIES_HEADER, made) if made else None


EMPTY_TIES = create_table(TIES_HEADER, [])
"""Table without tie points: if the project names it, no new search is made."""


def count_made(path: Path) -> int:
    """Count the rows of a table made by the program; 0 where the table does not exist."""
    if not path.exists():
        return 0
    return read_table(path, TIES_COLUMNS).text["source"].count(TIE_SOURCE)


def _cells_of(table: Table) -> list[Cells]:
    numbers = {name: table.numbers[name].tolist() for name in TIES_COLUMNS.numbers}
    return [
        {name: table.text[name][row] for name in (*TIES_COLUMNS.text, "source")}
        | {name: repr(values[row]) for name, values in numbers.items()}
        for row in range(len(table.line))
    ]
