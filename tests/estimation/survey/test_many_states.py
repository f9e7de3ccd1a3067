"""The likelihood of many states at once is that of each."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from known_scenes import known_scene
from likelihood_scenes import beginning, with_found, with_relief
from off_ground import with_third_coordinates
from rolling_scenes import read_in_rows
from scenes import Scene, make_scene
from taped_scenes import read_on_tapes

from uavgram.estimation.solver.normal_equations import compute_gradient
from uavgram.estimation.survey.likelihood import SurveyProblem
from uavgram.estimation.survey.unknowns import State, apply_increment, stack


def problem_of(scene: Scene) -> tuple[SurveyProblem, State]:
    survey = scene.survey
    problem = SurveyProblem(survey, scene.pivot, np.ones(len(survey.line_start), dtype=bool))
    relief = np.zeros(problem.layout.relief)
    return problem, beginning(problem, replace(scene.truth, relief=relief))


def scene_of(name: str) -> Scene:
    """A scene with the groups of observations that its name says."""
    if name == "rows, ties, matches":
        scene = read_in_rows(make_scene(3, roughness=0.05), 0.04)
        return replace(scene, survey=with_found(scene.survey, chains=2, ties=3))
    if name == "relief, control":
        scene = make_scene(3, verge=(0, 1, 2, 5), control=3, roughness=0.05)
        return replace(scene, survey=with_relief(scene.survey))
    if name == "no log, tapes":
        scene = make_scene(3, telemetry=False, gauge="plane")
        return read_on_tapes(scene, {"": 0.02, "red": -0.03}, sigma=0.001, along=("slope",) * 3)
    if name == "heights":
        scene = make_scene(3, heights={0: 1.5, 3: 2.0, 4: -0.5}, control=2)
        return with_third_coordinates(scene, free=(0, 7), stated={3: 0.1, 8: 0.02})
    return known_scene(3, name)[0]


@pytest.mark.parametrize(
    "name", ["rows, ties, matches", "relief, control", "no log, tapes", "heights", "right_angle"]
)
def test_residuals_and_derivatives_are_those_of_each_state(name: str) -> None:
    problem, truth = problem_of(scene_of(name))
    layout = problem.layout
    steps = 0.003 * np.random.default_rng(1).normal(size=(3, layout.size))
    together = problem.evaluate(apply_increment(layout, truth, steps))
    assert together is not None
    gradient = compute_gradient(together.values(), layout.size)

    for row, step in enumerate(steps):
        alone = problem.evaluate(apply_increment(layout, truth, step))
        assert alone is not None
        assert alone.keys() == together.keys()
        for group, block in alone.items():
            own = together[group]
            np.testing.assert_array_equal(own.columns, block.columns)
            jacobian = own.jacobian[row] if own.jacobian.ndim == 4 else own.jacobian
            near = 1e-10 * np.abs(block.jacobian).max()
            np.testing.assert_allclose(jacobian, block.jacobian, atol=near, err_msg=group)
            near = 1e-10 * (1.0 + np.abs(block.residual).max())
            np.testing.assert_allclose(own.residual[row], block.residual, atol=near, err_msg=group)
        expected = compute_gradient(alone.values(), layout.size)
        np.testing.assert_allclose(gradient[row], expected, atol=1e-10 * np.abs(expected).max())


def test_one_impossible_state_makes_all_of_them_impossible() -> None:
    problem, truth = problem_of(make_scene(5, noise=0.0))
    flipped = replace(truth, rotation=truth.rotation @ np.diag([1.0, -1.0, -1.0]))

    assert problem.evaluate(stack([truth, truth])) is not None
    assert problem.evaluate(stack([truth, flipped])) is None
