"""Which photos overlap, and where one shows what another does."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace

import numpy as np
import pytest
from tied_photos import CAMERA, DOWN, FOCAL_PX, flight

from uavgram.model.arrays import Floats, Ints
from uavgram.model.frames import Poses
from uavgram.model.survey import NO_TIES, TiePicks
from uavgram.stages.tie import (
    MAX_PICK_DISTANCE_SHARE,
    MAX_SIGHTINGS,
    NOISY_SIZE_PX,
    POINTS_BESIDE_PICK,
    SUFFICIENT_SIGHTINGS,
    WANTED_COMMON_POINTS,
    Matches,
    Seen,
    Sighted,
    Tracks,
    choose,
    choose_pairs,
    compute_overlap,
    compute_relative_noise,
    estimate_sigmas,
    join_tracks,
    mark_fitting_matches,
    predict,
    report_ties,
)


def row_of(east_m: Floats) -> Seen:
    """Cameras 30 m above the ground, looking straight down: 31 m by 23 m of it."""
    count = len(east_m)
    poses = Poses(
        frame_id=tuple(f"p{k}" for k in range(count)),
        center_world_m=np.column_stack([east_m, np.zeros(count), np.full(count, 30.0)]),
        world_from_camera=np.tile(DOWN, (count, 1, 1)),
        covariance=np.tile(np.diag([0.25] * 3 + [1e-4] * 3), (count, 1, 1)),
    )
    return Seen(calibration=CAMERA, poses=poses, ground_m=0.0, ground_sigma_m=0.3)


def test_the_share_is_that_of_the_rectangles() -> None:
    width_m = 640 / FOCAL_PX * 30.0
    share = compute_overlap(row_of(np.array([0.0, width_m / 2, 2 * width_m])))

    assert share[0, 1] == pytest.approx(0.5, abs=0.07)  # the grid's eighth
    assert share[0, 2] == 0.0
    np.testing.assert_array_equal(share, share.T)
    np.testing.assert_array_equal(np.diag(share), 0.0)


def test_a_photo_of_the_sky_overlaps_none() -> None:
    seen = row_of(np.array([0.0, 5.0]))
    up = np.array([DOWN, np.eye(3)])

    share = compute_overlap(replace(seen, poses=replace(seen.poses, world_from_camera=up)))

    np.testing.assert_array_equal(share, 0.0)


def test_a_place_is_predicted_where_it_is_shown() -> None:
    poses = flight()
    seen = Seen(calibration=CAMERA, poses=poses, ground_m=0.0, ground_sigma_m=0.3)
    ground = np.array([[0.0, 0.0, 0.0], [3.0, -4.0, 0.0]])

    found = predict(seen, 0, 4, seen.pixels_of(0, ground))

    assert found is not None
    np.testing.assert_allclose(found.pixel_px, seen.pixels_of(4, ground), atol=1e-6)
    # 0.5 m of each, 0.01 rad of each, and 1.5 m of ground over a base of 14 m: 3.5 sigmas
    variance = 2 * 0.01**2 + (2 * 0.25 + 0.05**2 * (12.5**2 + 6**2 + 1)) / 30**2
    assert found.radius_px == pytest.approx(3.5 * FOCAL_PX * np.sqrt(variance), rel=1e-3)


def test_poses_that_say_little_predict_nothing() -> None:
    poses = flight(sigma_rad=0.3)
    seen = Seen(calibration=CAMERA, poses=poses, ground_m=0.0, ground_sigma_m=0.3)

    assert seen.is_vague.all()
    assert not replace(seen, poses=flight()).is_vague.any()
    assert predict(seen, 0, 1, np.array([[320.0, 240.0]])) is None


def test_each_photo_is_compared_with_those_it_shares_most_with() -> None:
    score = np.array([[0, 9, 5, 1], [9, 0, 6, 2], [5, 6, 0, 3], [1, 2, 3, 0]]) / 10.0

    assert choose_pairs(score, 0.05, most=1).tolist() == [[0, 1], [1, 2], [2, 3]]
    assert choose_pairs(score, 0.55, most=3).tolist() == [[0, 1], [1, 2]]


# Matches of pairs become points over all photos, and their noise is learnt from them.


def matches(*pairs: tuple[int, int]) -> Matches:
    return Matches(
        np.array(pairs).reshape(-1, 2), np.zeros(len(pairs), np.int64), np.zeros(len(pairs))
    )


def test_matches_are_joined_through_each_other() -> None:
    photo = np.array([0, 1, 2, 0, 1])

    tracks = join_tracks(matches((0, 1), (1, 2), (3, 4)), photo)

    np.testing.assert_array_equal(tracks.point, [0, 0, 0, 1, 1])
    np.testing.assert_array_equal(tracks.feature, [0, 1, 2, 3, 4])


def test_a_sighting_that_hangs_by_a_thread_goes() -> None:
    # 0 to 3 are matched with each other; 4 with one of them only
    all_with_all = [(0, 1), (0, 2), (0, 3), (1, 2), (1, 3), (2, 3)]

    tracks = join_tracks(matches(*all_with_all, (3, 4)), np.arange(5))

    np.testing.assert_array_equal(tracks.feature, [0, 1, 2, 3])


def test_a_point_that_a_photo_would_show_twice_goes() -> None:
    photo = np.array([0, 1, 2, 0, 1, 0, 2])

    # 0-1-2-3: photo 0 twice; 4-6 stays
    tracks = join_tracks(matches((0, 1), (1, 2), (2, 3), (4, 6)), photo)

    np.testing.assert_array_equal(tracks.feature, [4, 6])
    np.testing.assert_array_equal(tracks.point, [0, 0])


def test_without_matches_there_are_no_points() -> None:
    assert len(join_tracks(matches(), np.array([0, 1])).point) == 0


def test_sigmas_come_back_from_the_distances_they_made() -> None:
    # two pairs of photos with noise of their own, features of all sizes
    rng = np.random.default_rng(6)
    count = 4000
    feature = np.arange(2 * count).reshape(2, count).T
    pair = np.repeat([0, 1], count // 2)
    relative = compute_relative_noise(rng.uniform(1.0, 3.0 * NOISY_SIZE_PX, 2 * count), 1.0)
    true = np.where(pair == 0, 0.1, 0.25)
    spread = true * np.sqrt((relative[feature] ** 2).sum(axis=1))
    found = Matches(feature, pair, rng.normal(0.0, spread))

    sigma = estimate_sigmas(found, relative, 2, 1.0)

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

    good = mark_fitting_matches(found, np.ones(400), 1)

    assert not good[::20].any()
    assert np.delete(good, np.arange(0, 200, 20)).mean() > 0.98


def test_features_of_whole_trees_are_no_points() -> None:
    found = Matches(np.array([[0, 1], [2, 3]]), np.zeros(2, np.int64), np.array([0.1, 0.1]))

    good = mark_fitting_matches(
        found, compute_relative_noise(np.array([3.0, 3.0, 3.0, 80.0]), 1.0), 1
    )

    assert good.tolist() == [True, False]


def test_of_features_in_two_pairs_the_sigma_lies_between() -> None:
    found = Matches(
        np.array([[0, 1], [0, 2]]), np.array([0, 1]), np.array([0.1, 0.3]) * np.sqrt(2.0)
    )

    sigma = estimate_sigmas(found, np.ones(4), 2, 1.0)

    assert sigma[0] == pytest.approx(np.sqrt((0.01 + 0.09) / 2))
    assert sigma[1] == pytest.approx(0.1)
    assert sigma[2] == pytest.approx(0.3)
    assert np.isnan(sigma[3])


# Which tie points are kept: few in each photo, spread, long, and each pair of photos has some.


SIZE = 1000, 800


def sighted(point: Ints, photo: Ints, pixel: Floats, sigma: Floats | None = None) -> Sighted:
    return Sighted(
        tracks=Tracks(point, np.arange(len(point))),
        photo=photo,
        pixel_px=pixel,
        sigma_px=np.full(len(point), 0.1) if sigma is None else sigma,
        width_px=SIZE[0],
        height_px=SIZE[1],
    )


def many(points: int, photos: int, seed: int = 0) -> Sighted:
    """Points that each photo shows, at places of its own."""
    rng = np.random.default_rng(seed)
    return sighted(
        np.repeat(np.arange(points), photos),
        np.tile(np.arange(photos), points),
        rng.uniform(0.0, SIZE, (points * photos, 2)),
    )


def test_thousands_become_a_hundred_in_each_photo_spread_over_it() -> None:
    everything = many(3000, 3)

    kept = np.isin(everything.tracks.point, choose(everything))

    for photo in range(3):
        pixel = everything.pixel_px[kept & (everything.photo == photo)]
        assert SUFFICIENT_SIGHTINGS <= len(pixel) <= MAX_SIGHTINGS + 1
        quarters = Counter(map(tuple, (pixel // (500, 400)).astype(int).tolist()))
        assert len(quarters) == 4
        assert min(quarters.values()) >= 12


def test_long_ones_go_first_and_the_better_of_equally_long_ones() -> None:
    # all at one place of each photo: 0 is long, 1 and 2 are short and 2 is the better
    point = np.array([0, 0, 0, 1, 1, 2, 2])
    photo = np.array([0, 1, 2, 0, 1, 3, 4])
    near = sighted(point, photo, np.full((7, 2), 500.0))
    other = sighted(
        np.array([0, 0, 1, 1]),
        np.array([0, 1, 0, 1]),
        np.full((4, 2), 500.0),
        np.array([0.3, 0.3, 0.1, 0.1]),
    )

    assert choose(near).tolist() == [0, 2]
    assert choose(other).tolist() == [1]


def test_a_pair_with_little_in_common_gets_more() -> None:
    # photos 0 and 1 share a corner of theirs, and have everything with 2 and 3 else
    rng = np.random.default_rng(3)
    full = many(400, 2)
    corner = rng.uniform(0.0, 90.0, (40 * 2, 2))
    point = np.concatenate([full.tracks.point, 400 + np.repeat(np.arange(40), 2)])
    photo = np.concatenate([2 * full.photo, np.tile([0, 1], 40)])

    kept = choose(sighted(point, photo, np.vstack([full.pixel_px, corner])))

    assert (kept >= 400).sum() >= WANTED_COMMON_POINTS


def test_nothing_is_chosen_of_nothing() -> None:
    empty = np.empty(0, np.int64)

    assert len(choose(sighted(empty, empty, np.empty((0, 2))))) == 0


def test_around_picks_more_are_kept_that_several_photos_show() -> None:
    rng = np.random.default_rng(3)
    place = rng.uniform(0.0, SIZE, (3000, 2))
    long = np.arange(3000) % 4 > 0  # the others are seen twice, and nearer to the picks
    seen = np.repeat(np.arange(3000), np.where(long, 3, 2))
    photo = np.concatenate([np.arange(3 if three else 2) for three in long])
    picked = np.array([[300.0, 200.0], [700.0, 600.0], [10.0, 790.0]])
    place[::150] = picked[0] + rng.uniform(-9.0, 9.0, (20, 2))
    everything = sighted(seen, photo, place[seen])
    asked = replace(everything, picked_photo=np.array([0, 0, 2]), picked_px=picked)

    before, after = (set(choose(each).tolist()) for each in (everything, asked))

    assert before < after
    added = np.array(sorted(after - before))
    away = np.linalg.norm(place[added][:, None] - picked, axis=2).min(axis=1)
    assert away.max() <= MAX_PICK_DISTANCE_SHARE * SIZE[0]
    assert long[added].all()
    for one in picked[:2]:
        near = [
            k
            for k in after
            if np.linalg.norm(place[k] - one) <= MAX_PICK_DISTANCE_SHARE * SIZE[0] and long[k]
        ]
        assert len(near) >= POINTS_BESIDE_PICK


# What is said of tie points: how many, which photos they miss, which hang apart.


def ties(*pairs: tuple[str, str]) -> TiePicks:
    """One tie point for each pair of photos."""
    image = tuple(name for pair in pairs for name in pair)
    return TiePicks(
        image=image,
        tie=tuple(f"t{k // 2}" for k in range(len(image))),
        pixel_px=np.zeros((len(image), 2)),
        sigma_px=np.full(len(image), 0.1),
    )


def test_all_photos_in_one_group_need_one_sentence() -> None:
    (message,) = report_ties(ties(("a", "b"), ("b", "c"), ("a", "b")), ["a", "b", "c"], "ties.csv")

    assert message.code == "ties-found"
    assert "3 tie points were found in 3 of 3 photos, 1 to 3 in each: ties.csv" in message.text


def test_a_photo_that_nothing_ties_is_named() -> None:
    _, message = report_ties(ties(("a", "b")), ["a", "b", "c"], "ties.csv")

    assert message.code == "photo-untied"
    assert message.frames == ("c",)


def test_groups_that_nothing_joins_are_told() -> None:
    pairs = [("a", "b"), ("b", "c"), ("d", "e")]

    _, message = report_ties(ties(*pairs), list("abcde"), "ties.csv")

    assert message.code == "ties-apart"
    assert message.frames == ("d", "e")
    assert "2 groups" in message.text


def test_no_tie_point_at_all_is_a_warning() -> None:
    (message,) = report_ties(NO_TIES, ["a", "b"], "ties.csv")

    assert (message.code, message.level) == ("ties-none", "warning")
