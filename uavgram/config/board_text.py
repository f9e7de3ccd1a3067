"""Text notation of calibration boards, such as ``chessboard:9x6:25mm``."""

from __future__ import annotations

import re

from uavgram.errors import InputError, suggest_spelling
from uavgram.imaging.targets.boards import dictionary_names, dictionary_size
from uavgram.model.board import Board, flat_board

OPTION = "--board"
NOTATION = (
    "chessboard:9x6:25mm (9 x 6 inner corners, where four squares meet; side of a square) or "
    "charuco:8x6:30mm:22mm:DICT_5X5_100 (8 x 6 squares; sides of a square and of a marker; "
    "the markers' dictionary)"
)
MIN_CORNERS = 3  # each way: with fewer, any other crossing lines look like a board
MAX_CORNERS = 200  # each way: no camera resolves more of them
_LARGEST_SQUARE_M = 5.0
_UNITS = {"mm": 1e-3, "cm": 1e-2, "m": 1.0}
_COUNT = re.compile(r"(\d{1,9})x(\d{1,9})")
_LENGTH = re.compile(r"(\d+(?:\.\d*)?|\.\d+)(mm|cm|m)")


def parse_board(text: str) -> Board:
    """Parse the notation of a calibration board.

    Parameters
    ----------
    text
        See `NOTATION`: a chessboard is counted in inner corners, a ChArUco board in squares, each
        as OpenCV does.

    Raises
    ------
    InputError
        It cannot be parsed, or is not a board.
    """
    kind, *parts = text.strip().split(":")
    if kind == "chessboard" and len(parts) == 2:
        columns, rows = _count(text, parts[0], MIN_CORNERS, "inner corners")
        return flat_board(columns, rows, _length(text, parts[1]))
    if kind == "charuco" and len(parts) == 4:
        return _charuco(text, parts)
    if kind in {"chessboard", "charuco"}:
        raise _make_error(text, f"a {kind} has other parts than these {len(parts)}")
    hint = suggest_spelling(kind, ("chessboard", "charuco"))
    raise _make_error(text, f"unknown kind of board {kind!r}" + (f" ({hint})" if hint else ""))


def _charuco(text: str, parts: list[str]) -> Board:
    columns, rows = _count(text, parts[0], MIN_CORNERS, "squares")
    square_m, marker_m = _length(text, parts[1]), _length(text, parts[2])
    if marker_m >= square_m:
        raise _make_error(text, "the marker is not smaller than the square around it")
    dictionary, wanted = parts[3].upper(), columns * rows // 2
    size = dictionary_size(dictionary)
    if not size:
        hint = suggest_spelling(dictionary, dictionary_names())
        raise _make_error(text, f"unknown dictionary {parts[3]!r}" + (f" ({hint})" if hint else ""))
    if size < wanted:
        raise _make_error(text, f"{dictionary} has {size} markers, this board needs {wanted}")
    return flat_board(
        columns - 1,
        rows - 1,
        square_m,
        kind="charuco",
        marker_m=marker_m,
        dictionary=dictionary,
    )


def _count(text: str, part: str, least: int, what: str) -> tuple[int, int]:
    match = _COUNT.fullmatch(part)
    if match is None:
        raise _make_error(text, f"{part!r} is no number of {what}: write 9x6")
    columns, rows = int(match[1]), int(match[2])
    if min(columns, rows) < least:
        raise _make_error(text, f"{part!r}: at least {least} {what} each way are needed")
    if max(columns, rows) > MAX_CORNERS:
        raise _make_error(text, f"{part!r}: at most {MAX_CORNERS} {what} each way are possible")
    return columns, rows


def _length(text: str, part: str) -> float:
    match = _LENGTH.fullmatch(part.replace(" ", ""))
    if match is None:
        raise _make_error(text, f"{part!r} is no length: write 25mm, 2.5cm or 0.025m")
    length_m = float(match[1]) * _UNITS[match[2]]
    if not 0 < length_m <= _LARGEST_SQUARE_M:
        raise _make_error(text, f"{part!r}: between 0 and {_LARGEST_SQUARE_M:g} m is possible")
    return length_m


def _make_error(text: str, what: str) -> InputError:
    return InputError(OPTION, f"{text!r}: {what}; write {NOTATION}")
