"""A survey's likelihood written anew from its description, for Ceres.

Points are in the world, rotations are vectors beside a fixed turn and pixels come from OpenCV;
nothing of the package's own residuals, Jacobians or normal equations is used. Derivatives are
central differences, and Ceres has its own minimiser and its own covariance.
"""

from __future__ import annotations

from collections.abc import Callable

import cv2
import numpy as np
import pyceres
from ceres_known import residuals
from numpy.typing import ArrayLike
from scipy.spatial.transform import Rotation

from uavgram.estimation.survey.unknowns import State
from uavgram.model.arrays import Floats
from uavgram.model.flight_log import Track
from uavgram.model.observations import KnownThing
from uavgram.model.survey import Survey

STEP = 3e-3
"""Of the differences, in sigmas of each unknown; fourth order."""


class Residual(pyceres.CostFunction):  # type: ignore[misc]  # pyceres has no types
    """Any function of a few parameter blocks, differentiated by fourth-order differences."""

    def __init__(self, function: Callable[..., ArrayLike], sizes: list[int], rows: int) -> None:
        super().__init__()
        self.function = function
        self.set_num_residuals(rows)
        self.set_parameter_block_sizes(sizes)

    def Evaluate(  # noqa: N802
        self, parameters: list[Floats], residuals: Floats, jacobians: list[Floats | None] | None
    ) -> bool:
        blocks = [np.array(block, dtype=float) for block in parameters]
        residuals[:] = np.ravel(self.function(*blocks))
        if jacobians is None:
            return True
        for block, jacobian in zip(blocks, jacobians, strict=True):
            if jacobian is not None:
                jacobian[:] = self._differences(blocks, block).ravel()
        return True

    def _differences(self, blocks: list[Floats], block: Floats) -> Floats:
        columns = []
        for index in range(len(block)):
            middle, values = block[index], {}
            for reach in (-2, -1, 1, 2):
                block[index] = middle + reach * STEP
                values[reach] = np.ravel(self.function(*blocks))
            block[index] = middle
            near, far = values[1] - values[-1], values[2] - values[-2]
            columns.append((8 * near - far) / (12 * STEP))
        return np.stack(columns, axis=1)


