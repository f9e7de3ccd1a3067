"""Which features match: each other's best, like nothing else, and where they are expected."""

from __future__ import annotations

import numpy as np
from tied_photos import flight, photo

from uavgram.imaging.ties.features import Features, find_features
from uavgram.imaging.ties.matching import Guide, compute_photo_similarity, match_features


def drawn(count: int, seed: int = 1) -> Features:
    rng = np.random.default_rng(seed)
    return Features(
        rng.uniform(0.0, 1000.0, (count, 2)),
        np.full(count, 4.0),
        rng.integers(0, 160, (count, 128)).astype(np.uint8),
    )


def test_the_same_features_in_another_order_match() -> None:
    one = drawn(200)
    order = np.random.default_rng(3).permutation(200)

    rows = match_features(one, one.take(order))

    assert len(rows) == 200
    np.testing.assert_array_equal(order[rows[:, 1]], rows[:, 0])


def test_what_stands_twice_matches_nothing() -> None:
    one = drawn(50)
    twice = Features(
        np.vstack([one.pixel_px, one.pixel_px + 100.0]),
        np.full(100, 4.0),
        np.vstack([one.descriptor, one.descriptor]),
    )

    assert len(match_features(one, twice)) == 0


def test_a_place_that_is_described_twice_still_matches() -> None:
    one = drawn(50)
    twice = Features(
        np.vstack([one.pixel_px, one.pixel_px + 0.5]),
        np.full(100, 4.0),
        np.vstack([one.descriptor, one.descriptor]),
    )

    assert len(match_features(one, twice)) == 50


def test_of_two_that_look_alike_the_one_at_the_expected_place_is_taken() -> None:
    one = drawn(50)
    twice = Features(
        np.vstack([one.pixel_px + 100.0, one.pixel_px]),
        np.full(100, 4.0),
        np.vstack([one.descriptor, one.descriptor]),
    )

    rows = match_features(one, twice, Guide(one.pixel_px + 5.0, 20.0))

    assert len(rows) == 50
    np.testing.assert_array_equal(rows[:, 1], rows[:, 0] + 50)


def test_features_that_the_other_photo_should_not_show_are_left_out() -> None:
    one = drawn(50)
    expected = one.pixel_px.copy()
    expected[:20] = np.nan

    rows = match_features(one, one, Guide(expected, 20.0))

    np.testing.assert_array_equal(rows[:, 0], np.arange(20, 50))


def test_photos_of_one_ground_look_more_alike_than_others() -> None:
    poses = flight()
    features = [find_features(photo(poses, k)) for k in (0, 1)]
    features.append(find_features(np.ascontiguousarray(photo(poses, 3)[::-1])))  # a mirror image

    count = compute_photo_similarity(features, range(3))

    np.testing.assert_array_equal(count, count.T)
    assert count[0, 1] > 50
    assert count[0, 2] < 10
