"""Covariances within the survey: what all points share is taken out."""

from __future__ import annotations

import numpy as np
import pytest
from off_ground import with_third_coordinates
from scenes import make_scene
from scipy.spatial.transform import Rotation

from uavgram.estimation.survey.adjustment import Adjustment
from uavgram.model.arrays import Floats
from uavgram.model.options import SolveOptions
from uavgram.stages.refine import refine


def test_relative_covariance_equals_the_s_transformed_joint_covariance() -> None:
    adjustment = refine(make_scene(2, roughness=0.05).survey, SolveOptions())[0].adjustment
    count = len(adjustment.survey.label)
    position, joint = adjustment.joint_points(np.arange(count))
    planar = np.concatenate([[3 * k, 3 * k + 1] for k in range(count)])
    free = np.zeros((2 * count, 3))
    free[::2, 0] = free[1::2, 1] = 1.0
    free[::2, 2], free[1::2, 2] = -position[:, 1], position[:, 0]
    projector = np.eye(2 * count) - free @ np.linalg.pinv(free)
    expected = projector @ joint[np.ix_(planar, planar)] @ projector.T

    relative = adjustment.relative_points()
    for k in range(count):
        block = expected[2 * k : 2 * k + 2, 2 * k : 2 * k + 2]
        np.testing.assert_allclose(relative[k], block, rtol=1e-6, atol=1e-12)


def test_a_bias_of_the_flight_does_not_show_within_the_survey() -> None:
    adjustment = refine(make_scene(2).survey, SolveOptions())[0].adjustment
    _, absolute = adjustment.points()
    relative = adjustment.relative_points()

    assert np.sqrt(absolute[:, 0, 0]).min() > 0.5
    assert np.sqrt(relative[:, 0, 0]).max() < 0.1
    assert np.linalg.eigvalsh(relative).min() > 0


@pytest.fixture(scope="module")
def in_space() -> Adjustment:
    """Two points whose heights are to be found, one whose height was stated."""
    heights = {0: 1.4, 3: 2.0, 5: 0.8}
    scene = make_scene(2, heights=heights)
    scene = with_third_coordinates(scene, free=(0, 3), stated={5: 0.05})
    return refine(scene.survey, SolveOptions())[0].adjustment


def rigid(position: Floats) -> Floats:
    """(3K, 6) by which small shifts and turns, as SciPy makes them, move all points."""
    step = 1e-6
    middle = position - position.mean(axis=0)
    shifts = [np.tile(axis, len(position)) for axis in np.eye(3)]
    turns = [Rotation.from_rotvec(step * axis).apply(middle) - middle for axis in np.eye(3)]
    return np.stack([*shifts, *(turn.ravel() / step for turn in turns)], axis=1)


def test_in_space_too_it_equals_the_s_transformed_joint_covariance(in_space: Adjustment) -> None:
    count = len(in_space.survey.label)
    position, joint = in_space.joint_points(np.arange(count))
    free = rigid(position)
    projector = np.eye(3 * count) - free @ np.linalg.pinv(free)
    expected = projector @ joint @ projector.T
    rows = np.array([5, 0, 3])

    relative = in_space.relative_points_in_space(rows)
    for k, row in enumerate(rows):
        block = expected[3 * row : 3 * row + 3, 3 * row : 3 * row + 3]
        np.testing.assert_allclose(relative[k], block, rtol=1e-4, atol=1e-9)


def test_biases_of_the_flight_do_not_show_in_space_either(in_space: Adjustment) -> None:
    rows = np.array([0, 3, 5])
    absolute = in_space.points()[1][rows]
    relative = in_space.relative_points_in_space(rows)

    assert np.sqrt(absolute[:, [0, 1, 2], [0, 1, 2]]).min() > 0.25
    assert np.sqrt(np.linalg.eigvalsh(relative)).max() < 0.2
    assert np.linalg.eigvalsh(relative).min() > 0
