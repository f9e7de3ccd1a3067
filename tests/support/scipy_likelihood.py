"""The likelihood of a survey without ties, written anew with OpenCV and scipy's rotations."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import scenes
from scipy.spatial.transform import Rotation, Slerp

from uavgram.estimation.survey.unknowns import State
from uavgram.model.arrays import Floats
from uavgram.model.flight_log import Track
from uavgram.model.survey import Survey


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


def central(function: Callable[[Floats], Floats], x: Floats) -> Floats:
    """Fourth-order central differences, a hundredth of a sigma apart."""
    columns = []
    for step in 1e-2 * np.eye(len(x)):
        near = function(x + step) - function(x - step)
        far = function(x + 2 * step) - function(x - 2 * step)
        columns.append((8 * near - far) / (12 * 1e-2))
    return np.stack(columns, axis=1)
