"""Covariances within the survey: what all points share is taken out."""

from __future__ import annotations

from typing import Any

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


# What places a frame's pixels on the ground, jointly: against the dense inverse.


CASES: dict[str, dict[str, Any]] = {
    "telemetry": {},
    "rough ground": {"roughness": 0.05, "control": 2},
    "two areas": {"verge": (0, 3, 5, 7)},
    "lengths alone": {"telemetry": False, "gauge": "plane", "lines": 8},
}


def dense_inverse(adjustment: Adjustment) -> Floats:
    """Of all unknowns, from the whitened rows themselves."""
    size = adjustment.problem.layout.size
    normal = np.zeros((size, size))
    for block in adjustment.minimum.blocks.values():
        for columns, jacobian in zip(block.columns, block.jacobian, strict=True):
            rows = np.zeros((len(jacobian), size))
            for column, values in zip(columns, jacobian.T, strict=True):
                rows[:, column] += values
            normal += rows.T @ rows
    scale = 1.0 / np.sqrt(np.diag(normal))
    return scale[:, None] * np.linalg.inv(scale[:, None] * normal * scale) * scale


@pytest.mark.parametrize("options", CASES.values(), ids=CASES.keys())
def test_it_is_the_part_of_the_dense_inverse_in_plain_units(
    options: dict[str, Any],
) -> None:
    survey = make_scene(3, **options).survey
    adjustment = refine(survey, SolveOptions())[0].adjustment
    problem, layout = adjustment.problem, adjustment.problem.layout
    inverse = dense_inverse(adjustment)
    frames = np.array([2, 0])

    got = adjustment.sight_covariance(frames)

    lens = np.linalg.cholesky(survey.calibration.covariance)  # unknowns stand in its units
    spread = lens @ lens.T
    np.testing.assert_allclose(problem.intrinsic_basis @ problem.intrinsic_basis.T, spread)
    assert got.shape == (2, 18, 18)
    for row, frame in enumerate(frames):
        pose = layout.frame_columns(np.array([frame]))[0]
        interior = layout.first_intrinsic + np.arange(9)
        plane = np.zeros(0, int)
        if survey.gauge == "world":
            plane = layout.first_plane + np.arange(3)
        columns = np.concatenate([pose, interior, plane])
        by = np.zeros((18, len(columns)))
        by[:6, :6] = np.eye(6)
        by[6:15, 6:15] = problem.intrinsic_basis
        by[15:, 15:] = np.eye(3)[:, : len(plane)]
        expected = by @ inverse[np.ix_(columns, columns)] @ by.T
        sigma = np.sqrt(np.maximum(np.diag(expected), 1e-300))
        np.testing.assert_allclose(
            got[row] / np.outer(sigma, sigma), expected / np.outer(sigma, sigma), atol=1e-6
        )
    if survey.gauge == "plane":
        assert not got[:, 15:].any()
    # poses, lens and plane go together: blocks beside the diagonal are not nothing
    assert np.abs(got[:, :6, 6:15]).max() > 0
