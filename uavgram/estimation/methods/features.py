"""One photo's pose by whatever is known of its features, by maximum likelihood, many at once.

The likelihood of a survey (`estimation.survey`) with one photo on level ground and a lens that is
known: the pose and the ground points are unknown, picks are observed, and some of what follows:
where points are, on what line they lie, how far two are apart, where a log has the camera. The
points of one feature hang on the pose and on each other alone, so they are eliminated feature by
feature.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from uavgram.estimation.methods.damped import Linear, State, pose_moved
from uavgram.geometry.camera.back_projection import back_project_with_jacobian
from uavgram.geometry.camera.projection import project_with_jacobian
from uavgram.geometry.ground.plane import intersect_ground_with_jacobian
from uavgram.geometry.motion.rotation import hat, log_so3, right_jacobian_inverse
from uavgram.model.arrays import Bools, Floats, Ints
from uavgram.model.camera.calibration import Calibration

LEAST_INFORMATION = 1e-9
"""Of a ground point's coordinates [1/m^2], where a pose that a step tried shows nothing of it."""


@dataclass(frozen=True, eq=False)
class Logged:
    """Where a log has each photo: (B, 3), (B, 3, 3); sigmas (6,) of centre [m], rotation [rad]."""

    center: Floats
    rotation: Floats
    sigma: Floats


@dataclass(frozen=True, eq=False)
class FeatureRows:
    """n features, lines with two picked ends each, in each of B photos.

    Attributes
    ----------
    calibration
        The lens; it counts as known exactly.
    pixel_px, pick_sigma_px
        (B, n, 2, 2) picks of start and end, and sigma of each coordinate.
    place_m, place_sigma_m
        (B, n, 2, 2) stated places of start and end.
    length_m, length_sigma_m
        (B, n) taped.
    start_place, start_on_line, end_on_line, length
        What is observed: the start's place; that the start, that the end lies on the line; the
        length.
    logged
        Where a log has the photos.
    held
        Centres (B, 3) and rotations (B, 3, 3) whose east, north and heading the poses keep, where
        nothing observed tells them.
    """

    calibration: Calibration
    pixel_px: Floats
    pick_sigma_px: float
    place_m: Floats
    place_sigma_m: float
    length_m: Floats
    length_sigma_m: float
    start_place: bool = False
    start_on_line: bool = False
    end_on_line: bool = False
    length: bool = False
    logged: Logged | None = None
    held: tuple[Floats, Floats] | None = None

    @property
    def degrees(self) -> int:
        """Degrees of freedom of each photo."""
        own = 2 * self.start_place + self.start_on_line + self.end_on_line + self.length
        given = 6 if self.logged is not None else 3 if self.held is not None else 0
        return int(own * self.pixel_px.shape[1] + given - 6)

    def linearised(self, which: Ints, state: State) -> Linear:
        """Normal equations of the poses, the points eliminated.

        With pose p and points q of a feature, N = [[A, B], [B^T, C]] and right side (a, c): the
        pose has A - sum B C^-1 B^T and a - sum B C^-1 c, and q moves by -C^-1 (c + B^T p).
        """
        center, rotation, point = state
        miss, by_pose, by_point = self._picks(which, center, rotation, point)
        cost = np.sum(miss**2, axis=(1, 2, 3))
        count = point.shape[:2]
        a = np.einsum("bneri,bnerj->bij", by_pose, by_pose)
        a_right = np.einsum("bneri,bner->bi", by_pose, miss)
        b = np.einsum("bneri,bnerk->bniek", by_pose, by_point).reshape(*count, 6, 4)
        c = np.zeros((*count, 4, 4))
        own = np.einsum("bneri,bnerk->bneik", by_point, by_point)
        c[..., :2, :2], c[..., 2:, 2:] = own[:, :, 0], own[:, :, 1]
        c_right = np.einsum("bneri,bner->bnei", by_point, miss).reshape(*count, 4)
        for off, gradient in self._stated(which, point):
            cost = cost + np.sum(off**2, axis=1)
            c += gradient[..., :, None] * gradient[..., None, :]
            c_right += gradient * off[..., None]
        there = np.isfinite(cost)
        c += LEAST_INFORMATION * np.eye(4)
        inverse = np.linalg.inv(np.where(there[:, None, None, None], c, np.eye(4)))
        gone = b @ inverse
        normal = a - np.einsum("bnik,bnjk->bij", gone, b)
        slope = a_right - np.einsum("bnik,bnk->bi", gone, c_right)
        for off, gradient in self._of_pose(which, center, rotation):
            cost = cost + np.sum(off**2, axis=1)
            normal = normal + gradient.swapaxes(1, 2) @ gradient
            slope = slope + (gradient.swapaxes(1, 2) @ off[..., None])[..., 0]
        return Linear(cost, normal, slope, ((inverse @ c_right[..., None])[..., 0], gone))

    def moved(self, state: State, linear: Linear, step: Floats) -> State:
        """Poses after steps, and the points that follow.

        Parameters
        ----------
        state
            Of b problems.
        linear
            As it was linearised there.
        step
            (b, 6) of centre [m] and rotation [rad].
        """
        alone, gone = linear.rest
        points = -alone - np.einsum("bnik,bi->bnk", gone, step)
        return (*pose_moved(state, step), state[2] + points.reshape(state[2].shape))

    def _picks(
        self, which: Ints, center: Floats, rotation: Floats, point: Floats
    ) -> tuple[Floats, Floats, Floats]:
        """Residuals (b, n, 2, 2) over their sigma, and derivatives by pose and by own point.

        NaN where a point lies behind its camera, or the camera below the ground.
        """
        world = np.concatenate([point, np.zeros((*point.shape[:3], 1))], axis=-1)
        turn = rotation[:, None, None]
        camera = (turn.swapaxes(-1, -2) @ (world - center[:, None, None])[..., None])[..., 0]
        before = (camera[..., 2] > 0).all(axis=(1, 2)) & (center[:, 2] > 0)
        camera = np.where(before[:, None, None, None], camera, np.nan)
        lens = self.calibration
        pixel, by_camera, _ = project_with_jacobian(lens.model, lens.parameters, camera)
        weight = 1.0 / self.pick_sigma_px
        by_world = by_camera @ turn.swapaxes(-1, -2)
        by_pose = np.concatenate([-by_world, by_camera @ hat(camera)], axis=-1)
        miss = (pixel - self.pixel_px[which]) * weight
        return miss, by_pose * weight, by_world[..., :2] * weight

    def _stated(self, which: Ints, point: Floats) -> list[tuple[Floats, Floats]]:
        """Rows that hang on the points alone: residuals (b, n) and gradients (b, n, 4)."""
        rows = []
        place = self.place_m[which]
        weight = 1.0 / self.place_sigma_m
        if self.start_place:
            for axis in range(2):
                gradient = np.zeros((*point.shape[:2], 4))
                gradient[..., axis] = weight
                rows.append(((point[:, :, 0, axis] - place[:, :, 0, axis]) * weight, gradient))
        along = place[:, :, 1] - place[:, :, 0]
        along = along / np.linalg.norm(along, axis=2, keepdims=True)
        across = np.stack([-along[..., 1], along[..., 0]], axis=-1)
        for end, used in enumerate((self.start_on_line, self.end_on_line)):
            if used:
                gradient = np.zeros((*point.shape[:2], 4))
                gradient[..., 2 * end : 2 * end + 2] = across * weight
                off = np.sum((point[:, :, end] - place[:, :, end]) * across, axis=2)
                rows.append((off * weight, gradient))
        if self.length:
            away = point[:, :, 1] - point[:, :, 0]
            length = np.linalg.norm(away, axis=2)
            unit = away / np.maximum(length, 1e-12)[..., None]
            gradient = np.concatenate([-unit, unit], axis=2) / self.length_sigma_m
            rows.append(((length - self.length_m[which]) / self.length_sigma_m, gradient))
        return rows

    def _of_pose(
        self, which: Ints, center: Floats, rotation: Floats
    ) -> list[tuple[Floats, Floats]]:
        """Rows that hang on the pose alone: residuals (b, r) and gradients (b, r, 6)."""
        rows = []
        if self.logged is not None:
            rows.append(_off_pose(self.logged, which, center, rotation))
        if self.held is not None:  # nothing else notices these three: they are met exactly
            at, turn = self.held[0][which], self.held[1][which]
            off = np.zeros((len(which), 3))
            off[:, :2] = (center - at)[:, :2]
            away = log_so3(rotation @ turn.swapaxes(1, 2))
            off[:, 2] = away[:, 2]
            gradient = np.zeros((len(which), 3, 6))
            gradient[:, 0, 0] = gradient[:, 1, 1] = 1.0
            # exp(v) R = R_0-turned: a turn a behind R is R a before it
            gradient[:, 2, 3:] = (right_jacobian_inverse(-away) @ rotation)[:, 2]
            rows.append((off, gradient))
        return rows


