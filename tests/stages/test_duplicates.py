"""Copies of photos and readings are named, and found by what they hold."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import pytest

from uavgram.model.frames import Photos
from uavgram.model.observations import KnownLines, KnownThings, Picks
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


def found_in(
    times: tuple[float, ...], *rows: tuple[str, str, float, float], same: bool = True
) -> Mapping[str, str]:
    """Copies among a.jpg, b.jpg, ..., all other files, of which all show the same, or none."""
    files = {f"{chr(97 + k)}.jpg": str(k) for k in range(len(times))}
    found = find_duplicates(photos(*times), files, picks(*rows), lines(), is_same=lambda *_: same)
    assert len(found.messages) == bool(found.photos)
    return found.photos


def test_of_identical_files_the_one_with_a_time_is_counted_whatever_is_picked() -> None:
    found = find_duplicates(
        photos(np.nan, 2.0, 3.0),
        {"a.jpg": "x", "b.jpg": "x", "c.jpg": "y"},
        picks(("a.jpg", "A", 1, 2), ("a.jpg", "B", 3, 4), ("b.jpg", "C", 5, 6)),
        lines(),
    )
    assert found.photos == {"a.jpg": "b.jpg"}
    (message,) = found.messages
    assert message.text.startswith(
        "1 photo is there twice and counted once, as a copy adds no information: a.jpg is the same "
        "file as b.jpg. Picks in both are repeats of one observation."
    )
    assert found.reason("a.jpg") == "the same photo as b.jpg, which is counted"
    assert not found.reason("c.jpg")


@pytest.mark.parametrize(
    ("times", "second", "same"),
    [
        ((5.0, 5.0), (), True),
        ((5.0, 5.0), (("b.jpg", "C", 1, 2),), True),
        ((5.0, 6.0), (("b.jpg", "A", 1, 2),), False),
        ((5.0, np.nan), (("b.jpg", "A", 3, 4),), True),
        ((np.nan, np.nan), (("b.jpg", "A", 3, 4),), True),
        ((5.0, np.nan), (("b.jpg", "A", 9, 4),), False),
        ((5.0, np.nan), (), False),
    ],
    ids=["one time", "other picks", "another time", "no time", "neither", "far picks", "no picks"],
)
def test_other_files_of_one_exposure_are_those_of_one_time_or_with_picks_alike(
    times: tuple[float, float], second: tuple[tuple[str, str, float, float], ...], *, same: bool
) -> None:
    assert found_in(times, *TWO, *second) == ({"b.jpg": "a.jpg"} if same else {})


def test_photos_that_look_alike_are_no_copies_where_most_labels_are_elsewhere() -> None:
    nan = np.nan
    moved = [("b.jpg", "A", 2.0, 4.0), ("b.jpg", "B", 300.0, 4.0), ("b.jpg", "C", 9.0, 700.0)]
    first = [("a.jpg", "A", 1.0, 2.0), ("a.jpg", "B", 3.0, 4.0), ("a.jpg", "C", 1.0, 9.0)]
    assert not found_in((nan, nan), *first, *moved, same=True)
    again = [(name.replace("a", "b", 1), label, u + 1.0, v) for name, label, u, v in first]
    assert found_in((nan, nan), *first, *again, same=True) == {"b.jpg": "a.jpg"}


def test_photos_of_one_second_that_do_not_show_the_same_are_a_burst() -> None:
    assert not found_in((1.0, 1.0), *TWO, same=False)


def test_a_copy_of_a_copy_is_one_of_the_photo_that_is_counted() -> None:
    files = {"a.jpg": "x", "b.jpg": "y", "c.jpg": "y"}
    found = find_duplicates(photos(1.0, 1.0, 1.0), files, picks(), lines(), is_same=lambda *_: True)
    assert found.photos == {"b.jpg": "a.jpg", "c.jpg": "a.jpg"}


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
    ("rare", "other"),
    [("Pl", "P1"), ("O", "0"), ("p1", "P1"), ("P 1", "P1"), ("Н2", "H2")]
    + [(label, "R1") for label in ("R_1", "R-1", "R01", "R\uff11")]
    + [("PS", "P5"), ("PB", "P8"), ("PZ", "P2"), ("R010", "R10")],
)
def test_a_label_that_is_picked_once_and_looks_like_another_is_named(rare: str, other: str) -> None:
    rows = (("a.jpg", other, 1.0, 2.0), ("b.jpg", other, 3.0, 4.0), ("c.jpg", rare, 5.0, 6.0))
    (said,) = find_duplicates(photos(1.0, 2.0, 3.0), {}, picks(*rows), lines()).messages
    assert (said.code, set(said.labels)) == ("label-resembles", {rare, other})
    assert said.text.startswith(f"The label {rare!r} is picked once, in c.jpg, and looks like ")

    both = picks(*rows, ("a.jpg", rare, 7.0, 8.0))
    assert not find_duplicates(photos(1.0, 2.0, 3.0), {}, both, lines()).messages


def test_labels_that_only_begin_alike_are_no_message() -> None:
    series = [f"P{k}" for k in range(1, 21)]
    pairs = ["A1", "B1", "A-1-1", "A-11", "S1", "Z1", "R1", "RR1", "P100", "P0", "A", "A0"]
    pairs += ["B", "8", "S", "5", "81", "1-11", "11-1", "1.05", "1.5"]
    rows = [("a.jpg", label, 1.0, 2.0) for label in (*series, *pairs)]
    assert not find_duplicates(photos(1.0), {}, picks(*rows), lines()).messages


@pytest.mark.parametrize(
    ("kind", "is_copy"), [("azimuth", False), ("slope", False), ("angle", True)]
)
def test_a_direction_and_the_way_back_are_two_things(kind: str, *, is_copy: bool) -> None:
    points = ("A", "B", "C")[: 3 if kind == "angle" else 2]
    known = KnownThings(
        name=("there", "back"),
        kind=(kind, kind),
        points=(points, points[::-1]),
        value=np.array([30.0, 30.0]),
        sigma=np.array([0.1, 0.1]),
        adjust=np.array([True, True]),
        parameters=((), ()),
    )
    found = find_duplicates(photos(), {}, picks(*TWO), lines(), known, is_same=lambda *_: False)

    assert bool(found.known) == is_copy


def test_photo10_is_no_copy_of_photo1() -> None:
    """Their files show the same, as blank ones do, and nothing is picked in both."""
    for other, is_copy in (("photo10.jpg", False), ("photo1 (1).jpg", True)):
        names = ("photo1.jpg", other)
        found = find_duplicates(
            replace(photos(np.nan, np.nan), frame_id=names),
            {name: name for name in names},
            picks(("photo1.jpg", "A", 1, 2), (other, "B", 9, 4)),
            lines(),
            is_same=lambda *_: True,
        )
        assert found.photos == ({other: "photo1.jpg"} if is_copy else {})


def test_copies_with_picks_of_another_photo_are_named_with_the_labels() -> None:
    own = [("a.jpg", "A", 1.0, 2.0), ("a.jpg", "B", 3.0, 4.0), ("a.jpg", "C", 9.0, 9.0)]
    other = [("c.jpg", label, u + 500.0, v) for _, label, u, v in own]
    exchanged = [("b.jpg", label, u + 0.5, v - 1.0) for _, label, u, v in other]
    files = {"a.jpg": "x", "b.jpg": "x", "c.jpg": "y"}

    found = find_duplicates(photos(1.0, 1.0, 2.0), files, picks(*own, *exchanged, *other), lines())

    assert found.contradicting == {"a.jpg": "b.jpg", "b.jpg": "a.jpg"}
    (message,) = found.messages
    assert (message.frames, message.labels) == (("a.jpg", "b.jpg"), ("A", "B", "C"))
    assert "Those in b.jpg are at the places of c.jpg." in message.text
    assert found.reason("a.jpg") == "the same file as b.jpg, which is picked at other places"


@pytest.mark.parametrize(("sigma_px", "contradicts"), [(1.0, True), (4.0, False)])
def test_less_exact_clicks_are_repeats_farther_apart(sigma_px: float, *, contradicts: bool) -> None:
    rows = picks(("a.jpg", "A", 1.0, 2.0), ("b.jpg", "A", 1.0, 16.0))
    files = {"a.jpg": "x", "b.jpg": "x"}

    found = find_duplicates(photos(1.0, 1.0), files, rows, lines(), picks_sigma_px=sigma_px)

    assert bool(found.contradicting) == contradicts
