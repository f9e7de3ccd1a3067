"""Finds in one photo against each other, by what its pose makes them share."""

from __future__ import annotations

import numpy as np
import pytest

from uavgram.model.arrays import Floats
from uavgram.stages.match import find_contradicted, measure_rotation_rad


def pose_errors(place_px: Floats) -> Floats:
    """(2 n, 3) how places move with a shift of the photo and its turn [px, px, rad]."""
    u, v = place_px[:, 0], place_px[:, 1]
    one, none = np.ones(len(u)), np.zeros(len(u))
    by_u, by_v = np.stack([one, none, -v], axis=1), np.stack([none, one, u], axis=1)
    return np.stack([by_u, by_v], axis=1).reshape(-1, 3)


@pytest.mark.parametrize("wrong", [[], [3], [3, 8], [0, 4, 7]])
def test_look_alikes_far_closer_than_the_prediction_tells_stand_out(wrong: list[int]) -> None:
    rng = np.random.default_rng(len(wrong))
    for _ in range(40):
        place = rng.uniform(-1000, 1000, (12, 2))
        by_pose, sigma = pose_errors(place), np.array([40.0, 40.0, 0.02])
        off = (by_pose @ (sigma * rng.normal(size=3))).reshape(-1, 2) + rng.normal(0, 0.5, (12, 2))
        off[wrong] += rng.choice([-25.0, 25.0], (len(wrong), 2))
        covariance = (by_pose * sigma**2) @ by_pose.T

        found = find_contradicted(off, covariance, np.full(12, 0.6))

        assert np.flatnonzero(found).tolist() == wrong


def test_of_two_that_contradict_each_other_neither_is_believed() -> None:
    place = np.array([[100.0, 0.0], [-100.0, 0.0]])
    by_pose = pose_errors(place)
    covariance = (by_pose * np.array([30.0, 30.0, 0.001]) ** 2) @ by_pose.T

    assert find_contradicted(np.array([[9.0, 0.0], [-9.0, 0]]), covariance, np.full(2, 0.6)).all()
    assert not find_contradicted(
        np.array([[9.0, 0.0], [9.2, 0]]), covariance, np.full(2, 0.6)
    ).any()


def test_nothing_found_contradicts_nothing() -> None:
    assert find_contradicted(np.empty((0, 2)), np.empty((0, 0)), np.empty(0)).shape == (0,)


def test_a_camera_that_looks_as_its_mount_may_err_is_not_called_turned() -> None:
    sigma = np.deg2rad(1.5)
    drawn = sigma * np.random.default_rng(5).standard_normal((20000, 3))
    assert (
        sum(measure_rotation_rad(one, sigma) > 0 for one in drawn) <= 9
    )  # of 20,000 by 1e-4: 2 ± 1.4
    away = np.deg2rad([10.0, -3.0, 2.0])
    assert measure_rotation_rad(away, sigma) == pytest.approx(np.linalg.norm(away))
    assert measure_rotation_rad(away, 3.0 * sigma) == 0.0
