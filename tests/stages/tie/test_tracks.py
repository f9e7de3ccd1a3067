"""Matches of pairs become points over all photos, and their noise is learnt from them."""

from __future__ import annotations

import numpy as np
import pytest

from uavgram.stages.tie.tracks import LARGE, Matches, fitting, relative_noise, sigmas, tracks_of


def matches(*pairs: tuple[int, int]) -> Matches:
    return Matches(
        np.array(pairs).reshape(-1, 2), np.zeros(len(pairs), np.int64), np.zeros(len(pairs))
    )


def test_matches_are_joined_through_each_other() -> None:
    photo = np.array([0, 1, 2, 0, 1])

    tracks = tracks_of(matches((0, 1), (1, 2), (3, 4)), photo)

    np.testing.assert_array_equal(tracks.point, [0, 0, 0, 1, 1])
    np.testing.assert_array_equal(tracks.feature, [0, 1, 2, 3, 4])


def test_a_sighting_that_hangs_by_a_thread_goes() -> None:
    # 0 to 3 are matched with each other; 4 with one of them only
    all_with_all = [(0, 1), (0, 2), (0, 3), (1, 2), (1, 3), (2, 3)]

    tracks = tracks_of(matches(*all_with_all, (3, 4)), np.arange(5))

    np.testing.assert_array_equal(tracks.feature, [0, 1, 2, 3])


def test_a_point_that_a_photo_would_show_twice_goes() -> None:
    photo = np.array([0, 1, 2, 0, 1, 0, 2])

    # 0-1-2-3: photo 0 twice; 4-6 stays
    tracks = tracks_of(matches((0, 1), (1, 2), (2, 3), (4, 6)), photo)

    np.testing.assert_array_equal(tracks.feature, [4, 6])
    np.testing.assert_array_equal(tracks.point, [0, 0])


def test_without_matches_there_are_no_points() -> None:
    assert len(tracks_of(matches(), np.array([0, 1])).point) == 0


def test_sigmas_come_back_from_the_distances_they_made() -> None:
    # two pairs of photos with noise of their own, features of all sizes
    rng = np.random.default_rng(6)
    count = 4000
    feature = np.arange(2 * count).reshape(2, count).T
    pair = np.repeat([0, 1], count // 2)
    relative = relative_noise(rng.uniform(1.0, 3.0 * LARGE, 2 * count), 1.0)
    true = np.where(pair == 0, 0.1, 0.25)
    spread = true * np.sqrt((relative[feature] ** 2).sum(axis=1))
    found = Matches(feature, pair, rng.normal(0.0, spread))

    sigma = sigmas(found, relative, 2, 1.0)

    for which, value in enumerate((0.1, 0.25)):
        rows = feature[pair == which].ravel()
        # chi-square of 2000: 1.6 % of sigma, four times that
        np.testing.assert_allclose(sigma[rows] / relative[rows], value, rtol=0.065)


def test_what_stands_out_of_its_pair_goes() -> None:
    rng = np.random.default_rng(7)
    feature = np.arange(400).reshape(2, 200).T
    across = rng.normal(0.0, 0.1, 200)
    across[::20] = 2.0
    found = Matches(feature, np.zeros(200, np.int64), across)

    good = fitting(found, np.ones(400), 1)

    assert not good[::20].any()
    assert np.delete(good, np.arange(0, 200, 20)).mean() > 0.98


def test_features_of_whole_trees_are_no_points() -> None:
    found = Matches(np.array([[0, 1], [2, 3]]), np.zeros(2, np.int64), np.array([0.1, 0.1]))

    good = fitting(found, relative_noise(np.array([3.0, 3.0, 3.0, 80.0]), 1.0), 1)

    assert good.tolist() == [True, False]


def test_of_features_in_two_pairs_the_sigma_lies_between() -> None:
    found = Matches(
        np.array([[0, 1], [0, 2]]), np.array([0, 1]), np.array([0.1, 0.3]) * np.sqrt(2.0)
    )

    sigma = sigmas(found, np.ones(4), 2, 1.0)

    assert sigma[0] == pytest.approx(np.sqrt((0.01 + 0.09) / 2))
    assert sigma[1] == pytest.approx(0.1)
    assert sigma[2] == pytest.approx(0.3)
    assert np.isnan(sigma[3])
