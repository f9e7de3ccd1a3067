"""What points tell of the poses, against Schur complements of the whole normal matrix."""

from __future__ import annotations

import numpy as np
import pytest
from plan_scenes import PlanCase, plan_case

from uavgram.estimation.solver.normal_equations import Block
from uavgram.model.arrays import Floats
from uavgram.synthetic.plan.elimination import (
    combine_functions,
    eliminate_points,
    whiten_readings,
)
from uavgram.synthetic.plan.survey import PlannedSurvey, make_survey, make_weak_priors

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
