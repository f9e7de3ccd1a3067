"""Lines of known position in the likelihood: their rows, what is left of them, and derivatives."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scenes import Scene, make_scene

from uavgram.estimation.survey.likelihood import SurveyProblem
from uavgram.estimation.survey.observations.known import compute_known_rows
from uavgram.estimation.survey.selection import select_picks
from uavgram.estimation.survey.unknowns import apply_increment
from uavgram.model.observations import ON_LINE, KnownThing, LinePosition, do_lines_fix_plan

SIGMA = np.array([[0.02, 0.01, 0.03], [0.01, 0.03, 0.02]])


def on_line(label: tuple[int, ...], ends: object, *, has_height: bool = False) -> KnownThing:
    position = LinePosition(
        ends_m=np.array(ends, dtype=np.float64),
        sigma_m=SIGMA,
        straightness_m=0.004,
        has_height=has_height,
    )
    return KnownThing(
        index=0,
        name="kerb",
        kind=ON_LINE,
        label=label,
        value=float("nan"),
        sigma=position.across_m,
        position=position,
    )


def scene_of(*, has_height: bool) -> Scene:
    """Three points exactly on a line, as the truth has it."""
    scene = make_scene(3, noise=0.0)
    point = scene.truth.point.copy()
    point[:3] = [[-4.0, -2.0], [0.0, 0.0], [6.0, 3.0]]
    truth = replace(scene.truth, point=point)
    problem = SurveyProblem(scene.survey, scene.pivot, np.ones(6, dtype=bool))
    world, _, _ = problem.world_points(truth, np.arange(3))
    far = world[2] + 0.5 * (world[2] - world[0])
    thing = on_line((0, 1, 2), [world[0], far], has_height=has_height)
    return replace(scene, survey=replace(scene.survey, known=(thing,)), truth=truth)


@pytest.mark.parametrize("has_height", [False, True])
def test_derivatives_are_central_differences(*, has_height: bool) -> None:
    scene = scene_of(has_height=has_height)
    problem = SurveyProblem(scene.survey, scene.pivot, np.ones(6, dtype=bool))
    layout = problem.layout
    block = compute_known_rows(problem, scene.truth, problem.known).block()
    dense = np.zeros((len(block.residual), layout.size))
    np.add.at(dense, (np.arange(len(dense))[:, None], block.columns), block.jacobian[:, 0])

    assert len(dense) == 3 * (1 + has_height)
    assert np.abs(block.residual).max() < 1e-9
    for column in range(layout.size):
        step = np.zeros(layout.size)
        step[column] = 1e-5
        ahead, behind = (
            compute_known_rows(
                problem, apply_increment(layout, scene.truth, sign * step), problem.known
            ).block()
            for sign in (1.0, -1.0)
        )
        slope = (ahead.residual - behind.residual)[:, 0] / 2e-5
        np.testing.assert_allclose(slope, dense[:, column], atol=2e-6 * np.abs(dense).max())


def test_squares_are_those_of_the_joint_covariance() -> None:
    scene = scene_of(has_height=True)
    problem = SurveyProblem(scene.survey, scene.pivot, np.ones(6, dtype=bool))
    layout = problem.layout
    moved = apply_increment(
        layout, scene.truth, 0.01 * np.random.default_rng(1).normal(size=layout.size)
    )
    rows = compute_known_rows(problem, moved, problem.known)
    whole = rows.covariance(np.arange(6))

    assert np.abs(whole - np.diag(np.diag(whole))).max() > 1e-5
    squares = float(np.sum(rows.block().residual ** 2))
    assert squares == pytest.approx(float(rows.value @ np.linalg.solve(whole, rows.value)))
    np.testing.assert_allclose(rows.sigma**2, np.diag(whole))


def test_a_line_stays_as_long_as_one_of_its_points() -> None:
    survey = scene_of(has_height=False).survey
    some = select_picks(survey, survey.pick_label != 1).survey
    none = select_picks(survey, survey.pick_label > 2).survey

    assert [thing.label for thing in some.known] == [(0, 1)]
    assert none.known == ()


def test_lines_place_a_survey_with_three_points_on_two_directions() -> None:
    east, also_east = [[0, 0, 0], [9, 0, 0]], [[0, 5, 0], [9, 5.2, 0]]
    north = [[0, 0, 0], [0, 9, 0]]

    assert do_lines_fix_plan([on_line((0, 1), east), on_line((2,), north)])
    assert not do_lines_fix_plan([on_line((0, 1), east), on_line((2, 3), also_east)])
    assert not do_lines_fix_plan([on_line((0,), east), on_line((1,), north)])
