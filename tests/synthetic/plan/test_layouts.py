"""Layouts of reference lines: against all combinations, and against the real likelihood."""

from __future__ import annotations

from itertools import combinations

import numpy as np
import pytest
from plan_scenes import PlanCase, plan_case

from uavgram.estimation.solver.normal_equations import Block
from uavgram.model.arrays import Floats
from uavgram.synthetic.plan.accuracy import list_ends
from uavgram.synthetic.plan.layouts import (
    Candidates,
    ChosenLines,
    add_greedily,
    combine_functions,
    compute_criterion,
    compute_criterion_with_one_more,
    compute_criterion_without_each,
    eliminate_points,
    exchange_lines,
    find_best_layout,
    find_robust_layout,
    invert,
    whiten_readings,
)
from uavgram.synthetic.plan.survey import (
    PlannedSurvey,
    PossibleReferences,
    compute_possible,
    make_survey,
    make_weak_priors,
    predict_values,
)


def options(case: PlanCase) -> PossibleReferences:
    return compute_possible(
        case.scene, case.cameras, case.wanted, (3.0, case.longest_m), most_spots=60
    )


def few(candidates: Candidates, count: int) -> Candidates:
    """Every so many of the candidates."""
    some = np.linspace(0, len(candidates.ends) - 1, count).astype(int)
    return Candidates(candidates.whitened[some], candidates.ends[some], candidates.node_root)


@pytest.mark.parametrize("pattern", ["single", "strip"])
@pytest.mark.parametrize("seed", [1, 2])
def test_exchange_comes_close_to_the_best_of_all_combinations(pattern: str, seed: int) -> None:
    found = options(plan_case(pattern, seed, lines=3))  # type: ignore[arg-type]
    candidates = few(found.candidates, 24)
    allowed = [
        lines
        for lines in combinations(range(24), 3)
        if len(np.unique(candidates.ends[list(lines)])) == 6
    ]
    best = min(compute_criterion(found.aim, candidates, lines) for lines in allowed)
    layout = find_best_layout(found.aim, candidates, 3)
    assert layout.criterion == pytest.approx(compute_criterion(found.aim, candidates, layout.lines))
    assert best <= layout.criterion * (1 + 1e-9)
    assert layout.criterion < 1.03 * best


@pytest.mark.parametrize("pattern", ["single", "strip"])
def test_one_more_line_is_reckoned_as_if_it_were_there(pattern: str) -> None:
    found = options(plan_case(pattern, 6))  # type: ignore[arg-type]
    there = add_greedily(found.aim, found.candidates, 3)[-1].lines
    among = np.flatnonzero(found.candidates.apart_from(there))[::37]
    covariance = invert(found.aim.information + found.candidates.information(there))
    quick = compute_criterion_with_one_more(found.aim, found.candidates, covariance, among)
    slow = np.array([compute_criterion(found.aim, found.candidates, (*there, i)) for i in among])
    assert int(np.argmin(quick)) == int(np.argmin(slow))
    assert quick.min() == pytest.approx(slow.min(), rel=1e-7)
    assert (quick >= slow * (1 - 1e-7)).all()  # what was not looked at closely is an upper bound


@pytest.mark.parametrize("pattern", ["single", "strip"])
@pytest.mark.parametrize("roughness_m", [0.0, 0.05])
def test_the_criterion_is_the_mean_sigma_of_the_real_likelihood(
    pattern: str, roughness_m: float
) -> None:
    case = plan_case(pattern, 7, roughness_m=roughness_m, lines=5)  # type: ignore[arg-type]
    found = options(case)
    layout = add_greedily(found.aim, found.candidates, 5)[-1]
    ends = list_ends(found, layout.lines)
    real = predict_values(case.scene, case.cameras, case.wanted, ends)
    assert compute_criterion(found.aim, found.candidates, layout.lines) == pytest.approx(
        real.sigma.mean(), rel=1e-6
    )


def test_planned_lines_are_far_better_than_random_ones() -> None:
    for pattern, share in (("single", 0.8), ("strip", 0.9)):
        case = plan_case(pattern, 8, lines=4)  # type: ignore[arg-type]
        found = options(case)
        rng = np.random.default_rng(0)
        count = len(found.candidates.ends)
        others = [
            compute_criterion(
                found.aim, found.candidates, rng.choice(count, 4, replace=False).tolist()
            )
            for _ in range(60)
        ]
        layout = find_best_layout(found.aim, found.candidates, 4)
        assert layout.criterion < share * np.median(others)


