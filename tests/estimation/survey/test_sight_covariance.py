"""What places a frame's pixels on the ground, jointly: against the dense inverse."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scenes import make_scene

from uavgram.estimation.survey.adjustment import Adjustment
from uavgram.model.arrays import Floats
from uavgram.model.options import SolveOptions
from uavgram.stages.refine import refine

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
