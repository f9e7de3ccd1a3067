"""Whether labels without a height are on the ground, by what the photos show."""

from __future__ import annotations

import numpy as np
import pytest

from uavgram.model.arrays import Floats
from uavgram.stages.match import HeightEvidence, find_raised_labels, shows_ground

MISSED = [np.nan, np.nan]
RISE = np.array([60.0, 0.0])


def is_raised(
    off_px: list[list[float]], rise: Floats = RISE, picked: int = 0, odds: float = 1.0
) -> bool:
    """Whether a label is, of differences of which the first ones are picks, sigma 1 px."""
    n = len(off_px)
    evidence = HeightEvidence(
        ("A",) * n,
        np.array(off_px).reshape(n, 2),
        np.tile(np.eye(2), (n, 1, 1)),
        np.tile(rise, (n, 1)),
        np.arange(n) < picked,
    )
    return find_raised_labels(evidence, odds) == {"A"}


def test_a_label_that_many_photos_do_not_show_on_the_ground_may_be_off_it() -> None:
    there = [[0.0, 0.0]]
    assert not is_raised([*3 * there, MISSED])
    assert is_raised([MISSED])
    assert is_raised([*2 * there, *3 * [MISSED]])


def test_one_photo_that_covers_what_another_shows_raises_no_target() -> None:
    assert not is_raised([[0.0, 0.0], MISSED], odds=100.0)
    assert is_raised(4 * [MISSED], odds=100.0)


@pytest.mark.parametrize("off_px", [40.0, 200.0])
def test_a_pick_in_another_photo_decides_where_its_parallax_is_many_sigmas(off_px: float) -> None:
    ground_behind = 3 * [[0.0, 0.0]]
    assert not is_raised([[0.0, 0.0]], picked=1)
    assert not is_raised([[0.0, 0.0], MISSED, MISSED], picked=1)
    assert is_raised([[off_px, 0.0]], picked=1)
    assert is_raised([[off_px, 0.0], *ground_behind], picked=1)


def test_a_pick_with_little_parallax_is_no_proof_of_ground() -> None:
    evidence = HeightEvidence(
        ("A", "A"),
        np.array([[0.0, 0.0], MISSED]),
        np.tile(np.eye(2), (2, 1, 1)),
        np.array([0.002 * RISE, RISE]),
        np.array([True, False]),
    )

    assert find_raised_labels(evidence) == {"A"}


def test_a_search_with_little_parallax_is_no_proof_of_anything() -> None:
    little = 0.0002 * RISE

    assert not is_raised(5 * [[0.0, 0.0]], rise=little, odds=1.01)
    assert is_raised(5 * [[0.0, 0.0]], rise=little, odds=0.9)
    assert not is_raised(5 * [MISSED], rise=little, odds=1.01)


def test_a_corner_in_very_many_photos_is_raised_without_overflow() -> None:
    assert is_raised(40 * [[40.0, 0.0]], picked=40)


def looks_like_ground(counts: list[tuple[int, int]]) -> bool:
    """Whether labels do, from numbers of photos that show them and do not."""
    shown = [
        [place] * count for pair in counts for place, count in zip((0.0, np.nan), pair, strict=True)
    ]
    off = np.array([place for places in shown for place in places])
    label = [str(k) for k, pair in enumerate(counts) for _ in range(sum(pair))]
    n = len(label)
    return shows_ground(
        HeightEvidence(
            tuple(label),
            np.column_stack([off, off]),
            np.tile(np.eye(2), (n, 1, 1)),
            np.tile(RISE, (n, 1)),
            np.zeros(n, np.bool_),
        )
    )


MARKS, CAR = [(3, 0), (3, 0), (1, 2)], [(1, 3), (0, 3), (1, 2), (0, 3), (2, 2)]


@pytest.mark.parametrize("cars", [0, 1, 3])
def test_two_marks_that_most_photos_show_are_ground_beside_any_number_of_cars(cars: int) -> None:
    assert looks_like_ground(MARKS + cars * CAR)


@pytest.mark.parametrize("cars", [1, 3])
def test_labels_that_most_photos_show_elsewhere_are_no_ground(cars: int) -> None:
    assert not looks_like_ground(cars * CAR)


def test_the_fewer_labels_the_sooner_none_is_on_the_ground() -> None:
    assert not looks_like_ground([(3, 2)])
    assert looks_like_ground([(1, 0), (2, 3), (2, 1), (0, 5), (0, 3)])
