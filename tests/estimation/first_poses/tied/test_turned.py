"""A camera that hovers only turns: no base, but one pose for all that it sees."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from tied_flights import Conditions, TiedFlight, tied_flight

from uavgram.estimation.first_poses.tied.tied_poses import estimate_tied_poses
from uavgram.estimation.first_poses.tied.two_views import estimate_rotation, transfer_poses
from uavgram.geometry.motion.rotation import exp_so3

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
    one, other = sightings.of_pair(0, 3)

    assert estimate_rotation(sightings.ray[one], sightings.ray[other]) is None


def test_frames_that_share_nothing_stay_without_a_pose(hovering: TiedFlight) -> None:
    rays = hovering.sightings.take(hovering.sightings.frame < 3)
    center, rotation = np.full((4, 3), np.nan), np.full((4, 3, 3), np.nan)
    center[0], rotation[0] = 0.0, np.eye(3)

    center, _ = transfer_poses(center, rotation, rays)

    np.testing.assert_array_equal(np.isfinite(center[:, 0]), [True, True, True, False])
