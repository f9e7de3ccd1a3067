"""Places of texts: rectangles that don't cover each other."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from uavgram.model.arrays import Floats, Ints
from uavgram.stages.products import text_places
from uavgram.stages.products.text_places import ROUNDS, TextPlaces, around, overlaps


def common_area(one: Floats, other: Floats) -> float:
    """OpenCV's area of the intersection."""
    corners = []
    for x, y, width, height, turn in (one, other):
        box = (x, y), (2 * width, 2 * height), float(np.degrees(turn))
        corners.append(cv2.boxPoints(box))
    return float(cv2.intersectConvexConvex(corners[0], corners[1])[0])


def random_places(rng: np.random.Generator, count: int) -> Floats:
    half = rng.uniform(0.1, 1.5, (count, 2))
    return np.column_stack([rng.normal(size=(count, 2)) * 2, half, rng.uniform(-7, 7, count)])


@pytest.mark.parametrize("seed", range(5))
def test_rectangles_overlap_where_opencv_finds_a_common_area(seed: int) -> None:
    places = random_places(np.random.default_rng(seed), 60)
    found = overlaps(places[:30], places[30:])
    area = np.array([[common_area(a, b) for b in places[30:]] for a in places[:30]])

    clear = (area > 1e-4) | (area == 0)
    assert clear.mean() > 0.99
    np.testing.assert_array_equal(found[clear], (area > 0)[clear])
    assert 0.1 < found.mean() < 0.9


def test_texts_around_one_point_stand_beside_each_other() -> None:
    places, half = TextPlaces(), np.array([2.0, 0.5])
    taken = np.array(
        [places.take_near(lambda ring: around(np.zeros(2), half, 0.1, ring)) for _ in range(40)]
    )

    assert not (overlaps(taken, taken) & ~np.eye(40, dtype=bool)).any()
    np.testing.assert_allclose(taken[0, :2], half + 0.1)  # right above
    assert np.linalg.norm(taken[:, :2], axis=1).max() < 25


def test_what_is_reserved_stays_free() -> None:
    places = TextPlaces()
    below = np.array([0.0, -100.0, 100.0, 100.0, 0.0])
    places.reserve(below)
    half = np.array([1.0, 0.5])
    taken = [places.take_near(lambda ring: around(np.zeros(2), half, 0.1, ring)) for _ in range(20)]

    assert not overlaps(np.array(taken), below[None]).any()


def test_a_text_goes_no_farther_out_than_it_must() -> None:
    def candidates(rounds: Ints) -> Floats:
        return np.array([[float(k), 0.0, 0.4, 0.2, 0.0] for k in rounds])

    for first_free in range(ROUNDS):
        places = TextPlaces()
        # From the left up to the last place but one that is to be taken.
        places.reserve(np.array([first_free / 2 - 50.5, 0.0, first_free / 2 + 50.0, 1.0, 0.0]))
        assert places.take_near(candidates)[0] == first_free


@pytest.mark.parametrize("few", [0, 80, 1000])
def test_whoever_looks_only_near_by_takes_the_places_that_are_free_of_all(
    few: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(text_places, "_FEW", few)
    rng = np.random.default_rng(3)
    places = TextPlaces()
    taken = rng.uniform(-400.0, 0.0, (1, 5)) * [1, 1, -1, -1, 0]  # larger than any square
    places.reserve(taken[0])
    for _ in range(300):
        candidates = random_places(rng, 6) * [3, 3, 1, 1, 1] + [*rng.normal(0, 9, 2), 0, 0, 0]
        free = np.flatnonzero(~overlaps(candidates, taken).any(axis=1))
        assert places.take(candidates) == (free[0] if len(free) else None)
        taken = np.concatenate([taken, candidates[free[:1]]])
    assert 100 < len(taken) < 300
