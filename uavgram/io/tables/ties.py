"""Reading and writing of ties.csv as `TiePicks`."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from uavgram.input_files import read_bytes
from uavgram.io.tables.csv_tables import Columns, Table, read_table
from uavgram.io.tables.rewrite import Cells, create_table, rewrite_table
from uavgram.model.survey.ties import TiePicks

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
    first: dict[tuple[str, str], int] = {}
    rows: dict[str, list[int]] = {}
    for row, (image, tie) in enumerate(zip(table.text["image"], table.text["tie"], strict=True)):
        if not (image and tie):
            continue
        rows.setdefault(tie, []).append(row)
        earlier = first.setdefault((image, tie), row)
        if earlier != row:
            table.add_fault(
                row,
                f"tie point {tie!r} occurs twice in image {image!r}, first in line "
                f"{table.line[earlier]}: a photo shows one point once; remove one, or rename it",
            )
    for tie, of_tie in rows.items():
        if len(of_tie) == 1:
            table.add_fault(
                of_tie[0],
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
