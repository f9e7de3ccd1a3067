"""Columns of picks.csv that tell what the program found, and a person's own of these names."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from uavgram.errors import InputError
from uavgram.io.tables.picks import read_picks

HEADER = "image,label,u_px,v_px,source,score,from_image,from_u_px,from_v_px\n"


def written(folder: Path, *rows: str) -> Path:
    path = folder / "picks.csv"
    path.write_text(HEADER + "".join(row + "\n" for row in rows))
    return path


def test_a_persons_own_columns_may_hold_anything(tmp_path: Path) -> None:
    picks = read_picks(written(tmp_path, "a.jpg,P1,1,2,Peter,good,,left,"))

    assert picks.source_of(0) == "hand"
    assert np.isnan(picks.score[0])
    assert np.isnan(picks.from_px[0]).all()


def test_what_the_program_found_says_where_it_is_from(tmp_path: Path) -> None:
    picks = read_picks(written(tmp_path, "a.jpg,P1,1,2,,,,,", "b.jpg,P1,3,4,match,0.9,a.jpg,1,2"))

    assert [picks.source_of(i) for i in range(2)] == ["hand", "match"]
    assert picks.score[1] == 0.9
    assert picks.from_image[1] == "a.jpg"
    assert picks.from_px[1].tolist() == [1.0, 2.0]


def test_a_number_of_the_programs_that_is_none_is_named(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"score must be a number \(got 'good'\)"):
        read_picks(written(tmp_path, "b.jpg,P1,3,4,match,good,a.jpg,1,2"))
