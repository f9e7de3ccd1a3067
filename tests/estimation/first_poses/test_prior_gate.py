"""The gate through which poses from lengths pass where there is a log."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from uavgram.estimation.first_poses.length_poses import LengthPoses
from uavgram.estimation.first_poses.prior_gate import (
    compare_with_seed,
    find_allowed,
    move_seed_to_plane,
)
from uavgram.model.arrays import Floats
from uavgram.model.survey import Ground

SEED = np.diag([1.0, -1.0, -1.0]) @ Rotation.from_rotvec([0.3, -0.2, 0.5]).as_matrix()
CENTER = np.array([3.0, 4.0, 50.0])


def ground(height_sigma: float = 0.0, slope_sigma: float = 0.0) -> Ground:
    return Ground(
        height_m=1.5,
        height_sigma_m=height_sigma,
        slope_sigma_rad=slope_sigma,
        roughness_sigma_m=0.0,
    )


def poses(plane: Floats, covariance: Floats | None = None) -> LengthPoses:
    count = len(plane)
    joint = np.zeros((count, 3, 3)) if covariance is None else covariance
    return LengthPoses(plane, joint, np.zeros(count), np.ones(count, bool))


def prior() -> Floats:
    root = np.random.default_rng(1).normal(size=(6, 6))
    root *= np.array([1.0, 1, 1, 0.02, 0.02, 0.02])[:, None]
    return root @ root.T


@pytest.mark.statistical
@pytest.mark.parametrize("own", [False, True])
def test_true_poses_lie_in_the_gate_as_often_as_it_states(*, own: bool) -> None:
    """Squared distances of 4000 true poses are chi-square of three: mean 3, variance 6."""
    rng = np.random.default_rng(2)
    error = rng.multivariate_normal(np.zeros(6), prior(), 4000)
    rotation = SEED @ Rotation.from_rotvec(error[:, 3:]).as_matrix()
    tilted = rng.normal(0, 0.01, (4000, 2))
    up = np.column_stack([-tilted, np.ones(4000)])
    up /= np.linalg.norm(up, axis=1, keepdims=True)
    height = CENTER[2] + error[:, 2] - 1.5 + rng.normal(0, 0.4, 4000)
    plane = -np.einsum("nji,nj->ni", rotation, up) / height[:, None]
    joint = None
    if own:
        root = rng.normal(size=(3, 3)) * 4e-4
        joint = np.tile(root @ root.T, (4000, 1, 1))
        plane = plane + rng.normal(size=(4000, 3)) @ root.T
    squared = compare_with_seed(
        CENTER, SEED, prior(), ground(0.4, 0.01), poses(plane, joint)
    ).squared_distance
    assert squared.mean() == pytest.approx(3, abs=3.3 * np.sqrt(6 / 4000))
    assert np.mean(~find_allowed(squared)) < 0.004
    if own:  # without the candidates' own covariances they would lie too far out
        bare = compare_with_seed(
            CENTER, SEED, prior(), ground(0.4, 0.01), poses(plane)
        ).squared_distance
        assert bare.mean() > 3.3


def test_a_pose_far_from_the_log_is_not_allowed() -> None:
    turned = SEED @ Rotation.from_rotvec([0.5, 0, 0]).as_matrix()
    plane = -turned[2] / 48.5
    squared = compare_with_seed(
        CENTER, SEED, prior(), ground(), poses(plane[None])
    ).squared_distance
    assert not find_allowed(squared).any()


def test_a_seed_takes_height_and_level_of_a_plane_and_keeps_its_heading() -> None:
    turned = SEED @ Rotation.from_rotvec([0.2, -0.1, 0.0]).as_matrix()
    plane = -turned[2] / 40.0
    center, rotation = move_seed_to_plane(CENTER, SEED, ground(), plane)
    np.testing.assert_allclose(center, [3.0, 4.0, 41.5])
    np.testing.assert_allclose(-rotation[2] / (center[2] - 1.5), plane, atol=1e-15)
    np.testing.assert_allclose(rotation @ rotation.T, np.eye(3), atol=1e-14)
    # The short way: no turn about the vertical comes with it.
    relative = Rotation.from_matrix(rotation @ SEED.T).as_rotvec()
    assert relative[2] == pytest.approx(0, abs=1e-12)


def test_a_pose_pulls_the_seed_as_far_as_its_weight_says() -> None:
    turned = SEED @ Rotation.from_rotvec([0.02, 0, 0]).as_matrix()
    plane = -turned[2][None] / 50.5
    sharp = poses(plane, 1e-16 * np.eye(3)[None])
    vague = poses(plane, 1e-2 * np.eye(3)[None])
    (whole,) = compare_with_seed(CENTER, SEED, prior(), ground(), sharp).shift
    assert whole[0] == pytest.approx(50.5 - 48.5, abs=1e-6)
    tilt = np.arccos(turned[2] @ SEED[2])
    assert np.hypot(*whole[1:]) == pytest.approx(tilt, rel=1e-6)
    (none,) = compare_with_seed(CENTER, SEED, prior(), ground(), vague).shift
    assert np.abs(none).max() < 0.02
    # Between the two: the mean of two estimates by their weights, here in height alone.
    known = np.diag([1e-12, 1e-12, 0.25, 1e-12, 1e-12, 1e-12])
    own = 0.75 / 50.5**4 * np.eye(3)[None]
    level = poses(-SEED[2][None] / 50.5, own)
    (shift,) = compare_with_seed(CENTER, SEED, known, ground(), level).shift
    np.testing.assert_allclose(shift, [2.0 * 0.25, 0, 0], atol=1e-6)