def _off_pose(
    logged: Logged, which: Ints, center: Floats, rotation: Floats
) -> tuple[Floats, Floats]:
    turn = log_so3(logged.rotation[which].swapaxes(1, 2) @ rotation)
    off = np.concatenate([center - logged.center[which], turn], axis=1) / logged.sigma
    gradient = np.zeros((len(which), 6, 6))
    gradient[:, :3, :3] = np.eye(3)
    gradient[:, 3:, 3:] = right_jacobian_inverse(turn)
    return off, gradient / logged.sigma[:, None]


def first_points(rows: FeatureRows, center: Floats, rotation: Floats) -> tuple[Floats, Bools]:
    """Ground points (B, n, 2, 2) of the picks under poses, and whether all reach the ground.

    Parameters
    ----------
    rows
        What is observed.
    center, rotation
        (B, 3), (B, 3, 3).
    """
    point, _, _ = ground_points(rows.calibration, rows.pixel_px, center, rotation)
    good: Bools = np.all(np.isfinite(point), axis=(1, 2, 3))
    return np.where(good[:, None, None, None], point, 0.0), good


def ground_points(
    calibration: Calibration, pixel_px: Floats, center: Floats, rotation: Floats
) -> tuple[Floats, Floats, Floats]:
    """Where picks meet the ground z = 0.

    Parameters
    ----------
    calibration
        The lens.
    pixel_px
        (B, ..., 2).
    center, rotation
        (B, 3), (B, 3, 3).

    Returns
    -------
    point : (B, ..., 2)
        NaN where a ray does not go down to the ground.
    by_pose : (B, ..., 2, 6)
    by_pixel : (B, ..., 2, 2)
    """
    more = (1,) * (pixel_px.ndim - 2)
    turn, start = rotation.reshape(-1, *more, 3, 3), center.reshape(-1, *more, 3)
    ray, by_pixel, _ = back_project_with_jacobian(
        calibration.model, calibration.parameters, pixel_px
    )
    world = (turn @ ray[..., None])[..., 0]
    point, by_center, by_world, _ = intersect_ground_with_jacobian(
        np.broadcast_to(start, world.shape), world, np.zeros(3), np.zeros(2)
    )
    by_ray = by_world @ turn
    by_pose = np.concatenate([by_center, -by_ray @ hat(ray)], axis=-1)
    return point[..., :2], by_pose[..., :2, :], (by_ray @ by_pixel)[..., :2, :]
