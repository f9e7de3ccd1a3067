"""Whether labels without a height are on the ground, by what the photos show."""

from __future__ import annotations

import numpy as np
import pytest

from uavgram.model.arrays import Floats
from uavgram.stages.match import HeightEvidence, find_raised_labels

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
