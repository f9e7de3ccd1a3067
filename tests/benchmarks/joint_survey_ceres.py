"""The joint survey by Ceres: the likelihood of the package's own adjustment, for comparison.

Ceres has no cost function of its own for picks on a plane, and pyceres no hook that would evaluate
all of them at once. So each point's picks are one cost function in Python: numpy works on them
together, and Ceres still finds what it needs to eliminate points first. Priors of the shared
unknowns are Ceres' own. The telemetry of a frame is linear here, expanded at the minimum: less
work than its real form, and the same minimum and covariance.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from typing import Any

import numpy as np
import pyceres
from scipy.spatial.transform import Rotation

from uavgram.estimation.survey.adjustment import Adjustment
from uavgram.estimation.survey.likelihood import SurveyProblem
from uavgram.estimation.survey.unknowns import State
from uavgram.geometry.motion.rotation import hat, log_so3, right_jacobian
from uavgram.model.arrays import Floats, Ints
from uavgram.model.survey import Survey

Cost = Any
"""A pyceres.CostFunction: pyceres has no types."""
Jacobians = Sequence[Floats | None] | None


class PointCost(pyceres.CostFunction):  # type: ignore[misc]  # pyceres has no types
    """Whitened residuals of a point's picks, by point, plane, lens and the poses that see it."""

    def __init__(
        self, survey: Survey, problem: SurveyProblem, label: int, picks: Ints, seed_rotation: Floats
    ) -> None:
        super().__init__()
        self.height = survey.height_above_m[label]
        self.pivot = np.ravel(problem.pivot_m)[:2]
        self.mean, self.basis = survey.calibration.parameters, problem.intrinsic_basis
        self.pixel = survey.pixel_px[picks]
        self.weight = 1.0 / survey.pick_sigma_px[picks]
        self.seed = seed_rotation[survey.pick_frame[picks]]
        self.set_num_residuals(2 * len(picks))
        self.set_parameter_block_sizes([2, 3, self.basis.shape[1]] + [6] * len(picks))

    def Evaluate(  # noqa: N802, PLR0915
        self, blocks: Sequence[Floats], residuals: Floats, jacobians: Jacobians
    ) -> bool:
        point, plane, lens = blocks[:3]
        pose = np.array(blocks[3:])
        m = len(pose)
        turn, right = _exp_with_right_jacobian(pose[:, 3:])
        rotation = self.seed @ turn
        away = point - self.pivot
        world = np.array([point[0], point[1], plane[0] + away @ plane[1:] + self.height])
        camera = ((world - pose[:, :3])[:, None] @ rotation)[:, 0]
        x, y, z = camera.T
        if (z <= 0).any():
            return False
        x, y = x / z, y / z
        fx, fy, cx, cy, k1, k2, p1, p2, k3 = self.mean + self.basis @ lens
        xx, yy, xy2 = x * x, y * y, 2 * x * y
        r2 = xx + yy
        radial = 1 + r2 * (k1 + r2 * (k2 + r2 * k3))
        xd = x * radial + p1 * xy2 + p2 * (r2 + 2 * xx)
        yd = y * radial + p2 * xy2 + p1 * (r2 + 2 * yy)
        out = residuals.reshape(m, 2)
        out[:, 0] = (fx * xd + cx - self.pixel[:, 0]) * self.weight
        out[:, 1] = (fy * yd + cy - self.pixel[:, 1]) * self.weight
        if jacobians is None:
            return True
        slope = k1 + r2 * (2 * k2 + r2 * 3 * k3)
        common = radial + 2 * (p1 * y + p2 * x)
        a = common + 2 * xx * slope + 4 * p2 * x
        b = xy2 * slope + 2 * (p1 * x + p2 * y)
        c = common + 2 * yy * slope + 4 * p1 * y
        by_camera = np.empty((m, 2, 3))
        by_camera[:, 0, 0], by_camera[:, 0, 1] = fx * a, fx * b
        by_camera[:, 1, 0], by_camera[:, 1, 1] = fy * b, fy * c
        by_camera[:, 0, 2] = -fx * (a * x + b * y)
        by_camera[:, 1, 2] = -fy * (b * x + c * y)
        by_camera *= (self.weight / z)[:, None, None]
        by_world = by_camera @ np.swapaxes(rotation, 1, 2)
        up = by_world[:, :, 2].ravel()
        if jacobians[0] is not None:
            by_point = by_world[:, :, :2] + by_world[:, :, 2:] * plane[1:]
            jacobians[0][:] = by_point.ravel()
        if jacobians[1] is not None:
            by_plane = jacobians[1].reshape(-1, 3)
            by_plane[:, 0], by_plane[:, 1], by_plane[:, 2] = up, up * away[0], up * away[1]
        if jacobians[2] is not None:
            d = np.zeros((m, 2, 9))
            d[:, 0, 0], d[:, 0, 2], d[:, 1, 1], d[:, 1, 3] = xd, 1, yd, 1
            for column, power in ((4, r2), (5, r2 * r2), (8, r2 * r2 * r2)):
                d[:, 0, column], d[:, 1, column] = fx * x * power, fy * y * power
            d[:, 0, 6], d[:, 1, 6] = fx * xy2, fy * (r2 + 2 * yy)
            d[:, 0, 7], d[:, 1, 7] = fx * (r2 + 2 * xx), fy * xy2
            by_lens = (d @ self.basis) * self.weight[:, None, None]
            jacobians[2][:] = by_lens.ravel()
        by_turn = by_camera @ hat(camera) @ right
        for i in range(m):
            own = jacobians[3 + i]
            if own is not None:
                by_pose = own.reshape(m, 2, 6)
                by_pose[:] = 0
                by_pose[i, :, :3] = -by_world[i]
                by_pose[i, :, 3:] = by_turn[i]
        return True


