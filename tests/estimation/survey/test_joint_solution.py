"""The joint solution equals that of scipy on residuals by OpenCV and scipy's rotations."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
import scenes
from scenes import Scene, make_scene
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation, Slerp

from uavgram.estimation.solver import normal_equations
from uavgram.estimation.solver.levenberg_marquardt import Minimum, minimise
from uavgram.estimation.survey.likelihood import SurveyProblem
from uavgram.estimation.survey.unknowns import Layout, State, advance, move
from uavgram.model.arrays import Floats
from uavgram.model.flight.log import Track
from uavgram.model.options import SolveOptions
from uavgram.model.survey.survey import Survey
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


class Oracle:
    """The same likelihood, written anew: unknowns in their own units, rotations as vectors.

    The order is that of the package, so that results compare one to one; the interior orientation
    stands in pixels and is therefore compared apart.
    """

    def __init__(self, survey: Survey, start: State, pivot: Floats) -> None:
        self.survey, self.start, self.pivot = survey, start, pivot
        self.k, self.f = len(survey.label), len(survey.frame_id)
        self.rough = survey.ground.roughness_sigma_m > 0
        self.world = survey.gauge == "world"
        self.grounds = survey.grounds
        self.free = self.grounds if self.world else self.grounds[1:]  # planes that are unknowns
        sizes = [self.k * (3 if self.rough else 2), 6 * self.f, 9]
        sizes += [3 * len(self.free), 0 if survey.telemetry is None else 12]
        self.parts = [
            slice(a, a + n) for a, n in zip(np.cumsum([0, *sizes[:-1]]), sizes, strict=True)
        ]
        self.size = sum(sizes)
        if isinstance(track := survey.track, Track):
            body = Rotation.from_quat(track.world_from_body_xyzw)
            self.turned_at = Slerp(track.attitude_time_s, body)

    def unpack(self, x: Floats) -> tuple[Floats, Floats, list[Floats], Floats, Floats, Floats]:
        points, frames, intrinsics, plane, telemetry = (x[p] for p in self.parts)
        frames = frames.reshape(self.f, 6)
        rotation = [
            r @ Rotation.from_rotvec(v).as_matrix()
            for r, v in zip(self.start.rotation, frames[:, 3:], strict=True)
        ]
        point = self.start.point + points.reshape(self.k, -1)
        plane = self.start.plane + np.append(np.zeros(0 if self.world else 3), plane)
        telemetry = self.start.telemetry + telemetry
        return point, self.start.center + frames[:, :3], rotation, intrinsics, plane, telemetry

    def residuals(self, x: Floats) -> Floats:
        s = self.survey
        point, center, rotation, intrinsics, plane, shared = self.unpack(x)
        up = np.array(s.height_above_m)
        for a, (height, *slope) in enumerate(plane.reshape(-1, 3)):
            here = s.area == a
            up[here] += height + (point[here, :2] - self.pivot[a]) @ slope
        if self.rough:
            up = up + point[:, 2]
        world = np.column_stack([point[:, :2], up])
        camera = s.calibration.parameters + intrinsics
        out = []
        for f in range(self.f):
            rows = np.flatnonzero(s.pick_frame == f)
            pixel, _ = scenes.cv_pixels(camera, center[f], rotation[f], world[s.pick_label[rows]])
            out.append((pixel - s.pixel_px[rows]) / s.pick_sigma_px[rows, None])
        apart = world[s.line_start] - world[s.line_end]
        out.append((np.sqrt((apart**2).sum(1)) - s.length_m) / s.length_sigma_m)
        out.append((world[s.control_label] - s.control_world_m) / s.control_sigma_m)
        root = np.linalg.cholesky(np.linalg.inv(s.calibration.covariance))
        out.append(root.T @ intrinsics)
        if self.rough:
            out.append(point[:, 2] / s.ground.roughness_sigma_m)
        for ground, own in zip(
            self.free, plane[len(plane) - 3 * len(self.free) :].reshape(-1, 3), strict=True
        ):
            out.append((own[0] - ground.height_m) / ground.height_sigma_m)
            out.append(own[1:] / ground.slope_sigma_rad)
        if not self.world:
            out.append(center[0, :2] / 1e-4)
            out.append(rotation[0][0, 1] / 1e-6)
        if s.telemetry is not None:
            out += self.telemetry(center, rotation, shared)
        return np.concatenate([np.ravel(o) for o in out])

    def telemetry(self, center: Floats, rotation: list[Floats], shared: Floats) -> list[Floats]:
        prior, track = self.survey.telemetry, self.survey.track
        assert prior is not None
        assert isinstance(track, Track)
        at = prior.time_s - shared[10] - shared[11] * (prior.time_s - prior.middle_s)
        position = [np.interp(at, track.position_time_s, c) for c in track.position_world_m.T]
        turn = Rotation.from_euler("z", shared[9])
        body = turn * self.turned_at(at)
        predicted = (
            body * Rotation.from_matrix(prior.gimbal_from_camera) * Rotation.from_rotvec(shared[:3])
        )
        expected = np.stack(position, 1) - shared[6:9] + body.apply(shared[3:6])
        turned = (predicted.inv() * Rotation.from_matrix(rotation)).as_rotvec()
        white = np.linalg.cholesky(np.linalg.inv(prior.covariance[0])).T
        assert (prior.covariance == prior.covariance[0]).all()
        own = np.concatenate([center - expected, turned], axis=1) @ white.T
        sigma = [prior.boresight_sigma_rad] * 3 + [prior.lever_arm_sigma_m] * 3
        sigma += [*prior.position_bias_sigma_m, prior.heading_bias_sigma_rad, prior.clock_sigma_s]
        sigma += [prior.clock_drift_sigma]
        mean = np.zeros(12)
        mean[3:6] = prior.lever_arm_m
        return [own, (shared - mean) / sigma]


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


def central(function: Callable[[Floats], Floats], x: Floats) -> Floats:
    """Fourth-order central differences, a hundredth of a sigma apart."""
    columns = []
    for step in 1e-2 * np.eye(len(x)):
        near = function(x + step) - function(x - step)
        far = function(x + 2 * step) - function(x - 2 * step)
        columns.append((8 * near - far) / (12 * 1e-2))
    return np.stack(columns, axis=1)


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
        straight, turning = settled(scene, move), settled(scene, advance)
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
        a, b = (way(layout, scene.truth, size * step) for way in (move, advance))
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
        monkeypatch.setattr(normal_equations, "DENSE_ENTRIES", 0)
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
