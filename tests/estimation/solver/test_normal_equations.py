"""Normal equations: the dense and the sparse way are one, and what is missing is named."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scenes import Scene, make_scene

from uavgram.estimation.solver import normal_equations
from uavgram.estimation.solver.normal_equations import Block, NormalEquations, Plan, SingularError
from uavgram.estimation.solver.sparse import cholesky, nested_dissection
from uavgram.estimation.solver.sparse.block_matrix import Structure
from uavgram.estimation.survey.likelihood import SurveyProblem
from uavgram.estimation.survey.selection import select_picks
from uavgram.estimation.survey.unknowns import Layout
from uavgram.model.arrays import Floats

CASES: dict[str, dict[str, Any]] = {
    "telemetry": {},
    "rough ground and control": {"roughness": 0.05, "control": 3},
    "lengths alone": {"telemetry": False, "gauge": "plane"},
    "control without log": {"telemetry": False, "control": 4},
}


def blocks_of(scene: Scene) -> tuple[dict[str, Block], Layout]:
    lines = np.ones(len(scene.survey.line_start), dtype=bool)
    problem = SurveyProblem(scene.survey, scene.pivot, lines)
    blocks = problem.evaluate(scene.truth)
    assert blocks is not None
    return blocks, problem.layout


def dense_jacobian(blocks: dict[str, Block], size: int) -> Floats:
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
def branch(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> str:
    if request.param != "dense":
        monkeypatch.setattr(normal_equations, "MAX_DENSE_ENTRIES", 0)
        monkeypatch.setattr(nested_dissection, "LEAF_SIZE", 2)
    result: str = request.param
    return result


@pytest.mark.parametrize("options", CASES.values(), ids=CASES.keys())
def test_solution_and_covariances_equal_the_dense_inverse(
    options: dict[str, Any], branch: str
) -> None:
    blocks, layout = blocks_of(make_scene(3, frames=6, **options))
    size, structure = layout.size, layout.structure if branch == "points first" else None
    jacobian = dense_jacobian(blocks, size)
    scale = 1 / np.linalg.norm(jacobian, axis=0)
    inverse = np.linalg.inv((jacobian * scale).T @ (jacobian * scale)) * np.outer(scale, scale)
    sigma = np.sqrt(np.diag(inverse))

    factor = NormalEquations(list(blocks.values()), size, structure).factor()
    covariance = factor.covariance()

    assert factor.sparse == (branch != "dense")
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


@pytest.mark.parametrize("chosen", [[0], [3, 40], [1, 2, 7, 8, 70], [-1]])
def test_a_solution_for_some_unknowns_is_that_of_the_whole_system(
    chosen: list[int], branch: str
) -> None:
    scene = make_scene(5, frames=12, labels=36)
    # each label in two photos next to each other
    between = (scene.survey.pick_frame - scene.survey.pick_label) % 12
    problem = SurveyProblem(
        select_picks(scene.survey, between < 2).survey,
        scene.pivot,
        np.ones(len(scene.survey.line_start), dtype=bool),
    )
    blocks, layout = problem.evaluate(scene.truth), problem.layout
    assert blocks is not None
    structure = layout.structure if branch == "points first" else None
    factor = NormalEquations(list(blocks.values()), layout.size, structure).factor()
    columns = np.arange(layout.size)[chosen]
    right = np.zeros((layout.size, 3))
    right[columns] = np.random.default_rng(0).normal(size=(len(columns), 3))
    whole = factor.solve(right)[columns]

    found = factor.solve_among(columns, right[columns])
    np.testing.assert_allclose(found, whole, rtol=1e-12, atol=1e-12 * np.abs(whole).max())


@pytest.mark.usefixtures("branch")
def test_unknowns_that_share_an_observation_keep_their_covariance_where_products_cancel() -> None:
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
def test_an_unknown_without_any_observation_is_named() -> None:
    block = Block(np.zeros((2, 1)), np.array([[0], [2]]), np.ones((2, 1, 1)))
    with pytest.raises(SingularError) as error:
        NormalEquations([block], 3).factor()
    assert error.value.index == 1


@pytest.mark.usefixtures("branch")
@pytest.mark.parametrize("weights", [(1.0, 1.0), (0.7, 1.3), (1e-3, 1e4)])
def test_two_unknowns_of_which_only_the_sum_is_observed_are_named(
    weights: tuple[float, float],
) -> None:
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
def test_a_frame_that_three_picks_cannot_hold_is_named(branch: str, frame: int) -> None:
    scene = make_scene(3, telemetry=False, control=12)
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
def test_damping_makes_a_singular_system_solvable() -> None:
    block = Block(np.ones((1, 1)), np.array([[0, 1]]), np.ones((1, 1, 2)))
    normal = NormalEquations([block], 2)
    step = normal.factor(1e-3).solve(normal.gradient)
    np.testing.assert_allclose(step, np.full(2, 1 / 2.001), rtol=1e-9)


def test_a_row_may_name_an_unknown_twice(branch: str) -> None:
    # Two columns of one unknown, of a point's two, and a length from a point to itself.
    structure = None
    if branch == "points first":
        structure = Structure(size=7, points=2, point_size=2, block_size=2, first_shared=6)
    rng = np.random.default_rng(0)
    columns = np.concatenate([rng.integers(0, 7, (20, 4)), [[0, 1, 0, 1], [5, 5, 6, 6]]])
    block = Block(np.zeros((22, 1)), columns, rng.normal(size=(22, 1, 4)))
    jacobian = dense_jacobian({"one": block}, 7)
    factor = NormalEquations([block], 7, structure).factor()
    inverse = np.linalg.inv(jacobian.T @ jacobian)
    np.testing.assert_allclose(factor.joint(np.arange(7)), inverse, rtol=1e-8, atol=1e-12)
    found = factor.covariance().blocks(columns)
    expected = inverse[columns[:, :, None], columns[:, None, :]]
    np.testing.assert_allclose(found, expected, rtol=1e-8, atol=1e-12)
    variances = factor.variances(columns, block.jacobian[:, 0])
    np.testing.assert_allclose(variances, np.sum(jacobian @ inverse * jacobian, axis=1))


@pytest.mark.parametrize("dense_entries", [0, 1000], ids=["sparse", "dense"])
def test_a_plan_serves_only_the_columns_it_was_made_for(
    dense_entries: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(normal_equations, "MAX_DENSE_ENTRIES", dense_entries)
    rng = np.random.default_rng(1)
    one, other = (
        Block(np.zeros((9, 2)), rng.permuted(np.tile(np.arange(5), (9, 1)), axis=1)[:, :3], j)
        for j in rng.normal(size=(2, 9, 2, 3))
    )
    first = NormalEquations([one], 5)
    first.factor()
    second = NormalEquations([other], 5, None, first.plan)
    jacobian = dense_jacobian({"other": other}, 5)
    expected = np.linalg.inv(jacobian.T @ jacobian)
    np.testing.assert_allclose(second.factor().joint(np.arange(5)), expected, atol=1e-10)
    again = NormalEquations([one], 5, None, first.plan)
    again.factor()
    assert again.plan is first.plan is not second.plan


def test_what_was_analysed_serves_the_next_adjustment_of_the_same_columns(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(normal_equations, "MAX_DENSE_ENTRIES", 0)
    rng = np.random.default_rng(1)
    columns = rng.permuted(np.tile(np.arange(5), (9, 1)), axis=1)[:, :3]
    blocks = [
        Block(np.zeros((9, 2)), np.array(own), jacobian)
        for own, jacobian in zip(
            [columns, columns, columns[::-1]], rng.normal(size=(3, 9, 2, 3)), strict=True
        )
    ]
    systems = [NormalEquations([block], 5) for block in blocks]
    factors = [system.factor() for system in systems]
    for block, factor in zip(blocks, factors, strict=True):
        jacobian = dense_jacobian({"own": block}, 5)
        found = factor.joint(np.arange(5)) @ (jacobian.T @ jacobian)
        np.testing.assert_allclose(found, np.eye(5), atol=1e-9)
    assert systems[1].plan is systems[0].plan is not systems[2].plan


def test_covariances_of_unknowns_without_a_common_observation_are_not_guessed(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(normal_equations, "MAX_DENSE_ENTRIES", 0)
    chain = Block(np.zeros((4, 1)), np.array([[0, 1], [1, 2], [2, 3], [0, 1]]), np.ones((4, 1, 2)))
    chain.jacobian[3, 0, 1] = -1.0
    covariance = NormalEquations([chain], 4).factor().covariance()
    with pytest.raises(LookupError, match="share no observation"):
        covariance.blocks(np.array([[0, 3]]))


class Dirty:
    """numpy whose fresh memory holds what it must not be read for."""

    def __getattr__(self, name: str) -> Any:  # noqa: ANN401 - whatever numpy has
        return getattr(np, name)

    def empty(self, shape: int | tuple[int, int]) -> Floats:
        return np.full(shape, np.nan)


@pytest.mark.parametrize(("block_size", "border"), [(1, 0), (1, 2), (3, 2)])
def test_a_deep_tree_of_fronts_gives_the_dense_inverse(
    monkeypatch: pytest.MonkeyPatch, block_size: int, border: int
) -> None:
    monkeypatch.setattr(normal_equations, "MAX_DENSE_ENTRIES", 0)
    monkeypatch.setattr(nested_dissection, "LEAF_SIZE", 2)
    monkeypatch.setattr(cholesky, "np", Dirty())
    rng = np.random.default_rng(block_size)
    side = 9
    node = np.arange(side * side).reshape(side, side)
    pairs = np.concatenate(
        [
            np.stack([node[:, :-1], node[:, 1:]], -1).reshape(-1, 2),
            np.stack([node[:-1], node[1:]], -1).reshape(-1, 2),
        ]
    )
    inner = block_size * side * side
    own = (pairs[:, :, None] * block_size + np.arange(block_size)).reshape(len(pairs), -1)
    shared = np.broadcast_to(inner + np.arange(border), (len(pairs), border))
    columns = np.concatenate([own, shared], axis=1)
    rows = rng.normal(size=(len(pairs), 2, columns.shape[1]))
    prior = Block(
        np.zeros((inner, 1)), np.arange(inner)[:, None], rng.uniform(0.5, 1.5, (inner, 1, 1))
    )
    block = Block(np.zeros((len(pairs), 2)), columns, rows)
    size = inner + border
    structure = Structure(size, 0, 1, block_size, inner)
    jacobian = dense_jacobian({"a": block, "b": prior}, size)
    inverse = np.linalg.inv(jacobian.T @ jacobian)

    normal = NormalEquations([block, prior], size, structure)
    factor = normal.factor()

    assert isinstance(normal.plan, Plan)
    levels = {front.level for front in normal.plan.symbolic.ordering.fronts}
    assert len(levels) > 4
    np.testing.assert_allclose(factor.joint(np.arange(size)), inverse, atol=1e-10)
    found = factor.covariance().blocks(columns)
    expected = inverse[columns[:, :, None], columns[:, None, :]]
    np.testing.assert_allclose(found, expected, atol=1e-10)


@pytest.mark.parametrize("among", ["all unknowns", "what all share"])
def test_linear_functions_have_their_joint_covariance_however_many_they_are(
    branch: str, among: str
) -> None:
    blocks, layout = blocks_of(make_scene(3, frames=6))
    structure = layout.structure if branch == "points first" else None
    factor = NormalEquations(list(blocks.values()), layout.size, structure).factor()
    rng = np.random.default_rng(0)
    first = 0 if among == "all unknowns" else layout.first_intrinsic
    columns = rng.integers(first, layout.size, size=(70, 3))
    columns[5, 1] = columns[5, 0]  # one names an unknown twice
    gradients = rng.normal(size=columns.shape)
    dense = np.zeros((layout.size, 70))
    np.add.at(dense, (columns, np.arange(70)[:, None]), gradients)
    expected = dense.T @ factor.joint(np.arange(layout.size)) @ dense
    scale = np.sqrt(np.diag(expected))
    unit = np.outer(scale, scale)
    for found in (
        factor.covariances(columns, gradients),
        factor.covariance().joint(columns, gradients),
    ):
        np.testing.assert_allclose(found / unit, expected / unit, atol=1e-7)
    variance = factor.variances(columns, gradients)
    np.testing.assert_allclose(variance, np.diag(expected), rtol=1e-6)
