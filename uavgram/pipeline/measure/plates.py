"""What is known of a project's coded plates: their sizes, and so lengths between their corners."""

from __future__ import annotations

from uavgram.model.arrays import Floats
from uavgram.model.options import TargetOptions
from uavgram.model.survey.observations import KnownLines, Picks
from uavgram.stages.plate_sides import SQUARE, own_scale, with_plate_sides


def plate_outline(targets: TargetOptions) -> Floats:
    """(4, 2) corners of a plate in metres; of a ChArUco board, its outermost inner corners."""
    if targets.side_m is not None:
        return SQUARE * targets.side_m
    from uavgram.config.board_text import parse_board  # noqa: PLC0415 - slow to load

    board = parse_board(targets.family)
    return SQUARE * board.square_m * [board.columns - 1, board.rows - 1]


def with_sides(lines: KnownLines, picks: Picks, targets: TargetOptions | None) -> KnownLines:
    """The known lengths, with those of the plates that were found.

    Parameters
    ----------
    lines, picks
        Of the project.
    targets
        Its plates; None: it has none.
    """
    if targets is None:
        return lines
    return with_plate_sides(lines, picks, plate_outline(targets), targets.sigma_m)


def plate_scale(targets: TargetOptions | None) -> tuple[tuple[str, float], ...]:
    """Name and prior of the scale that all plates have in common."""
    return () if targets is None else own_scale(plate_outline(targets), targets.sigma_m)
