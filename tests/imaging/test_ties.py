"""Features of photos: where they are, that they are spread, and what is no photo."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest
from tied_photos import HEIGHT_PX, WIDTH_PX, flight, photo

from uavgram.errors import InputError
from uavgram.geometry.motion.rotation import exp_so3
from uavgram.imaging.ties import (
    MAX_FEATURES,
    MIN_MATCHES,
    WORKING_PX,
    Features,
    Guide,
    compute_photo_similarity,
    find_features,
    match_features,
    read_features,
    verify_matches,
)
from uavgram.model.arrays import Floats


def test_a_photo_turned_by_half_a_turn_has_its_features_at_the_turned_places() -> None:
    # OpenCV's SIFT has its places a quarter of a pixel off, if nobody asks it not to
    upright = photo(flight(), 0)
    one, other = find_features(upright), find_features(np.ascontiguousarray(upright[::-1, ::-1]))
    rows = match_features(one, other)
    turned = np.array([WIDTH_PX - 1, HEIGHT_PX - 1]) - other.pixel_px[rows[:, 1]]
    off = one.pixel_px[rows[:, 0]] - turned

    assert len(rows) > 300
    np.testing.assert_allclose(np.median(off, axis=0), 0.0, atol=0.02)
    assert np.median(np.abs(off)) < 0.05


def test_a_reduced_photo_has_its_features_where_the_original_has_them() -> None:
    small = photo(flight(), 0)
    large = cv2.resize(small, None, fx=4.0, fy=4.0, interpolation=cv2.INTER_CUBIC)
    one, other = find_features(small), find_features(np.asarray(large, np.uint8))
    rows = match_features(one, other)
    off = other.pixel_px[rows[:, 1]] - ((one.pixel_px[rows[:, 0]] + 0.5) * 4.0 - 0.5)

    assert max(large.shape) > WORKING_PX
    assert len(rows) > 200
    np.testing.assert_allclose(np.median(off, axis=0), 0.0, atol=0.1)
    assert np.median(one.size_px[rows[:, 0]] * 4.0 / other.size_px[rows[:, 1]]) == pytest.approx(
        1.0, abs=0.1
    )


def test_jpegs_that_are_decoded_at_half_size_have_them_there_too(tmp_path: Path) -> None:
    small = photo(flight(), 0)
    large = cv2.resize(small, None, fx=6.0, fy=6.0, interpolation=cv2.INTER_CUBIC)
    cv2.imwrite(str(tmp_path / "large.jpg"), large, [cv2.IMWRITE_JPEG_QUALITY, 95])
    one, other = find_features(small), read_features(tmp_path / "large.jpg")
    rows = match_features(one, other)
    off = other.pixel_px[rows[:, 1]] - ((one.pixel_px[rows[:, 0]] + 0.5) * 6.0 - 0.5)

    assert len(rows) > 200
    np.testing.assert_allclose(np.median(off, axis=0), 0.0, atol=0.15)


def test_strong_texture_in_one_corner_leaves_features_for_the_rest() -> None:
    weak = 120.0 + (photo(flight(), 0).astype(np.float64) - 120.0) * 0.5
    weak[:160, :200] = photo(flight(), 1)[:160, :200]
    grey = cv2.resize(np.clip(weak, 0, 255).astype(np.uint8), None, fx=2.5, fy=2.5)
    found = find_features(np.asarray(grey, np.uint8))
    in_corner = ((found.pixel_px < [500, 400]).all(axis=1)).mean()

    assert len(found.pixel_px) <= MAX_FEATURES
    assert in_corner < 0.25


def test_an_even_photo_has_none_and_is_no_mistake() -> None:
    found = find_features(np.full((120, 160), 90, np.uint8))

    assert found.pixel_px.shape == (0, 2)
    assert len(match_features(found, found)) == 0


def test_what_is_no_photo_is_named(tmp_path: Path) -> None:
    (tmp_path / "x.jpg").write_bytes(b"no photo")

    with pytest.raises(InputError, match=r"x\.jpg: is no photo that can be decoded"):
        read_features(tmp_path / "x.jpg")


# Which features match: each other's best, like nothing else, and where they are expected.


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


# Two photos of one rigid scene: what is off its epipolar line goes, and what moved along it.


FOCAL_PX = 1000.0
BASE_M, HEIGHT_M = 12.0, 50.0


def scene(count: int, noise_px: float = 0.15) -> tuple[Floats, Floats, Floats]:
    """(M, 3) points over a wavy ground, 0.3 m, and their rays in two cameras 12 m apart."""
    rng = np.random.default_rng(4)
    place = rng.uniform([-15.0, -20.0], [27.0, 20.0], (count, 2))
    wave = 0.3 * np.sin(place[:, 0] / 6.0) * np.cos(place[:, 1] / 8.0)
    world = np.column_stack([place, HEIGHT_M + wave])
    return world, _seen(world, noise_px, rng)[0], _seen(world, noise_px, rng)[1]


def _seen(world: Floats, noise_px: float, rng: np.random.Generator) -> tuple[Floats, Floats]:
    turn = exp_so3(np.array([0.03, -0.04, 0.1]))
    rays = []
    for center, rotation in ((np.zeros(3), np.eye(3)), (np.array([BASE_M, 0.0, 0.0]), turn)):
        camera = (world - center) @ rotation
        plane = camera[:, :2] / camera[:, 2:] + rng.normal(
            0.0, noise_px / FOCAL_PX, (len(world), 2)
        )
        rays.append(np.column_stack([plane, np.ones(len(world))]))
    return rays[0], rays[1]


def test_a_scene_that_stands_still_passes_and_its_noise_is_told() -> None:
    _, one, other = scene(600)

    tested = verify_matches(one, other, FOCAL_PX, 1.0)

    assert tested.good.mean() > 0.98
    across = tested.across_px[tested.good]
    assert np.isnan(tested.across_px[~tested.good]).all()
    # two places of 0.15 px each; 599 degrees of freedom, 3 % for the neighbours' medians
    assert np.sqrt((across**2).mean()) == pytest.approx(0.15 * np.sqrt(2), rel=0.12)


def test_wrong_matches_go() -> None:
    _, one, other = scene(600)
    wrong = np.arange(0, 600, 6)
    other[wrong, :2] += np.random.default_rng(5).uniform(-0.3, 0.3, (100, 2))
    moved = np.linalg.norm(other[wrong, :2] - scene(600)[2][wrong, :2], axis=1) * FOCAL_PX > 20.0

    tested = verify_matches(one, other, FOCAL_PX, 1.0)

    assert not tested.good[wrong[moved]].any()
    assert np.delete(tested.good, wrong).mean() > 0.97


def test_a_car_that_drives_along_the_base_goes_though_its_rays_meet_it() -> None:
    world, one, other = scene(600)
    middle = np.array([5.0, 2.0])
    car = np.argsort(np.linalg.norm(world[:, :2] - middle, axis=1))[:6]
    drove = world[car] + [1.5, 0.0, 0.0]  # along the base: as if it were 7 m deeper
    other[car] = _seen(drove, 0.15, np.random.default_rng(7))[1]

    tested = verify_matches(one, other, FOCAL_PX, 1.0)

    assert not tested.good[car].any()
    assert np.delete(tested.good, car).mean() > 0.97


def test_what_is_a_few_pixels_off_its_line_goes() -> None:
    _, one, other = scene(600)
    off = np.arange(0, 600, 12)
    other[off, 1] += 3.8 / FOCAL_PX  # less than relief may do along it

    tested = verify_matches(one, other, FOCAL_PX, 1.0)

    assert tested.good[off].mean() < 0.1
    assert np.delete(tested.good, off).mean() > 0.97


def test_a_shutter_that_bends_the_lines_is_no_reason_and_no_noise() -> None:
    _, one, other = scene(600)
    other[:, 1] += 2.0 / FOCAL_PX * np.sin(2.5 * other[:, 0])

    tested = verify_matches(one, other, FOCAL_PX, 1.0)

    assert tested.good.mean() > 0.9
    across = tested.across_px[tested.good]
    assert 1.4826 * np.median(np.abs(across)) == pytest.approx(0.15 * np.sqrt(2), rel=0.25)


def test_too_few_matches_are_none() -> None:
    _, one, other = scene(MIN_MATCHES - 1)

    assert not verify_matches(one, other, FOCAL_PX, 1.0).good.any()


def test_unrelated_places_are_none() -> None:
    rng = np.random.default_rng(8)
    one, other = (np.column_stack([rng.uniform(-1, 1, (40, 2)), np.ones(40)]) for _ in range(2))

    assert verify_matches(one, other, FOCAL_PX, 1.0).good.sum() == 0


def test_places_without_rays_are_not_good() -> None:
    _, one, other = scene(200)
    one[:5] = np.nan

    tested = verify_matches(one, other, FOCAL_PX, 1.0)

    assert not tested.good[:5].any()
    assert tested.good[5:].mean() > 0.95


def test_places_all_in_line_fail_nothing() -> None:
    line = np.column_stack([np.linspace(-0.5, 0.5, 60), np.zeros(60), np.ones(60)])

    assert verify_matches(line, line + np.array([0.01, 0.0, 0.0]), FOCAL_PX, 1.0).good.shape == (
        60,
    )
