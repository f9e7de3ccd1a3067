"""The likelihood's residuals and Jacobians."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from increments import compute_increment
from known_scenes import known_scene
from likelihood_scenes import beginning, with_found, with_relief
from off_ground import with_third_coordinates
from rolling_scenes import read_in_rows
from scenes import Scene, make_scene
from taped_scenes import read_on_tapes

from uavgram.estimation.solver.normal_equations import Block, compute_gradient
from uavgram.estimation.survey.likelihood import SurveyProblem, compute_covariance_root
from uavgram.estimation.survey.unknowns import State, apply_increment, stack
from uavgram.model.arrays import Floats
from uavgram.model.observations import Along

CASES: dict[str, dict[str, Any]] = {
    "telemetry": {},
    "rough ground and control": {"roughness": 0.05, "control": 3},
    "lengths alone": {"telemetry": False, "gauge": "plane"},
    "control without log": {"telemetry": False, "control": 4},
    "two areas": {"verge": (0, 1, 2, 5), "control": 4, "roughness": 0.05},
    "two areas, lengths alone": {"verge": (0, 1, 2, 5), "telemetry": False, "gauge": "plane"},
    "relief": {"verge": (0, 1, 2, 5), "control": 3, "roughness": 0.05},
    "relief, lengths alone": {"verge": (0, 1, 2, 5), "telemetry": False, "gauge": "plane"},
    "two tapes, level and not": {"tapes": True, "heights": {0: 1.5, 3: -2.0}},
    "free and stated heights": {"thirds": True, "heights": {0: 1.5, 3: 2.0, 4: -0.5}, "control": 2},
    "free heights on rough ground": {"thirds": True, "verge": (0, 1, 2, 5), "roughness": 0.05},
    "free heights, lengths alone": {"thirds": True, "telemetry": False, "gauge": "plane"},
    "a tape, lengths alone": {"tapes": True, "telemetry": False, "gauge": "plane"},
    "unknown camera, lengths alone": {"unknown": True, "telemetry": False, "gauge": "plane"},
}


@pytest.mark.parametrize("case", CASES)
def test_every_jacobian_equals_central_differences(case: str) -> None:
    wanted = dict(CASES[case])
    taped, thirds = wanted.pop("tapes", False), wanted.pop("thirds", False)
    is_unknown = wanted.pop("unknown", False)
    scene = make_scene(3, **wanted)
    if thirds:
        scene = with_third_coordinates(scene, free=(0, 7), stated={3: 0.1, 8: 0.02})
    if taped:
        ways: tuple[Along, ...] = ("slope", "horizontal", "slope")
        scene = read_on_tapes(scene, {"": 0.02, "red": -0.03}, sigma=0.001, along=ways)
    survey = with_relief(scene.survey) if case.startswith("relief") else scene.survey
    if is_unknown:
        poor = 1e4 * survey.calibration.covariance
        survey = replace(
            survey, calibration=replace(survey.calibration, covariance=poor, is_unknown=True)
        )
    lines = np.ones(len(survey.line_start), dtype=bool)
    problem = SurveyProblem(survey, scene.pivot, lines)
    layout = problem.layout
    rng = np.random.default_rng(1)
    truth = replace(scene.truth, relief=np.zeros(layout.relief))
    state = apply_increment(layout, truth, 0.01 * rng.normal(size=layout.size))
    blocks = problem.evaluate(state)

    assert blocks is not None
    analytic = {name: dense(block, layout.size) for name, block in blocks.items()}
    numeric = {name: np.zeros_like(jacobian) for name, jacobian in analytic.items()}
    # By every unknown, also where a group says that it does not depend on it: a derivative that was
    # forgotten is a zero.
    for column in range(layout.size):
        for h, names in ((1e-5, blocks.keys() - {"gauge"}), (1e-6, blocks.keys() & {"gauge"})):
            step = np.zeros(layout.size)
            step[column] = h
            ahead = problem.evaluate(apply_increment(layout, state, step)) if names else {}
            behind = problem.evaluate(apply_increment(layout, state, -step)) if names else {}
            assert ahead is not None
            assert behind is not None
            for name in names:
                change = ahead[name].residual - behind[name].residual
                numeric[name][:, :, column] = change / (2 * h)
    for name, jacobian in analytic.items():
        scale = np.abs(jacobian).max()
        assert np.abs(jacobian - numeric[name]).max() < 2e-6 * scale, name
        assert scale > 0, name


def dense(block: Block, size: int) -> Floats:
    """(n, r, size) Jacobian of a block by all unknowns."""
    n, r, _ = block.jacobian.shape
    whole = np.zeros((n, r, size))
    rows = np.arange(n)[:, None, None]
    np.add.at(whole, (rows, np.arange(r)[:, None], block.columns[:, None, :]), block.jacobian)
    return whole


def test_exact_data_have_no_residual_at_the_truth() -> None:
    scene = make_scene(5, noise=0.0, control=3)
    problem = SurveyProblem(scene.survey, scene.pivot, np.ones(6, dtype=bool))
    blocks = problem.evaluate(scene.truth)

    assert blocks is not None
    for name in ("pixels", "lengths", "control"):
        assert np.abs(blocks[name].residual).max() < 1e-8, name


def test_a_point_behind_its_camera_makes_the_state_impossible() -> None:
    scene = make_scene(5, noise=0.0)
    problem = SurveyProblem(scene.survey, scene.pivot, np.ones(6, dtype=bool))
    flipped = scene.truth.rotation @ np.diag([1.0, -1.0, -1.0])

    assert problem.evaluate(replace(scene.truth, rotation=flipped)) is None


def test_the_root_of_a_singular_covariance_leaves_out_what_is_known_exactly() -> None:
    covariance = np.diag([4.0, 0.0, 9e-8])
    covariance[0, 2] = covariance[2, 0] = 1e-4
    root = compute_covariance_root(covariance)

    assert root.shape == (3, 2)
    np.testing.assert_allclose(root @ root.T, covariance, rtol=1e-12, atol=1e-20)


def test_between_undoes_a_move() -> None:
    scene = make_scene(3, control=3, gauge="world")
    problem = SurveyProblem(scene.survey, scene.pivot, np.ones(6, dtype=bool))
    step = 0.3 * np.random.default_rng(1).normal(size=problem.layout.size)
    moved = apply_increment(problem.layout, scene.truth, step)

    np.testing.assert_allclose(
        compute_increment(problem.layout, scene.truth, moved), step, atol=1e-12
    )


# Likelihood of many states at once, against that of each.


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
    if name == "unknown camera":
        scene = make_scene(3)
        camera = scene.survey.calibration
        poor = replace(camera, covariance=1e4 * camera.covariance, is_unknown=True)
        return replace(scene, survey=replace(scene.survey, calibration=poor))
    return known_scene(3, name)[0]


@pytest.mark.parametrize(
    "name",
    [
        "rows, ties, matches",
        "relief, control",
        "no log, tapes",
        "heights",
        "unknown camera",
        "right_angle",
    ],
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