class LinearCost(pyceres.CostFunction):  # type: ignore[misc]  # pyceres has no types
    """Residuals r + J (x - x0) of several blocks."""

    def __init__(self, residual: Floats, jacobians: Sequence[Floats], at: Sequence[Floats]) -> None:
        super().__init__()
        self.constant = residual - sum(j @ x for j, x in zip(jacobians, at, strict=True))
        self.jacobians = jacobians
        self.set_num_residuals(len(residual))
        self.set_parameter_block_sizes([j.shape[1] for j in jacobians])

    def Evaluate(  # noqa: N802
        self, blocks: Sequence[Floats], residuals: Floats, jacobians: Jacobians
    ) -> bool:
        residuals[:] = self.constant
        for j, x in zip(self.jacobians, blocks, strict=True):
            residuals += j @ x
        if jacobians is not None:
            for out, j in zip(jacobians, self.jacobians, strict=True):
                if out is not None:
                    out[:] = j.ravel()
        return True


class LengthCost(pyceres.CostFunction):  # type: ignore[misc]  # pyceres has no types
    """Whitened length between two points of one plane, by the points and the plane."""

    def __init__(self, length: float, sigma: float, above: float) -> None:
        super().__init__()
        self.length, self.sigma, self.above = length, sigma, above
        self.set_num_residuals(1)
        self.set_parameter_block_sizes([2, 2, 3])

    def Evaluate(  # noqa: N802
        self, blocks: Sequence[Floats], residuals: Floats, jacobians: Jacobians
    ) -> bool:
        start, end, plane = blocks
        flat = end - start
        up = flat @ plane[1:] + self.above
        size = np.sqrt(flat @ flat + up * up)
        residuals[0] = (size - self.length) / self.sigma
        if jacobians is not None:
            by_end = (flat + up * plane[1:]) / (size * self.sigma)
            for out, value in zip(
                jacobians,
                (-by_end, by_end, np.array([0.0, *flat]) * up / (size * self.sigma)),
                strict=True,
            ):
                if out is not None:
                    out[:] = value
        return True


def _exp_with_right_jacobian(turn: Floats) -> tuple[Floats, Floats]:
    return Rotation.from_rotvec(turn).as_matrix(), right_jacobian(turn)


