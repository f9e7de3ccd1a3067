"""Copies of photos and readings are named, and found by what they hold."""

from __future__ import annotations

import numpy as np
import pytest

from uavgram.model.flight.frames import Photos
from uavgram.model.survey.observations import KnownLines, Picks
from uavgram.stages.duplicates import find_duplicates


def photos(*times: float) -> Photos:
    n = len(times)
    names = tuple(f"{chr(97 + k)}.jpg" for k in range(n))
    return Photos(
        frame_id=names,
        path=names,
        width_px=np.full(n, 10.0),
        height_px=np.full(n, 10.0),
        file_time_s=np.array(times),
        file_time_resolution_s=np.ones(n),
        time_source="exif",
    )


def picks(*rows: tuple[str, str, float, float]) -> Picks:
    n = len(rows)
    return Picks(
        image=tuple(row[0] for row in rows),
        label=tuple(row[1] for row in rows),
        pixel_px=np.array([row[2:] for row in rows], dtype=float).reshape(n, 2),
        sigma_px=np.full(n, np.nan),
        height_m=np.full(n, np.nan),
    )


def lines(*rows: tuple[str, str, float, bool]) -> KnownLines:
    start, end, length, adjust = zip(*rows, strict=True) if rows else ((), (), (), ())
    return KnownLines(
        name=tuple(f"L{k}" for k in range(len(rows))),
        start=start,
        end=end,
        length_m=np.array(length, dtype=float),
        sigma_m=np.full(len(rows), 0.01),
        adjust=np.array(adjust, dtype=bool),
    )


TWO = (("a.jpg", "A", 1, 2), ("a.jpg", "B", 3, 4))


def test_of_identical_files_the_one_with_most_picks_is_kept() -> None:
    found = find_duplicates(
        photos(1.0, 2.0, 3.0),
        {"a.jpg": "x", "b.jpg": "x", "c.jpg": "y"},
        picks(("b.jpg", "A", 1, 2), ("b.jpg", "B", 3, 4), ("a.jpg", "C", 5, 6)),
        lines(),
    )
    assert found.photos == {"a.jpg": "b.jpg"}
    (message,) = found.messages
    assert message.text.startswith(
        "1 photo is there twice and counted once, as a copy says nothing new: a.jpg is the same "
        "file as b.jpg (picks of 'C' are in the copy alone: pick them in b.jpg)."
    )
    assert found.reason("a.jpg") == "the same photo as b.jpg, which is counted"
    assert not found.reason("c.jpg")


@pytest.mark.parametrize(
    ("times", "second", "same"),
    [
        ((5.0, 5.0), (1, 2, 3, 4), True),
        ((5.0, 5.0), (1, 2, 3, 4.001), False),
        ((5.0, 6.0), (1, 2, 3, 4), False),
        ((np.nan, np.nan), (1, 2, 3, 4), False),
    ],
    ids=["saved anew", "another pick", "another time", "no time"],
)
def test_other_bytes_with_equal_time_and_picks_are_the_same_photo(
    times: tuple[float, float], second: tuple[float, float, float, float], *, same: bool
) -> None:
    u0, v0, u1, v1 = second
    more = (("b.jpg", "B", u1, v1), ("b.jpg", "A", u0, v0))
    found = find_duplicates(
        photos(*times), {"a.jpg": "x", "b.jpg": "y"}, picks(*TWO, *more), lines()
    )
    assert found.photos == ({"b.jpg": "a.jpg"} if same else {})
    assert len(found.messages) == int(same)


def test_photos_of_one_second_without_picks_are_a_burst() -> None:
    found = find_duplicates(photos(1.0, 1.0), {"a.jpg": "x", "b.jpg": "y"}, picks(), lines())
    assert not found.photos


def test_a_length_is_counted_once_for_each_of_its_readings() -> None:
    found = find_duplicates(
        photos(),
        {},
        picks(),
        lines(
            ("A", "B", 12.34, False),
            ("A", "B", 12.34, True),
            ("B", "A", 12.34, True),
            ("A", "B", 12.35, True),
            ("A", "C", 12.34, True),
        ),
    )
    assert found.lines == {0: 1, 2: 1}
    (message,) = found.messages
    assert "12.34 m from 'A' to 'B' (counted: 'L1'; not counted: 'L0' and 'L2')" in message.text


@pytest.mark.parametrize(
    ("rare", "other"), [("Pl", "P1"), ("O", "0"), ("p1", "P1"), ("P 1", "P1"), ("Н2", "H2")]
)
def test_a_label_that_is_picked_once_and_looks_like_another_is_named(rare: str, other: str) -> None:
    rows = (("a.jpg", other, 1.0, 2.0), ("b.jpg", other, 3.0, 4.0), ("c.jpg", rare, 5.0, 6.0))
    (said,) = find_duplicates(photos(1.0, 2.0, 3.0), {}, picks(*rows), lines()).messages
    assert (said.code, set(said.labels)) == ("label-resembles", {rare, other})
    assert said.text.startswith(f"The label {rare!r} is picked once, in c.jpg, and looks like ")

    both = picks(*rows, ("a.jpg", rare, 7.0, 8.0))
    assert not find_duplicates(photos(1.0, 2.0, 3.0), {}, both, lines()).messages


def test_labels_that_only_begin_alike_are_no_message() -> None:
    rows = [("a.jpg", label, 1.0, 2.0) for label in ("P1", "P2", "P10", "P11", "P12", "B", "8")]
    assert not find_duplicates(photos(1.0), {}, picks(*rows), lines()).messages