def test_a_sturdy_layout_bears_the_loss_of_any_line_better() -> None:
    found = options(plan_case("single", 9, lines=4))
    layout = find_best_layout(found.aim, found.candidates, 4)
    sturdy = find_robust_layout(found.aim, found.candidates, layout)
    lost, sturdy_lost = (
        compute_criterion_without_each(found.aim, found.candidates, one.lines).max()
        for one in (layout, sturdy)
    )
    assert sturdy_lost < 0.95 * lost
    assert sturdy.criterion < 1.15 * layout.criterion
    three = [one for one in layout.lines if one != layout.lines[0]]
    first = compute_criterion_without_each(found.aim, found.candidates, layout.lines)[0]
    assert first == pytest.approx(compute_criterion(found.aim, found.candidates, three))


def test_exchange_never_makes_it_worse() -> None:
    found = options(plan_case("strip", 10, lines=3))
    start = ChosenLines((0, 5, 9), compute_criterion(found.aim, found.candidates, (0, 5, 9)))
    assert exchange_lines(found.aim, found.candidates, start).criterion < start.criterion


# What points tell of the poses, against Schur complements of the whole normal matrix.


CASES = [("single", 0.0), ("single", 0.05), ("strip", 0.0), ("strip", 0.05)]


def survey(case: PlanCase) -> PlannedSurvey:
    low, high = case.scene.area_m.min(axis=0), case.scene.area_m.max(axis=0)
    share = np.array([[[0.2, 0.2], [0.5, 0.3]], [[0.3, 0.8], [0.7, 0.6]], [[0.8, 0.1], [0.8, 0.7]]])
    return make_survey(case.scene, case.cameras, case.wanted, low + share * (high - low))


def normal(blocks: list[Block], size: int) -> Floats:
    """J^T J by rows, one after the other."""
    total = np.zeros((size, size))
    for block in blocks:
        for columns, jacobian in zip(block.columns, block.jacobian, strict=True):
            row = np.zeros((len(jacobian), size))
            for k, column in enumerate(columns):
                row[:, column] += jacobian[:, k]
            total += row.T @ row
    return total


def without_points(total: Floats, first: int) -> Floats:
    across = total[:first, first:]
    schur: Floats = total[first:, first:] - across.T @ np.linalg.solve(
        total[:first, :first], across
    )
    return schur


@pytest.mark.parametrize(("pattern", "roughness_m"), CASES)
def test_lines_tell_of_the_core_what_the_whole_normal_matrix_says(
    pattern: str, roughness_m: float
) -> None:
    planned = survey(plan_case(pattern, 3, roughness_m=roughness_m))  # type: ignore[arg-type]
    blocks = planned.blocks() | {"hardly known": make_weak_priors(planned.problem)}
    layout = planned.problem.layout
    expected = without_points(normal(list(blocks.values()), layout.size), layout.first_frame)
    tapes = blocks.pop("lengths")
    points = eliminate_points(planned.problem, blocks)
    taped = planned.problem.survey
    ends = np.stack([taped.line_start, taped.line_end], axis=1)
    row = whiten_readings(points, layout, tapes.columns[:, None], tapes.jacobian, ends)[:, 0]
    found = points.base + points.information(np.arange(layout.points)) + row.T @ row
    scale = np.sqrt(np.outer(np.diag(expected), np.diag(expected)))
    np.testing.assert_allclose(found / scale, expected / scale, atol=1e-9)


@pytest.mark.parametrize(("pattern", "roughness_m"), CASES)
def test_functions_of_points_have_the_variance_of_the_whole(
    pattern: str, roughness_m: float
) -> None:
    planned = survey(plan_case(pattern, 4, roughness_m=roughness_m))  # type: ignore[arg-type]
    blocks = planned.blocks() | {"hardly known": make_weak_priors(planned.problem)}
    del blocks["lengths"]
    layout = planned.problem.layout
    gradient = np.random.default_rng(1).normal(size=(layout.size, 5))
    gradient[2 * layout.point_size : layout.first_frame] = 0.0
    points = eliminate_points(planned.problem, blocks)
    core = points.base + points.information(np.arange(layout.points))
    found = combine_functions(points, layout, gradient)
    whole = normal(list(blocks.values()), layout.size)
    scale = 1.0 / np.sqrt(np.diag(whole))
    inverse = np.linalg.inv(whole * np.outer(scale, scale)) * np.outer(scale, scale)
    own = np.diag(found.gradient @ np.linalg.solve(core, found.gradient.T)) + found.variance
    np.testing.assert_allclose(own, np.diag(gradient.T @ inverse @ gradient), rtol=1e-5)


def test_a_single_photo_says_nothing_of_its_pose_by_points_alone() -> None:
    planned = survey(plan_case("single", 5))
    blocks = planned.blocks()
    del blocks["lengths"]
    points = eliminate_points(planned.problem, blocks)
    assert points.root.shape[1] == 0
