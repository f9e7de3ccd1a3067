"""The joint solution equals that of scipy on residuals by OpenCV and scipy's rotations."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from scenes import Scene, make_scene
from scipy.optimize import least_squares
from scipy_likelihood import Oracle, central

from uavgram.estimation.solver import normal_equations
from uavgram.estimation.solver.levenberg_marquardt import Minimum, minimise
from uavgram.estimation.survey.likelihood import SurveyProblem
from uavgram.estimation.survey.unknowns import Layout, State, advance_state, apply_increment
from uavgram.model.arrays import Floats
from uavgram.model.options import SolveOptions
from uavgram.stages.refine import refine

CASES: dict[str, dict[str, Any]] = {
    "telemetry": {},
    "telemetry without lines": {"lines": 0},
    "one frame": {"frames": 1},
    "control": {"control": 4, "telemetry": False},
    "telemetry and control": {"control": 3},
    "roughness": {"roughness": 0.05, "control": 2},
    "heights": {"heights": {1: 0.8, 4: 1.5, 7: -0.4}},
    "gauge plane": {"telemetry": False, "gauge": "plane", "lines": 8},
    "two areas": {"verge": (0, 3, 5, 7), "heights": {3: 0.8}},
    "two areas, gauge plane": {
        "verge": (0, 3, 5, 7),
        "telemetry": False,
        "gauge": "plane",
        "lines": 8,
    },
}


@pytest.mark.parametrize("options", CASES.values(), ids=CASES.keys())
def test_estimates_and_sigmas_equal_those_of_scipy(options: dict[str, Any]) -> None:
    survey = make_scene(11, **options).survey
    refined, _ = refine(survey, SolveOptions(noise="stated"))
    adjustment = refined.adjustment
    assert refined.alternatives == ()
    assert adjustment.minimum.converged
    problem, state = adjustment.problem, adjustment.state
    layout = problem.layout

    # Scaled by our own sigmas, which decides nothing but how well the matrices are conditioned.
    joint = adjustment.minimum.factor.joint(np.arange(layout.size))
    basis = problem.intrinsic_basis
    part = slice(layout.first_intrinsic, layout.first_plane)
    sigma = np.sqrt(np.diag(joint))
    sigma[part] = np.sqrt(np.diag(basis @ joint[part, part] @ basis.T))
    ours = np.zeros(layout.size)
    ours[part] = problem.intrinsics(state) - survey.calibration.parameters

    oracle = Oracle(survey, state, problem.pivot_m)
    offset = 0.3 * np.random.default_rng(0).normal(size=layout.size)

    def scaled(z: Floats) -> Floats:
        return oracle.residuals(ours + sigma * z)

    found = least_squares(scaled, offset, method="lm")
    # Scipy's forward differences leave 1e-4 sigma: one step with better ones.
    jacobian = central(scaled, found.x)
    best = found.x - np.linalg.lstsq(jacobian, scaled(found.x))[0]
    assert np.abs(best - found.x).max() < 1e-3
    assert np.abs(best).max() < 1e-4, np.abs(best).argmax()
    assert np.sum(scaled(best) ** 2) == pytest.approx(adjustment.minimum.cost, rel=1e-9)

    jacobian = central(scaled, best)
    theirs = np.sqrt(np.diag(np.linalg.inv(jacobian.T @ jacobian)))
    np.testing.assert_allclose(theirs, 1.0, rtol=1e-5)


def settled(scene: Scene, update: Callable[[Layout, State, Floats], State]) -> Minimum[State]:
    """The minimum from the truth, by one way to take a step."""
    survey = scene.survey
    problem = SurveyProblem(survey, scene.pivot, np.ones(len(survey.line_start), dtype=bool))
    layout = problem.layout
    return minimise(
        scene.truth,
        problem.evaluate,
        lambda state, step: update(layout, state, step),
        layout.size,
        layout.structure,
    )


@pytest.mark.parametrize(
    "options",
    [
        {"frames": 1, "telemetry": False, "gauge": "plane", "lines": 9},
        {"frames": 3, "sources": ("telemetry", "heading_bias", "position_bias")},
    ],
    ids=["free gauge", "picks far better than the telemetry"],
)
def test_turning_steps_reach_the_same_minimum_in_half_the_number(
    options: dict[str, Any],
) -> None:
    steps = []
    for seed in range(30, 34):
        scene = make_scene(seed, labels=8, spread=7.0, **options)
        straight, turning = settled(scene, apply_increment), settled(scene, advance_state)
        assert turning.converged
        assert turning.cost == pytest.approx(straight.cost, abs=1e-6)
        steps.append((straight.iterations, turning.iterations))

    straight_steps, turning_steps = np.sum(steps, axis=0)  # measured 104 and 19, 73 and 31
    assert turning_steps < straight_steps / 2


def test_a_turning_step_is_a_straight_one_to_first_order() -> None:
    scene = make_scene(4, frames=2)
    survey = scene.survey
    layout = SurveyProblem(survey, scene.pivot, np.ones(len(survey.line_start), dtype=bool)).layout
    step = np.random.default_rng(0).normal(size=layout.size)
    apart = []
    for size in (1e-3, 1e-4):
        a, b = (way(layout, scene.truth, size * step) for way in (apply_increment, advance_state))
        parts = ("point", "center", "rotation", "intrinsic", "plane", "telemetry")
        apart.append(max(np.abs(getattr(a, p) - getattr(b, p)).max() for p in parts))

    assert apart[0] > 0
    assert apart[1] < 0.02 * apart[0]  # a hundredth: the difference is of second order


@pytest.mark.parametrize("sparse", [False, True])
@pytest.mark.parametrize(
    "options",
    [{}, {"telemetry": False, "gauge": "plane"}, {"verge": (0, 3, 5, 7)}],
    ids=["log", "gauge plane", "two areas"],
)
def test_sights_of_all_frames_have_the_covariance_of_each(
    monkeypatch: pytest.MonkeyPatch, options: dict[str, Any], *, sparse: bool
) -> None:
    if sparse:
        monkeypatch.setattr(normal_equations, "MAX_DENSE_ENTRIES", 0)
    adjustment = refine(make_scene(3, frames=5, **options).survey, SolveOptions())[0].adjustment
    layout, lens = adjustment.problem.layout, adjustment.problem.intrinsic_basis
    plane = 0 if layout.free_gauge else 3
    frames = np.array([4, 0, 2])
    for frame, found in zip(frames, adjustment.sight_covariance(frames), strict=True):
        columns = np.concatenate([
            layout.frame_columns(np.array([frame]))[0],
            layout.first_intrinsic + np.arange(layout.intrinsics),
            layout.first_plane + np.arange(plane),
        ])  # fmt: skip
        whole = np.zeros((9 + len(lens), len(columns)))
        whole[:6, :6], whole[6 : 6 + len(lens), 6 : 6 + layout.intrinsics] = np.eye(6), lens
        whole[6 + len(lens) :, 6 + layout.intrinsics :] = np.eye(3)[:, :plane]
        expected = whole @ adjustment.minimum.factor.joint(columns) @ whole.T
        sigma = np.sqrt(np.diag(expected))
        unit = np.outer(np.where(sigma > 0, sigma, 1), np.where(sigma > 0, sigma, 1))
        np.testing.assert_allclose(found / unit, expected / unit, atol=1e-6)