class Likelihood:
    """A survey as Ceres sees it: every unknown is its departure from a start, in rough sigmas."""

    def __init__(
        self, survey: Survey, start: State, pivot: Floats, sigma: dict[str, Floats]
    ) -> None:
        self.survey, self.start, self.pivot, self.sigma = survey, start, pivot, sigma
        rough = np.array([ground.roughness_sigma_m for ground in survey.grounds])[survey.area]
        self.departure_sigma_m = np.hypot(survey.height_sigma_m, rough)
        self.departure_sigma_m[survey.is_free] = np.inf
        self.departs = self.departure_sigma_m > 0
        self.point = [np.zeros(3 if departs else 2) for departs in self.departs]
        self.frame = [np.zeros(6) for _ in survey.frame_id]
        self.interior, self.plane = np.zeros(9), np.zeros(3)
        self.flight = np.zeros(12)
        self.problem = pyceres.Problem()
        self.costs: list[Residual] = []
        self._observe()

    def _add(self, function: Callable[..., ArrayLike], blocks: list[Floats], rows: int) -> None:
        cost = Residual(function, [len(block) for block in blocks], rows)
        self.costs.append(cost)
        self.problem.add_residual_block(cost, None, blocks)

    def world(self, label: int, own: Floats, plane: Floats) -> Floats:
        """East, north and up of a label."""
        place = self.start.point[label, :2] + self.sigma["point"][label, :2] * own[:2]
        height, slope = self._plane(plane)
        up = height + slope @ (place - self.pivot) + self.survey.height_above_m[label]
        return np.array([*place, up + self._departure(label, own)])

    def _departure(self, label: int, own: Floats) -> float:
        """Of a label from the height that is stated for it, or from the ground."""
        if not self.departs[label]:
            return 0.0
        return float(self.start.point[label, 2] + self.sigma["point"][label, 2] * own[2])

    def _plane(self, plane: Floats) -> tuple[float, Floats]:
        value = self.start.plane[:3] + self.sigma["plane"] * plane
        return value[0], value[1:]

    def camera(self, frame: int, own: Floats) -> tuple[Floats, Floats]:
        """Centre and world-from-camera rotation of a frame."""
        step = self.sigma["frame"][frame] * own
        turn = Rotation.from_rotvec(step[3:]).as_matrix()
        return self.start.center[frame] + step[:3], self.start.rotation[frame] @ turn

    def _observe(self) -> None:
        survey, plane = self.survey, self.plane
        for pick in range(len(survey.pick_frame)):
            f, k = int(survey.pick_frame[pick]), int(survey.pick_label[pick])
            self._add(
                self._pixel(pick, f, k), [self.point[k], self.frame[f], self.interior, plane], 2
            )
        for line in range(len(survey.line_start)):
            a, b = int(survey.line_start[line]), int(survey.line_end[line])
            self._add(self._length(line, a, b), [self.point[a], self.point[b], plane], 1)
        for thing in survey.known:
            blocks = [*(self.point[k] for k in thing.label), plane]
            known = self._known(thing)
            self._add(known, blocks, len(known(*blocks)))
        for row, k in enumerate(survey.control_label):
            self._add(self._control(row, int(k)), [self.point[k], plane], 3)
        for label in np.flatnonzero(self.departs & np.isfinite(self.departure_sigma_m)):
            self._add(self._stated(int(label)), [self.point[label]], 1)
        root = np.linalg.inv(np.linalg.cholesky(survey.calibration.covariance))
        scale = self.sigma["interior"]
        self._add(lambda interior: root @ (scale * interior), [self.interior], 9)
        if survey.gauge == "world":
            self._add(self._level, [plane], 3)
        else:
            self.problem.add_parameter_block(plane, 3)
            self.problem.set_parameter_block_constant(plane)
            self._add(self._gauge, [self.frame[0]], 3)
        if survey.telemetry is not None:
            for row, f in enumerate(survey.telemetry.frame_index):
                self._add(self._logged(row, int(f)), [self.frame[f], self.flight], 6)
            self._add(self._shared, [self.flight], 12)

    def _pixel(self, pick: int, f: int, k: int) -> Callable[..., ArrayLike]:
        survey = self.survey
        nominal, scale = survey.calibration.parameters, self.sigma["interior"]

        def residual(own: Floats, frame: Floats, interior: Floats, plane: Floats) -> Floats:
            fx, fy, cx, cy, *lens = nominal + scale * interior
            center, rotation = self.camera(f, frame)
            point = rotation.T @ (self.world(k, own, plane) - center)
            matrix = np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1.0]])
            pixel, _ = cv2.projectPoints(
                point[None], np.zeros(3), np.zeros(3), matrix, np.array(lens)
            )
            result: Floats = (pixel.ravel() - survey.pixel_px[pick]) / survey.pick_sigma_px[pick]
            return result

        return residual

    def _length(self, line: int, a: int, b: int) -> Callable[..., ArrayLike]:
        survey = self.survey

        def residual(first: Floats, second: Floats, plane: Floats) -> float:
            apart = self.world(a, first, plane) - self.world(b, second, plane)
            off = np.sqrt(apart @ apart) - survey.length_m[line]
            return float(off / survey.length_sigma_m[line])

        return residual

    def _known(self, thing: KnownThing) -> Callable[..., Floats]:
        on_ground = not self.survey.off_ground[list(thing.label)].any()

        def residual(*blocks: Floats) -> Floats:
            *own, plane = blocks
            found = zip(thing.label, own, strict=True)
            world = np.array([self.world(k, one, plane) for k, one in found])
            height, slope = self._plane(plane)
            feet = world.copy()
            feet[:, 2] = height + (world[:, :2] - self.pivot) @ slope
            return residuals(thing, world, feet, on_ground=on_ground)

        return residual

    def _control(self, row: int, k: int) -> Callable[..., ArrayLike]:
        survey = self.survey

        def residual(own: Floats, plane: Floats) -> Floats:
            off = self.world(k, own, plane) - survey.control_world_m[row]
            result: Floats = off / survey.control_sigma_m[row]
            return result

        return residual

    def _stated(self, k: int) -> Callable[..., ArrayLike]:
        return lambda own: self._departure(k, own) / self.departure_sigma_m[k]

    def _level(self, plane: Floats) -> list[float]:
        ground = self.survey.ground
        height, slope = self._plane(plane)
        return [
            (height - ground.height_m) / ground.height_sigma_m,
            *(slope / ground.slope_sigma_rad),
        ]

    def _gauge(self, frame: Floats) -> list[float]:
        center, rotation = self.camera(0, frame)
        return [center[0] / 1e-4, center[1] / 1e-4, rotation[0, 1] / 1e-6]

    def _flight(self, flight: Floats) -> Floats:
        return self.start.telemetry + self.sigma["flight"] * flight

    def _logged(self, row: int, f: int) -> Callable[..., ArrayLike]:
        prior, track = self.survey.telemetry, self.survey.track
        assert prior is not None
        assert isinstance(track, Track)
        white = np.linalg.inv(np.linalg.cholesky(prior.covariance[row]))
        here = np.argmin(np.abs(track.position_time_s - prior.time_s[row]))
        samples = slice(here // 4 * 4, here // 4 * 4 + 4)  # a straight and steady way, see `scenes`
        time, place = track.position_time_s[samples], track.position_world_m[samples]
        turns = Rotation.from_quat(track.world_from_body_xyzw[samples])
        velocity = (place[3] - place[0]) / (time[3] - time[0])
        rate = (turns[0].inv() * turns[3]).as_rotvec() / (time[3] - time[0])

        def residual(frame: Floats, flight: Floats) -> Floats:
            shared = self._flight(flight)
            since = prior.time_s[row] - prior.middle_s
            at = prior.time_s[row] - shared[10] - shared[11] * since - time[0]
            heading = Rotation.from_euler("z", shared[9])
            body = heading * turns[0] * Rotation.from_rotvec(rate * at)
            expected = place[0] + velocity * at - shared[6:9] + body.apply(shared[3:6])
            mount = Rotation.from_matrix(prior.gimbal_from_camera)
            predicted = body * mount * Rotation.from_rotvec(shared[:3])
            center, rotation = self.camera(f, frame)
            turned = (predicted.inv() * Rotation.from_matrix(rotation)).as_rotvec()
            result: Floats = white @ np.concatenate([center - expected, turned])
            return result

        return residual

    def _shared(self, flight: Floats) -> Floats:
        prior = self.survey.telemetry
        assert prior is not None
        mean = np.zeros(12)
        mean[3:6] = prior.lever_arm_m
        sigma = [prior.boresight_sigma_rad] * 3 + [prior.lever_arm_sigma_m] * 3
        sigma += [*prior.position_bias_sigma_m, prior.heading_bias_sigma_rad]
        sigma += [prior.clock_sigma_s, prior.clock_drift_sigma]
        return (self._flight(flight) - mean) / sigma

    def blocks(self) -> list[Floats]:
        """Parameter blocks in the order of the package's unknowns."""
        found = [*self.point, *self.frame, self.interior]
        found += [self.plane] if self.survey.gauge == "world" else []
        return found + ([self.flight] if self.survey.telemetry is not None else [])

    def solve(self) -> tuple[Floats, Floats, float]:
        """Minimise from an offset of half a sigma; unknowns and their sigmas, in sigmas."""
        rng = np.random.default_rng(5)
        for block in self.blocks():
            block[:] = 0.5 * rng.normal(size=len(block))
        options = pyceres.SolverOptions()
        options.linear_solver_type = pyceres.LinearSolverType.DENSE_QR
        options.function_tolerance = options.parameter_tolerance = 1e-16
        options.gradient_tolerance = 1e-16
        options.max_num_iterations = 100
        options.logging_type = pyceres.LoggingType.SILENT
        summary = pyceres.SolverSummary()
        pyceres.solve(options, self.problem, summary)
        covariance = pyceres.Covariance(pyceres.CovarianceOptions())
        blocks = self.blocks()
        assert covariance.compute([(block, block) for block in blocks], self.problem)
        parts = [covariance.get_covariance_block(block, block) for block in blocks]
        sigma = np.concatenate([np.sqrt(np.diag(part)) for part in parts])
        return np.concatenate(blocks), sigma, 2 * summary.final_cost
