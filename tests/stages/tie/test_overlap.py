"""Which photos overlap, and where one shows what another does."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from tied_photos import CAMERA, DOWN, FOCAL_PX, flight

from uavgram.model.arrays import Floats
from uavgram.model.frames import Poses
from uavgram.stages.tie.overlap import Seen, overlap, pairs_of, predict


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
    share = overlap(row_of(np.array([0.0, width_m / 2, 2 * width_m])))

    assert share[0, 1] == pytest.approx(0.5, abs=0.07)  # the grid's eighth
    assert share[0, 2] == 0.0
    np.testing.assert_array_equal(share, share.T)
    np.testing.assert_array_equal(np.diag(share), 0.0)


def test_a_photo_of_the_sky_overlaps_none() -> None:
    seen = row_of(np.array([0.0, 5.0]))
    up = np.array([DOWN, np.eye(3)])

    share = overlap(replace(seen, poses=replace(seen.poses, world_from_camera=up)))

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

    assert pairs_of(score, 0.05, most=1).tolist() == [[0, 1], [1, 2], [2, 3]]
    assert pairs_of(score, 0.55, most=3).tolist() == [[0, 1], [1, 2]]