class JointSurvey:
    """Parameters of the survey and the problem over them, from the first values.

    Parameters
    ----------
    adjustment
        The package's own result: for the expansion of the telemetry only.
    first_point
        (K, 2) first values of the points.
    """

    def __init__(self, adjustment: Adjustment, first_point: Floats) -> None:
        self.adjustment = adjustment
        problem, survey, state = adjustment.problem, adjustment.survey, adjustment.state
        seeds = survey.seeds
        assert seeds is not None
        self.seed_rotation = np.array(seeds.world_from_camera)
        self.point = [np.array(p) for p in first_point]
        self.pose = [np.array([*c, 0, 0, 0]) for c in seeds.center_world_m]
        self.lens = np.zeros(problem.layout.intrinsics)
        self.plane = np.array([survey.grounds[0].height_m, 0.0, 0.0])
        self.shared = np.array(problem.telemetry_mean)
        self.turn_there = log_so3(np.swapaxes(self.seed_rotation, 1, 2) @ state.rotation)
        self.problem = pyceres.Problem()
        self._costs: list[Cost] = []
        self._add_picks(problem, survey)
        self._add_lengths(problem, survey)
        self._add_priors(problem, survey, state)

    def _add(self, cost: Cost, blocks: Sequence[Floats]) -> None:
        self._costs.append(cost)
        self.problem.add_residual_block(cost, None, blocks)

    def _add_picks(self, problem: SurveyProblem, survey: Survey) -> None:
        order = np.argsort(survey.pick_label, kind="stable")
        cuts = np.cumsum(np.bincount(survey.pick_label))[:-1]
        for label, picks in enumerate(np.split(order, cuts)):
            cost = PointCost(survey, problem, label, picks, self.seed_rotation)
            poses = [self.pose[f] for f in survey.pick_frame[picks]]
            self._add(cost, [self.point[label], self.plane, self.lens, *poses])

    def _add_lengths(self, problem: SurveyProblem, survey: Survey) -> None:
        for i in problem.line_index:
            start, end = survey.line_start[i], survey.line_end[i]
            above = survey.height_above_m[end] - survey.height_above_m[start]
            cost = LengthCost(survey.length_m[i], survey.length_sigma_m[i], above)
            self._add(cost, [self.point[start], self.point[end], self.plane])

    def _add_priors(self, problem: SurveyProblem, survey: Survey, state: State) -> None:
        block = self.adjustment.minimum.blocks["telemetry"]
        assert survey.telemetry is not None
        turn = self.turn_there[survey.telemetry.frame_index]
        by_turn = block.jacobian[:, :, 3:6] @ right_jacobian(turn)
        for row, frame in enumerate(survey.telemetry.frame_index):
            by_pose = np.concatenate([block.jacobian[row, :, :3], by_turn[row]], axis=1)
            at = np.concatenate([state.center[frame], turn[row]])
            jacobians = [by_pose, np.ascontiguousarray(block.jacobian[row, :, 6:])]
            cost = LinearCost(block.residual[row], jacobians, [at, state.telemetry])
            self._add(cost, [self.pose[frame], self.shared])
        ground = survey.grounds[0]
        sigma = np.array([ground.height_sigma_m, ground.slope_sigma_rad, ground.slope_sigma_rad])
        for values, mean, deviation in (
            (self.lens, self.lens.copy(), np.ones(len(self.lens))),
            (self.plane, np.array([ground.height_m, 0.0, 0.0]), sigma),
            (self.shared, np.array(problem.telemetry_mean), problem.telemetry_sigma),
        ):
            self._add(pyceres.factors.NormalPrior(mean, np.diag(deviation**2)), [values])

    def solve(self, solver: pyceres.LinearSolverType, threads: int) -> pyceres.SolverSummary:
        """Minimise; returns Ceres' summary."""
        options = pyceres.SolverOptions()
        options.linear_solver_type = solver
        options.num_threads = threads
        options.logging_type = pyceres.LoggingType.SILENT
        options.function_tolerance = 1e-12
        options.gradient_tolerance = 0.0
        options.parameter_tolerance = 0.0
        options.initial_trust_region_radius = 1e9  # first values as good as the telemetry
        options.max_num_iterations = 60
        summary = pyceres.SolverSummary()
        pyceres.solve(options, self.problem, summary)
        return summary

    def covariance(self, threads: int) -> tuple[Floats, Floats]:
        """Of every pose, of every point and of it with the plane: what the package hands over."""
        options = pyceres.CovarianceOptions()
        options.algorithm_type = pyceres.CovarianceAlgorithmType.SPARSE_QR
        options.num_threads = threads
        covariance = pyceres.Covariance(options)
        pairs = [(p, p) for p in self.pose]
        pairs += [(p, p) for p in self.point] + [(p, self.plane) for p in self.point]
        assert covariance.compute([*pairs, (self.plane, self.plane)], self.problem)
        pose = np.array([covariance.get_covariance_block(p, p) for p in self.pose])
        point = np.array([covariance.get_covariance_block(p, p) for p in self.point])
        return pose, point

    def difference(self, pose: Floats, point: Floats) -> tuple[float, float]:
        """Largest differences from the package's result: in sigmas, and of sigmas, relative."""
        state, layout = self.adjustment.state, self.adjustment.problem.layout
        blocks = self.adjustment.covariance.blocks
        own = np.einsum("nii->ni", blocks(layout.point_columns(np.arange(layout.points))))
        own_pose = np.einsum("nii->ni", blocks(layout.frame_columns(np.arange(layout.frames))))
        shift = np.abs(np.array(self.point) - state.point[:, :2]) / np.sqrt(own[:, :2])
        here = np.array(self.pose)
        shift_pose = np.abs(here[:, :3] - state.center) / np.sqrt(own_pose[:, :3])
        sigma = np.sqrt(np.einsum("nii->ni", point) / own[:, :2])
        to_body = right_jacobian(here[:, 3:])
        turned = to_body @ pose[:, 3:, 3:] @ np.swapaxes(to_body, 1, 2)
        found = np.concatenate(
            [np.einsum("nii->ni", pose)[:, :3], np.einsum("nii->ni", turned)], axis=1
        )
        sigma_pose = np.sqrt(found / own_pose)
        return (
            max(shift.max(), shift_pose.max()),
            max(np.abs(sigma - 1).max(), np.abs(sigma_pose - 1).max()),
        )


def ceres(
    adjustment: Adjustment, first_point: Floats, solver: pyceres.LinearSolverType, threads: int
) -> tuple[tuple[float, float, float], pyceres.SolverSummary, JointSurvey, tuple[Floats, Floats]]:
    """Seconds (wall) of building, solving, covariance; the summary; and the joint survey."""
    started = time.perf_counter()
    joint = JointSurvey(adjustment, first_point)
    built = time.perf_counter()
    summary = joint.solve(solver, threads)
    solved = time.perf_counter()
    pose, point = joint.covariance(threads)
    ended = time.perf_counter()
    return (built - started, solved - built, ended - solved), summary, joint, (pose, point)
