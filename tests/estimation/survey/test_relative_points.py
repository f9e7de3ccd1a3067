"""Covariances within the survey: what all points share is taken out."""

import numpy as np
from scenes import make_scene

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
