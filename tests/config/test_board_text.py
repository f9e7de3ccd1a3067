"""Boards as a person writes them."""

from __future__ import annotations

import numpy as np
import pytest

from uavgram.config.board_text import parse_board
from uavgram.errors import InputError


@pytest.mark.parametrize("square", ["25mm", "2.5cm", "0.025m", "25 mm"])
def test_a_chessboard_is_counted_in_inner_corners(square: str) -> None:
    board = parse_board(f"chessboard:9x6:{square}")
    assert (board.kind, board.columns, board.rows) == ("chessboard", 9, 6)
    np.testing.assert_allclose(board.corner_board_m[-1], [8 * 0.025, 5 * 0.025, 0.0])


def test_a_charuco_board_is_counted_in_squares() -> None:
    board = parse_board("charuco:8x6:30mm:22mm:dict_5x5_100")
    assert (board.kind, board.columns, board.rows) == ("charuco", 7, 5)
    assert (board.square_m, board.marker_m, board.dictionary) == (0.03, 0.022, "DICT_5X5_100")


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "unknown kind"),
        ("chesboard:9x6:25mm", "did you mean 'chessboard'"),
        ("chessboard:9x6", "other parts"),
        ("chessboard:9x6:25mm:3mm", "other parts"),
        ("chessboard:9:25mm", "no number of inner corners"),
        ("chessboard:9x2:25mm", "at least 3 inner corners"),
        ("chessboard:201x6:25mm", "at most 200 inner corners"),
        ("chessboard:100000x100000:1mm", "at most 200 inner corners"),
        ("chessboard:9x" + 5000 * "9" + ":1mm", "no number of inner corners"),
        ("charuco:8x201:30mm:22mm:DICT_5X5_1000", "at most 200 squares"),
        ("chessboard:9x6:25", "no length"),
        ("chessboard:9x6:-25mm", "no length"),
        ("chessboard:9x6:0mm", "between 0 and 5 m"),
        ("chessboard:9x6:25m", "between 0 and 5 m"),
        ("charuco:8x6:30mm:30mm:DICT_5X5_100", "not smaller"),
        ("charuco:8x6:30mm:22mm:DICT_5X5_10", "did you mean 'DICT_5X5_100'"),
        ("charuco:8x6:30mm:22mm:CharucoBoard", "unknown dictionary"),
        ("charuco:12x10:30mm:22mm:DICT_5X5_50", "50 markers, this board needs 60"),
    ],
)
def test_what_is_wrong_with_a_board_is_said_with_the_way_to_write_it(text: str, words: str) -> None:
    with pytest.raises(InputError, match=words) as caught:
        parse_board(text)
    assert "chessboard:9x6:25mm" in str(caught.value)
    assert caught.value.path == "--board"
