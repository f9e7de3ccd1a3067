"""Columns of picks.csv that tell what the program found, and a person's own of these names."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from uavgram.errors import InputError
from uavgram.io.tables.picks import count_made, read_picks, read_ties, update_ties
from uavgram.model.survey import NO_TIES, TiePicks

HEADER = "image,label,u_px,v_px,source,score,from_image,from_u_px,from_v_px\n"


def written(folder: Path, *rows: str) -> Path:
    path = folder / "picks.csv"
    path.write_text(HEADER + "".join(row + "\n" for row in rows))
    return path


def test_a_persons_own_columns_may_hold_anything(tmp_path: Path) -> None:
    picks = read_picks(written(tmp_path, "a.jpg,P1,1,2,Peter,good,,left,"))

    assert picks.source[0] == "hand"
    assert np.isnan(picks.score[0])
    assert np.isnan(picks.from_px[0]).all()


def test_what_the_program_found_says_where_it_is_from(tmp_path: Path) -> None:
    picks = read_picks(written(tmp_path, "a.jpg,P1,1,2,,,,,", "b.jpg,P1,3,4,match,0.9,a.jpg,1,2"))

    assert list(picks.source[:2]) == ["hand", "match"]
    assert picks.score[1] == 0.9
    assert picks.from_image[1] == "a.jpg"
    assert picks.from_px[1].tolist() == [1.0, 2.0]


def test_a_number_of_the_programs_that_is_none_is_named(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"score must be a number \(got 'good'\)"):
        read_picks(written(tmp_path, "b.jpg,P1,3,4,match,good,a.jpg,1,2"))


# ties.csv: what it holds, every mistake refused with its line, and rows of others kept.


HEADER_TIES = "image,tie,u_px,v_px,sigma_px,source\n"
TWO = "a.jpg,t1,10.5,20,0.1,tie\nb.jpg,t1,30,40.25,0.2,tie\n"


def table(folder: Path, rows: str, header: str = HEADER_TIES) -> Path:
    path = folder / "ties.csv"
    path.write_text(header + rows, encoding="utf-8")
    return path


def found() -> TiePicks:
    return TiePicks(
        image=("a.jpg", "b.jpg", "c.jpg"),
        tie=("tie1",) * 3,
        pixel_px=np.array([[1.25, 2.5], [3.0, 4.0], [5.125, 6.0]]),
        sigma_px=np.array([0.1, 0.2, 0.3]),
    )


def test_sightings_are_read(tmp_path: Path) -> None:
    ties = read_ties(table(tmp_path, TWO))

    assert ties.image == ("a.jpg", "b.jpg")
    assert ties.tie == ("t1", "t1")
    np.testing.assert_array_equal(ties.pixel_px, [[10.5, 20.0], [30.0, 40.25]])
    np.testing.assert_array_equal(ties.sigma_px, [0.1, 0.2])
    assert ties.line == (2, 3)


def test_a_table_without_rows_holds_none(tmp_path: Path) -> None:
    assert read_ties(table(tmp_path, "")).image == ()


@pytest.mark.parametrize(
    ("row", "line", "says"),
    [
        ("c.jpg,t2,1,2,0.1,tie", 4, "tie point 't2' is in one image only, and ties nothing"),
        ("a.jpg,t1,1,2,0.1,tie", 4, "'t1' occurs twice in image 'a.jpg', first in line 2"),
        ("c.jpg,t1,1,2,0,tie", 4, "sigma_px must be greater than 0"),
        ("c.jpg,t1,1,2,-1,tie", 4, "sigma_px must be greater than 0"),
        ("c.jpg,t1,1,2,,tie", 4, "sigma_px is empty"),
        ("c.jpg,,1,2,0.1,tie", 4, "tie is empty"),
        ("x/c.jpg,t1,1,2,0.1,tie", 4, "image must be the file's name alone: 'c.jpg'"),
        ("c.jpg,t1,1,two,0.1,tie", 4, "v_px must be a number (got 'two')"),
        ("c.jpg,t1,1", 4, "3 cells, but the header has 6"),
    ],
)
def test_mistakes_are_named_with_their_line(tmp_path: Path, row: str, line: int, says: str) -> None:
    path = table(tmp_path, TWO + row + "\n")

    with pytest.raises(InputError) as refused:
        read_ties(path)

    assert f"{path}:{line}: " in str(refused.value)
    assert says in str(refused.value)


def test_a_column_that_is_missing_is_named(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="column 'sigma_px' is missing"):
        read_ties(table(tmp_path, "a.jpg,t,1,2\n", "image,tie,u_px,v_px\n"))


def test_what_is_written_is_read(tmp_path: Path) -> None:
    path = tmp_path / "ties.csv"
    path.write_bytes(update_ties(path, found()) or b"")

    read = read_ties(path)

    assert read.image == found().image
    np.testing.assert_array_equal(read.pixel_px, found().pixel_px)
    np.testing.assert_array_equal(read.sigma_px, found().sigma_px)
    assert count_made(path) == 3


def test_the_programs_own_rows_are_replaced(tmp_path: Path) -> None:
    content = update_ties(table(tmp_path, TWO), found())

    assert content is not None
    assert b"t1," not in content.replace(b"tie1,", b"")
    assert content.count(b"\n") == 4


def test_rows_of_others_stay_as_they_are_and_names_do_not_meet(tmp_path: Path) -> None:
    own = "a.jpg,tie1, 7.50,8,0.5,metashape\nb.jpg,tie1,9,10,0.5,metashape\n"
    path = table(tmp_path, TWO + own)

    content = update_ties(path, found())

    assert content is not None
    assert own in content.decode()
    path.write_bytes(content)
    assert sorted(set(read_ties(path).tie)) == ["new-tie1", "tie1"]
    assert count_made(path) == 3


def test_all_is_taken_back_and_nothing_else(tmp_path: Path) -> None:
    own = "a.jpg,m1,7.50,8,0.5,\nb.jpg,m1,9,10,0.5,\n"

    assert update_ties(table(tmp_path, own + TWO), NO_TIES) == (HEADER_TIES + own).encode()
    assert update_ties(table(tmp_path, TWO), NO_TIES) is None
    assert update_ties(tmp_path / "none.csv", NO_TIES) is None
    assert count_made(tmp_path / "none.csv") == 0


def test_a_wrong_table_is_not_written_over(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="is in one image only"):
        update_ties(table(tmp_path, "a.jpg,t1,1,2,0.1,\n"), found())
