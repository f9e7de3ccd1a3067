"""Correlations of the poses with camera and ground plane."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scenes import Scene

from uavgram.model.options import SolveOptions
from uavgram.stages.refine import refine
from uavgram.stages.summarise import DECIMALS, summarise_orientation


def test_they_are_those_of_the_dense_joint_covariance(scene_factory: Callable[..., Scene]) -> None:
    adjustment = refine(scene_factory(2, frames=5).survey, SolveOptions())[0].adjustment
    told = summarise_orientation(adjustment)
    layout, basis = adjustment.problem.layout, adjustment.problem.intrinsic_basis
    joint = adjustment.minimum.factor.joint(np.arange(layout.size))
    lens = np.arange(layout.first_intrinsic, layout.first_intrinsic + layout.intrinsics)
    plane = np.arange(layout.first_plane, layout.first_plane + 3)
    for frame in range(layout.frames):
        pose = layout.frame_columns(np.array([frame]))[0]
        columns = np.concatenate([pose, lens, plane])
        to_lens = np.zeros((9 + len(basis), len(columns)))
        to_lens[:6, :6] = np.eye(6)
        to_lens[6:-3, 6:-3] = basis
        to_lens[-3:, -3:] = np.eye(3)
        covariance = to_lens @ joint[np.ix_(columns, columns)] @ to_lens.T
        sigma = np.sqrt(np.diag(covariance))
        wanted = covariance / np.outer(sigma, sigma)

        bound = 0.51 * 10.0**-DECIMALS
        np.testing.assert_allclose(told.with_pose[frame], wanted[:6, 6:], atol=bound)
        np.testing.assert_allclose(told.shared, wanted[6:, 6:], atol=bound)

    assert told.frame_id == adjustment.survey.frame_id
    assert told.parameters[-3:] == ("plane height", "slope east", "slope north")
    assert len(told.parameters) == len(basis) + 3
