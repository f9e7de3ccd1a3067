"""Normal equations: the dense and the sparse way are one, and what is missing is named."""

from __future__ import annotations

import numpy as np
import pytest

from uavgram.estimation import nested_dissection, normal_equations
from uavgram.estimation.normal_equations import Block, NormalEquations, SingularError
from uavgram.estimation.survey_problem import SurveyProblem

CASES = {
    "telemetry": {},
    "rough ground and control": {"roughness": 0.05, "control": 3},
    "lengths alone": {"telemetry": False, "gauge": "plane"},
    "control without log": {"telemetry": False, "control": 4},
}


def blocks_of(scene):
    lines = np.ones(len(scene.survey.line_start), dtype=bool)
    problem = SurveyProblem(scene.survey, scene.pivot, lines)
    return problem.evaluate(scene.truth), problem.layout


def dense_jacobian(blocks, size):
    """All rows, without any code of the package."""
    rows = []
    for block in blocks.values():
        for columns, jacobian in zip(block.columns, block.jacobian, strict=True):
            for row in jacobian:
                full = np.zeros(size)
                for column, value in zip(columns, row, strict=True):
                    full[column] += value
                rows.append(full)
    return np.array(rows)


@pytest.fixture(params=["dense", "sparse", "points first"])
def branch(request, monkeypatch):
    if request.param != "dense":
        monkeypatch.setattr(normal_equations, "DENSE_LIMIT", 0)
        monkeypatch.setattr(nested_dissection, "LEAF", 2)
    return request.param


@pytest.mark.parametrize("options", CASES.values(), ids=CASES.keys())
def test_solution_and_covariances_equal_the_dense_inverse(scene_factory, options, branch):
    blocks, layout = blocks_of(scene_factory(3, frames=6, **options))
    size, structure = layout.size, layout.structure if branch == "points first" else None
    jacobian = dense_jacobian(blocks, size)
    scale = 1 / np.linalg.norm(jacobian, axis=0)
    inverse = np.linalg.inv((jacobian * scale).T @ (jacobian * scale)) * np.outer(scale, scale)
    sigma = np.sqrt(np.diag(inverse))

    factor = NormalEquations(list(blocks.values()), size, structure).factor()
    covariance = factor.covariance()

    assert (factor._sparse is not None) == (branch != "dense")
    right = np.random.default_rng(0).normal(size=(size, 3)) / sigma[:, None]
    error = (factor.solve(right) - inverse @ right) / sigma[:, None]
    assert np.abs(error).max() < 1e-6 * np.sqrt(size)
    chosen = np.array([size - 1, 0, 5, size // 2])
    expected = inverse[np.ix_(chosen, chosen)] / np.outer(sigma[chosen], sigma[chosen])
    found = factor.joint(chosen) / np.outer(sigma[chosen], sigma[chosen])
    np.testing.assert_allclose(found, expected, atol=1e-7)
    for name, block in blocks.items():
        found = covariance.blocks(block.columns)
        for columns, joint in zip(block.columns, found, strict=True):
            unit = np.outer(sigma[columns], sigma[columns])
            expected = inverse[np.ix_(columns, columns)] / unit
            np.testing.assert_allclose(joint / unit, expected, atol=1e-7, err_msg=name)


@pytest.mark.usefixtures("branch")
def test_unknowns_that_share_an_observation_keep_their_covariance_where_products_cancel():
    # a + b, a - b and c + a + b, c - a: J^T J has an exact zero at (a, b); the covariance has none.
    block = Block(
        residual=np.zeros((4, 1)),
        columns=np.tile([0, 1, 2], (4, 1)),
        jacobian=np.array([[[1.0, 1, 0]], [[1, -1, 0]], [[0, 1, 1]], [[1, 0, 1]]]),
    )
    rows = block.jacobian[:, 0]
    expected = np.linalg.inv(rows.T @ rows)

    assert (rows.T @ rows)[0, 1] == 0 != expected[0, 1]
    covariance = NormalEquations([block], 3).factor().covariance()
    np.testing.assert_allclose(covariance.blocks(np.array([[0, 1, 2]]))[0], expected)


@pytest.mark.usefixtures("branch")
def test_an_unknown_without_any_observation_is_named():
    block = Block(np.zeros((2, 1)), np.array([[0], [2]]), np.ones((2, 1, 1)))
    with pytest.raises(SingularError) as error:
        NormalEquations([block], 3).factor()
    assert error.value.index == 1


@pytest.mark.usefixtures("branch")
@pytest.mark.parametrize("weights", [(1.0, 1.0), (0.7, 1.3), (1e-3, 1e4)])
def test_two_unknowns_of_which_only_the_sum_is_observed_are_named(weights):
    # Unknown 5 and 6 of eight appear only as a weighted sum.
    n = 8
    alone = [i for i in range(n) if i not in (5, 6)]
    single = Block(np.zeros((6, 1)), np.array(alone)[:, None], np.ones((6, 1, 1)))
    pair = Block(
        np.zeros((3, 1)),
        np.tile([5, 6], (3, 1)),
        np.array([1.0, 2.0, 3.0])[:, None, None] * np.array(weights),
    )
    with pytest.raises(SingularError) as error:
        NormalEquations([single, pair], n).factor()
    assert error.value.index in (5, 6)


@pytest.mark.parametrize("frame", [0, 2, 3])
def test_a_frame_that_three_picks_cannot_hold_is_named(scene_factory, branch, frame):
    scene = scene_factory(3, telemetry=False, control=12)
    blocks, layout = blocks_of(scene)
    picks = np.flatnonzero(scene.survey.pick_frame == frame)
    keep = np.setdiff1d(np.arange(len(scene.survey.pick_frame)), picks[2:])
    pixels = blocks["pixels"]
    blocks["pixels"] = Block(pixels.residual[keep], pixels.columns[keep], pixels.jacobian[keep])
    structure = layout.structure if branch == "points first" else None
    normal = NormalEquations(list(blocks.values()), layout.size, structure)
    with pytest.raises(SingularError) as error:
        normal.factor()
    assert (error.value.index - 24) // 6 == frame


@pytest.mark.usefixtures("branch")
def test_damping_makes_a_singular_system_solvable():
    block = Block(np.ones((1, 1)), np.array([[0, 1]]), np.ones((1, 1, 2)))
    normal = NormalEquations([block], 2)
    step = normal.factor(1e-3).solve(normal.gradient)
    np.testing.assert_allclose(step, np.full(2, 1 / 2.001), rtol=1e-9)
