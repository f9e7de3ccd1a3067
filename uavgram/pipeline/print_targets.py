"""Print sheets of coded plates at true size."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from uavgram.config.board_text import parse_board
from uavgram.errors import InputError, suggest_spelling
from uavgram.imaging.targets.plates import (
    MARGIN_CELLS,
    board_outlines,
    count_plates,
    plate_outlines,
    read_cells,
)
from uavgram.io.outputs import replace_bytes
from uavgram.model.naming import BOARD_PLATE, FAMILIES, LARGEST_PLATE_M, plate_label
from uavgram.views.targets_sheet import PAPERS_MM, Sheet, pages_of, room_mm, sheets_pdf

_MM = 1000.0
_STEP_MM = 5.0  # of the side that is chosen to fill a page


@dataclass(frozen=True, kw_only=True)
class PrintedTargets:
    """Written plates.

    Attributes
    ----------
    path
        The PDF.
    names
        Names of the plates.
    pages
        Number of pages of each.
    side_m
        Side of the black square; None for a board, which states its own.
    """

    path: Path
    names: tuple[str, ...]
    pages: int
    side_m: float | None


def print_targets(
    family: str, plates: Sequence[int], side_m: float | None, paper: str, path: Path
) -> PrintedTargets:
    """Write a PDF of plates, or of a ChArUco board.

    Parameters
    ----------
    family
        As in `targets: family`.
    plates
        Ids.
    side_m
        Side of the black square; None: as large as a page allows.
    paper
        Name of a paper.
    path
        The file; an earlier one is replaced.

    Raises
    ------
    InputError
        There is no such family, plate or paper, or the side is invalid.
    OutputError
        The file cannot be written.
    """
    if paper not in PAPERS_MM:
        raise InputError("--paper", f"{paper!r} is unknown: choose of {', '.join(PAPERS_MM)}")
    if family.split(":", maxsplit=1)[0] == BOARD_PLATE:
        sheets, side_m = [_board(family)], None
    else:
        side_m = _check_side(family, plates, side_m, paper)
        sheets = [_plate(family, plate, side_m) for plate in plates]
    replace_bytes(path, sheets_pdf(sheets, paper))
    return PrintedTargets(
        path=path,
        names=tuple(sheet.name for sheet in sheets),
        pages=math.prod(pages_of(sheets[0].size_mm, paper)),
        side_m=side_m,
    )


def _check_side(family: str, plates: Sequence[int], side_m: float | None, paper: str) -> float:
    """Return the side to print, after checks of all arguments."""
    if family not in FAMILIES:
        hint = suggest_spelling(family, FAMILIES) or "such as aruco-4x4-50 or apriltag-36h11"
        raise InputError("--family", f"there is no family {family!r} ({hint})")
    count = count_plates(family)
    wrong = [plate for plate in plates if not 0 <= plate < count]
    if wrong:
        raise InputError("--plates", f"{family} has the plates 0 to {count - 1}, and no {wrong[0]}")
    if side_m is None:
        cells = len(read_cells(family, 0))
        side_mm = min(room_mm(paper)) * cells / (cells + 2 * MARGIN_CELLS)
        return math.floor(side_mm / _STEP_MM) * _STEP_MM / _MM
    if not 0 < side_m <= LARGEST_PLATE_M:
        raise InputError(
            "--side-m", f"must be greater than 0 and at most {LARGEST_PLATE_M:g} m (got {side_m:g})"
        )
    return side_m


def _plate(family: str, plate: int, side_m: float) -> Sheet:
    side_mm = side_m * _MM
    white = MARGIN_CELLS * side_mm / len(read_cells(family, plate))
    size = side_mm + 2 * white
    return Sheet(
        name=plate_label(plate),
        outlines_mm=[side_mm * outline + white for outline in plate_outlines(family, plate)],
        size_mm=(size, size),
        words=f"{family} number {plate}, black square {side_mm:g} mm. Leave the white around it.",
    )


def _board(family: str) -> Sheet:
    board = parse_board(family)
    white = 0.5 * board.square_m * _MM
    width, height = (board.square_m * _MM * (n + 1) for n in (board.columns, board.rows))
    return Sheet(
        name=plate_label(0),
        outlines_mm=[_MM * outline + white for outline in board_outlines(board)],
        size_mm=(float(np.ceil(width + 2 * white)), float(np.ceil(height + 2 * white))),
        words=f"{family}, square {board.square_m * _MM:g} mm. Leave the white around it.",
    )
