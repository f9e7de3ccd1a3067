"""One frame over known lengths, by Ceres: the likelihood of the length resection, for comparison.

Unknowns: the plane m (3), the interior orientation in sigmas (9), the undistorted picks (2 each).
All residuals stand in one cost function with analytic derivatives, evaluated by numpy on whole
arrays: the least that a cost function in Python costs.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, TypedDict

import numpy as np
import pyceres

from uavgram.model.arrays import Floats, Ints


class Frame(TypedDict):
    """What was observed: (E, 2) pixels and their sigmas, (n,) lengths between them."""

    pixel: Floats
    sigma: Floats
    start: Ints
    end: Ints
    length: Floats
    length_sigma: Floats


class FrameCost(pyceres.CostFunction):  # type: ignore[misc]  # pyceres has no types
    """Whitened residuals: 2 E of pixels, 9 of the interior, n of lengths."""

    def __init__(self, parameters: Floats, root: Floats, frame: Frame) -> None:
        super().__init__()
        self.parameters, self.root = parameters, root
        self.pixel, self.sigma = frame["pixel"], frame["sigma"]
        self.start, self.end = frame["start"], frame["end"]
        self.length, self.length_sigma = frame["length"], frame["length_sigma"]
        self.e, self.n = len(self.pixel), len(self.length)
        self.set_num_residuals(2 * self.e + 9 + self.n)
        self.set_parameter_block_sizes([3, 9, 2 * self.e])

    def Evaluate(  # noqa: N802, PLR0915
        self,
        blocks: Sequence[Floats],
        residuals: Floats,
        jacobians: Sequence[Floats | None] | None,
    ) -> bool:
        m, t, point = blocks
        e, n = self.e, self.n
        x, y = point[:e], point[e:]
        fx, fy, cx, cy, k1, k2, p1, p2, k3 = self.parameters + self.root @ t
        xx, yy, xy2 = x * x, y * y, 2 * x * y
        r2 = xx + yy
        r4 = r2 * r2
        radial = 1 + r2 * (k1 + r2 * (k2 + r2 * k3))
        xd = x * radial + p1 * xy2 + p2 * (r2 + 2 * xx)
        yd = y * radial + p2 * xy2 + p1 * (r2 + 2 * yy)
        ray = np.stack([x, y, np.ones(e)])
        depth = m @ ray
        if (depth <= 0).any():
            return False
        ground = ray / depth
        along = ground[:, self.start] - ground[:, self.end]
        length = np.sqrt(np.sum(along * along, axis=0))
        residuals[:e] = (fx * xd + cx - self.pixel[:, 0]) / self.sigma
        residuals[e : 2 * e] = (fy * yd + cy - self.pixel[:, 1]) / self.sigma
        residuals[2 * e : 2 * e + 9] = t
        residuals[2 * e + 9 :] = (length - self.length) / self.length_sigma
        if jacobians is not None:
            rows = 2 * e + 9 + n
            slope = k1 + r2 * (2 * k2 + r2 * 3 * k3)
            common = radial + 2 * (p1 * y + p2 * x)
            a = common + 2 * xx * slope + 4 * p2 * x
            b = xy2 * slope + 2 * (p1 * x + p2 * y)
            c = common + 2 * yy * slope + 4 * p1 * y
            unit = along / length / self.length_sigma
            at_start, at_end = ground[:, self.start], ground[:, self.end]
            by_start, by_end = np.sum(unit * at_start, 0), np.sum(unit * at_end, 0)
            i = np.arange(e)
            plane, interior, picks = jacobians
            if plane is not None:
                by_m = plane.reshape(rows, 3)
                by_m[: 2 * e + 9] = 0
                by_m[2 * e + 9 :] = (by_end * at_end - by_start * at_start).T
            if interior is not None:
                by_t = interior.reshape(rows, 9)
                d = np.zeros((2 * e, 9))
                d[:e, 0], d[:e, 2] = xd, 1
                d[e:, 1], d[e:, 3] = yd, 1
                for column, power in ((4, r2), (5, r4), (8, r2 * r4)):
                    d[:e, column], d[e:, column] = fx * x * power, fy * y * power
                d[:e, 6], d[e:, 6] = fx * xy2, fy * (r2 + 2 * yy)
                d[:e, 7], d[e:, 7] = fx * (r2 + 2 * xx), fy * xy2
                by_t[: 2 * e] = (d @ self.root) / np.concatenate([self.sigma, self.sigma])[:, None]
                by_t[2 * e : 2 * e + 9] = np.eye(9)
                by_t[2 * e + 9 :] = 0
            if picks is not None:
                by_point = picks.reshape(rows, 2 * e)
                by_point[:] = 0
                by_point[i, i], by_point[i, e + i] = fx * a / self.sigma, fx * b / self.sigma
                by_point[e + i, i], by_point[e + i, e + i] = (
                    fy * b / self.sigma,
                    fy * c / self.sigma,
                )
                line = 2 * e + 9 + np.arange(n)
                for ends, sign, reach in ((self.start, 1, by_start), (self.end, -1, by_end)):
                    over = sign / depth[ends]
                    by_point[line, ends] = over * (unit[0] - reach * m[0])
                    by_point[line, e + ends] = over * (unit[1] - reach * m[1])
        return True


def solve(
    parameters: Floats, root: Floats, frame: Frame, plane: Floats, point: Floats
) -> tuple[Floats, Floats, Floats, Any]:
    """Plane, interior in sigmas, their joint covariance (12, 12), and Ceres' summary."""
    m, t, point = plane.copy(), np.zeros(9), point.copy()
    problem = pyceres.Problem()
    cost = FrameCost(parameters, root, frame)
    problem.add_residual_block(cost, None, [m, t, point])
    options = pyceres.SolverOptions()
    options.linear_solver_type = pyceres.LinearSolverType.DENSE_NORMAL_CHOLESKY
    options.num_threads = 1
    options.logging_type = pyceres.LoggingType.SILENT
    options.function_tolerance = 1e-12
    options.max_num_iterations = 30
    summary = pyceres.SolverSummary()
    pyceres.solve(options, problem, summary)
    covariance_options = pyceres.CovarianceOptions()
    covariance_options.algorithm_type = pyceres.CovarianceAlgorithmType.DENSE_SVD
    covariance = pyceres.Covariance(covariance_options)
    assert covariance.compute([(m, m), (m, t), (t, t)], problem)
    joint = np.empty((12, 12))
    joint[:3, :3] = covariance.get_covariance_block(m, m)
    joint[:3, 3:] = covariance.get_covariance_block(m, t)
    joint[3:, :3] = joint[:3, 3:].T
    joint[3:, 3:] = covariance.get_covariance_block(t, t)
    return m, t, joint, summary
