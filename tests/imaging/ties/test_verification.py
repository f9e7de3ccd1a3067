"""Two photos of one rigid scene: what is off its epipolar line goes, and what moved along it."""

from __future__ import annotations

import numpy as np
import pytest

from uavgram.geometry.motion.rotation import exp_so3
from uavgram.imaging.ties.verification import MIN_MATCHES, verify_matches
from uavgram.model.arrays import Floats

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
