"""Two views and three points, against OpenCV and the truth."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest
from tied_flights import Conditions, TiedFlight, tied_flight

from uavgram.estimation.first_poses.tied.tied_poses import estimate_tied_poses, resect_photo
from uavgram.estimation.first_poses.tied.two_views import (
    compute_epipolar_angles,
    compute_essential_matrices,
    decompose_essential,
    estimate_relative_poses,
    estimate_rotation,
    solve_three_points,
    transfer_poses,
)
from uavgram.geometry.motion.rotation import exp_so3, hat
from uavgram.model.arrays import Floats


def unit(rows: Floats) -> Floats:
    """Rows of length one."""
    return np.asarray(rows / np.linalg.norm(rows, axis=1)[:, None])


def two_views(
    seed: int, count: int = 60, relief: float = 1.0
) -> tuple[Floats, Floats, Floats, Floats]:
    """Rays (n, 3), (n, 3) to the same points, the rotation and the unit shift between them."""
    rng = np.random.default_rng(seed)
    point = np.column_stack([rng.uniform(-4, 4, (count, 2)), 8 + relief * rng.normal(size=count)])
    rotation = exp_so3(rng.normal(0, 0.15, 3))
    shift = unit(rng.normal(size=(1, 3)) * [[1, 1, 0.2]])[0]
    return unit(point), unit(point @ rotation.T + 2.0 * shift), rotation, shift


@pytest.mark.parametrize("seed", range(5))
def test_five_exact_rays_have_the_true_matrix_among_their_own(seed: int) -> None:
    first, second, rotation, shift = two_views(seed, count=5)
    true = hat(shift) @ rotation
    found = compute_essential_matrices(first[None], second[None])
    assert np.abs(np.abs(np.einsum("mij,ij->m", found, true)) / 2.0).max() > 1 - 1e-9
    # Each is an essential matrix: two equal singular values and a zero.
    values = np.linalg.svd(found, compute_uv=False)
    np.testing.assert_allclose(values, np.tile([1.0, 1.0, 0.0], (len(found), 1)), atol=1e-6)
    assert np.abs(compute_epipolar_angles(found, first, second)).max() < 1e-7


def test_the_four_poses_are_those_of_opencv() -> None:
    *_, rotation, shift = two_views(3)
    essential = hat(shift) @ rotation
    one, other, theirs = cv2.decomposeEssentialMat(essential)
    turns, shifts = decompose_essential(essential)
    for turn in (one, other):
        assert np.abs(turns - turn).max(axis=(1, 2)).min() < 1e-9
    np.testing.assert_allclose(np.abs(shifts @ theirs.ravel()), 1.0, atol=1e-9)
    errors = np.abs(turns - rotation).max(axis=(1, 2)) + np.abs(shifts - shift).max(axis=1)
    assert errors.min() < 1e-9


@pytest.mark.parametrize("relief", [1.0, 0.0])
def test_a_pose_among_wrong_ties_and_points_in_a_plane(relief: float) -> None:
    """With all points in a plane the true pose is one of those that are kept."""
    first, second, rotation, shift = two_views(7, count=120, relief=relief)
    rng = np.random.default_rng(1)
    second[:20] = unit(rng.normal(size=(20, 3)) * 0.3 + [0, 0, 1])
    poses = estimate_relative_poses(first, second, rng)
    errors = [np.abs(p.rotation - rotation).max() + np.abs(p.shift - shift).max() for p in poses]
    assert min(errors) < 1e-6
    assert len(poses) <= 4


@pytest.mark.parametrize("seed", range(5))
def test_three_points_place_a_camera(seed: int) -> None:
    rng = np.random.default_rng(seed)
    world = rng.normal(size=(3, 3)) * 3
    rotation = exp_so3(rng.normal(size=3))
    center = rotation @ np.array([0.3, -0.2, -9.0])
    ray = unit((world - center) @ rotation)
    centers, rotations = solve_three_points(world[None], ray[None])
    errors = np.abs(centers - center).max(axis=1) + np.abs(rotations - rotation).max(axis=(1, 2))
    assert errors.min() < 1e-6
    for c, r in zip(centers, rotations, strict=True):  # all of them show the points so
        np.testing.assert_allclose(unit((world - c) @ r), ray, atol=1e-6)


def test_a_camera_is_placed_though_a_third_of_its_points_are_wrong() -> None:
    rng = np.random.default_rng(2)
    world = np.column_stack([rng.uniform(-20, 20, (90, 2)), np.zeros(90)])
    rotation = exp_so3(np.array([np.pi, 0.2, 0.1]))
    center = np.array([2.0, -3.0, 30.0])
    ray = unit((world - center) @ rotation)
    ray[:30] = unit(ray[:30] + rng.normal(0, 0.2, (30, 3)))
    found = resect_photo(world, ray, rng)
    assert found is not None
    np.testing.assert_allclose(found[0], center, atol=1e-6)
    np.testing.assert_allclose(found[1], rotation, atol=1e-7)


# Rotation of a hovering camera: two views without a base.


NOISE_RAD = 1e-4


@pytest.fixture(scope="module")
def hovering() -> TiedFlight:
    """Four frames from one place, turned by some degrees, one ray in fifty wrong."""
    rng = np.random.default_rng(3)
    seen = tied_flight(Conditions(plan="strip", photos=2, seed=1, wrong=0.0))
    first = seen.sightings.take(seen.sightings.frame == 0)
    turns = exp_so3(rng.normal(0.0, 0.05, (4, 3)))
    points = len(first.ray)
    ray = np.einsum("fji,nj->fni", turns, first.ray).reshape(-1, 3)
    ray = ray + rng.normal(0.0, NOISE_RAD, ray.shape)
    wrong = rng.random(len(ray)) < 0.02
    ray[wrong] += rng.normal(0.0, 0.05, (int(wrong.sum()), 3))
    rays = replace(
        seen.sightings,
        frame=np.repeat(np.arange(4), points),
        point=np.tile(np.arange(points), 4),
        ray=ray / np.linalg.norm(ray, axis=1)[:, None],
        sigma_rad=np.full(len(ray), NOISE_RAD),
        frames=4,
        points=points,
    )
    return replace(seen, rotation=turns, sightings=rays, wrong=wrong)


def test_frames_that_only_turned_have_the_place_of_the_one_that_is_known(
    hovering: TiedFlight,
) -> None:
    center, rotation = np.full((4, 3), np.nan), np.full((4, 3, 3), np.nan)
    center[2], rotation[2] = [3.0, 4.0, 50.0], hovering.rotation[2]

    center, rotation = transfer_poses(center, rotation, hovering.sightings)

    np.testing.assert_array_equal(center, np.tile([3.0, 4.0, 50.0], (4, 1)))
    # Some hundred rays, and at most two turns from the one that is known.
    np.testing.assert_allclose(rotation, hovering.rotation, atol=2 * NOISE_RAD)


def test_no_base_is_made_of_the_noise_of_a_camera_that_hovers(hovering: TiedFlight) -> None:
    assert estimate_tied_poses(hovering.sightings) is None


def test_cameras_far_apart_have_no_turn_in_common() -> None:
    sightings = tied_flight(Conditions(photos=4, tilt_deg=40.0, seed=2)).sightings
    one, other = sightings.find_shared_rows(0, 3)

    assert estimate_rotation(sightings.ray[one], sightings.ray[other]) is None


def test_frames_that_share_nothing_stay_without_a_pose(hovering: TiedFlight) -> None:
    rays = hovering.sightings.take(hovering.sightings.frame < 3)
    center, rotation = np.full((4, 3), np.nan), np.full((4, 3, 3), np.nan)
    center[0], rotation[0] = 0.0, np.eye(3)

    center, _ = transfer_poses(center, rotation, rays)

    np.testing.assert_array_equal(np.isfinite(center[:, 0]), [True, True, True, False])
