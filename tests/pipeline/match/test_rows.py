"""Finds as rows of picks.csv."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from uavgram.io.tables.picks import read_picks
from uavgram.io.tables.updates import update_picks
from uavgram.pipeline.match.selection import append_matches
from uavgram.stages.match import Found

TABLE = (
    "image,label,u_px,v_px,height_m,source,who\n"
    'a.jpg,P, 10.50 ,20.25,,GPS,"Ann, B."\n'
    "b.jpg,Q,30,40,free,,\n"
)


def found(pick: int, u_px: float) -> Found:
    return Found(pick, (u_px, 7.0), 0.05, 0.9, 3.0)


def test_rows_of_people_stay_to_the_byte_and_so_does_their_own_source(tmp_path: Path) -> None:
    path = tmp_path / "picks.csv"
    path.write_text(TABLE, encoding="utf-8")
    before = read_picks(path)
    after = append_matches(before, {("b.jpg", "P"): found(0, 5.5), ("a.jpg", "Q"): found(1, 6.5)})

    content = update_picks(path.read_bytes(), before, after)

    assert content is not None
    lines = content.decode().splitlines()
    for old, new in zip(TABLE.splitlines()[1:], lines[1:3], strict=True):
        assert new.rstrip(",") == old.rstrip(",")
    path.write_bytes(content)
    again = read_picks(path)
    assert list(again.source[:4]) == ["hand", "hand", "match", "match"]
    assert again.from_image[2:] == ("a.jpg", "b.jpg")
    assert again.from_px[2:].tolist() == [[10.5, 20.25], [30.0, 40.0]]
    assert again.sigma_px[2:].tolist() == [0.05, 0.05]
    assert again.score[2:].tolist() == [0.9, 0.9]


def test_the_picks_that_stay_keep_their_numbers_of_rows(tmp_path: Path) -> None:
    path = tmp_path / "picks.csv"
    path.write_text(TABLE, encoding="utf-8")
    picks = append_matches(read_picks(path), {("b.jpg", "P"): found(0, 5.5)})

    less = picks.where(np.array([True, False, True]))

    assert (less.image, less.label) == (("a.jpg", "b.jpg"), ("P", "P"))
    assert less.is_free.tolist() == [False, False]
    assert less.source == ("hand", "match")
