"""Poses of many photos at once, by maximum likelihood from observations of their points.

One problem for initial poses, for single photos and for the comparison of methods; `minimise_each`
(`estimation.solver.batched`) solves it for B photos together. The unknowns are the pose of each
photo and, where picks are observations, the ground points of its own lines, which are eliminated
line by line. The observations are kinds of rows:

* `FeatureRows`: pixels of points on level ground, with any of: stated places, lines through the
  points, taped lengths, a log's pose;
* `LineRows`: rays that end on lines of known position, the points eliminated beforehand;
* `RayRows`: rays to points of known position.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from uavgram.estimation.solver.batched import Linearisation, State, compute_normal_equations
from uavgram.geometry.camera.back_projection import back_project_with_jacobian
from uavgram.geometry.camera.projection import project_with_jacobian
from uavgram.geometry.ground.plane import intersect_ground_with_jacobian
from uavgram.geometry.motion.rotation import exp_so3, hat, log_so3, right_jacobian_inverse
from uavgram.model.arrays import Bools, Floats, Ints
from uavgram.model.camera.calibration import Calibration

MIN_INFORMATION = 1e-9
"""Information on a ground point's coordinates [1/m^2] that is added in case a trial pose shows
nothing of it."""


def move_poses(state: State, step: Floats) -> State:
    """Apply steps (b, 6), centre [m] and rotation behind that of the photo [rad], to poses."""
    return state[0] + step[:, :3], state[1] @ exp_so3(step[:, 3:])


class PoseRows:
    """Rows of poses alone: centres (b, 3) [m], rotations (b, 3, 3) world from camera."""

    axis = 0

    def rows(self, which: Ints, state: State) -> tuple[Floats, Floats]:
        """Compute residuals (b, r), Jacobians (b, r, 6) by centre, rotation of photos (b,)."""
        raise NotImplementedError

    def linearise(self, which: Ints, state: State) -> Linearisation:
        """Compute the normal equations of photos (b,) at a state."""
        return compute_normal_equations(*self.rows(which, state))

    def move(self, state: State, linear: Linearisation, step: Floats) -> State:  # noqa: ARG002
        """Apply steps to poses.

        Parameters
        ----------
        state
            State of b problems.
        linear
            Linearisation at this state.
        step
            (b, 6) of centre [m] and rotation [rad].
        """
        return move_poses(state, step)


@dataclass(frozen=True, eq=False)
class LoggedPoses:
    """Logged pose of each photo: (B, 3), (B, 3, 3); sigmas (6,) of centre [m], rotation [rad]."""

    center: Floats
    rotation: Floats
    sigma: Floats


@dataclass(frozen=True, eq=False)
class FeatureRows:
    """Features, n lines with two picked ends each, in each of B photos.

    Attributes
    ----------
    calibration
        Calibration of the lens, assumed exact.
    pixel_px, pick_sigma_px
        (B, n, 2, 2) picks of start and end, and sigma of each coordinate.
    place_m, place_sigma_m
        (B, n, 2, 2) stated places of start and end.
    length_m, length_sigma_m
        (B, n) taped lengths.
    start_place, start_on_line, end_on_line, length
        Flags of the observations: the place of the start; that the start, or the end, is on the
        line; the length.
    logged
        Logged poses of the photos.
    held
        Centres (B, 3) and rotations (B, 3, 3) whose east, north and heading the poses keep, where
        no observation determines them.
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
    logged: LoggedPoses | None = None
    held: tuple[Floats, Floats] | None = None
    axis: int = 0

    @property
    def degrees(self) -> int:
        """Degrees of freedom of each photo."""
        own = 2 * self.start_place + self.start_on_line + self.end_on_line + self.length
        given = 6 if self.logged is not None else 3 if self.held is not None else 0
        return int(own * self.pixel_px.shape[1] + given - 6)

    def linearise(self, which: Ints, state: State) -> Linearisation:
        """Compute the normal equations of the poses, with the points eliminated.

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
        of_picks = np.einsum("bneri,bnerk->bneik", by_point, by_point)
        c[..., :2, :2], c[..., 2:, 2:] = of_picks[:, :, 0], of_picks[:, :, 1]
        c_right = np.einsum("bneri,bner->bnei", by_point, miss).reshape(*count, 4)
        for off, by_ends in self._stated(which, point):
            cost = cost + np.sum(off**2, axis=1)
            c += by_ends[..., :, None] * by_ends[..., None, :]
            c_right += by_ends * off[..., None]
        there = np.isfinite(cost)
        c += MIN_INFORMATION * np.eye(4)
        # Schur complement: eliminate the points of each feature.
        inverse = np.linalg.inv(np.where(there[:, None, None, None], c, np.eye(4)))
        gone = b @ inverse
        normal = a - np.einsum("bnik,bnjk->bij", gone, b)
        gradient = a_right - np.einsum("bnik,bnk->bi", gone, c_right)
        for rows in self._of_pose(which, center, rotation):
            own = compute_normal_equations(*rows)
            cost, normal, gradient = cost + own.cost, normal + own.normal, gradient + own.gradient
        return Linearisation(cost, normal, gradient, ((inverse @ c_right[..., None])[..., 0], gone))

    def move(self, state: State, linear: Linearisation, step: Floats) -> State:
        """Apply steps to the poses, and the resulting steps to the eliminated points.

        Parameters
        ----------
        state
            State of b problems.
        linear
            Linearisation at this state.
        step
            (b, 6) of centre [m] and rotation [rad].
        """
        alone, gone = linear.rest
        points = -alone - np.einsum("bnik,bi->bnk", gone, step)
        return (*move_poses(state, step), state[2] + points.reshape(state[2].shape))

    def _picks(
        self, which: Ints, center: Floats, rotation: Floats, point: Floats
    ) -> tuple[Floats, Floats, Floats]:
        """Compute residuals (b, n, 2, 2) over their sigma, and derivatives by pose and own point.

        NaN if a point is behind its camera, or the camera below the ground.
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
        """Compute rows of the points alone: residuals (b, n) and gradients (b, n, 4)."""
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
        # Unit vectors perpendicular to the stated lines: distance of an end from its line.
        across = np.stack([-along[..., 1], along[..., 0]], axis=-1)
        for end, used in enumerate((self.start_on_line, self.end_on_line)):
            if used:
                gradient = np.zeros((*point.shape[:2], 4))
                gradient[..., 2 * end : 2 * end + 2] = across * weight
                off = np.sum((point[:, :, end] - place[:, :, end]) * across, axis=2)
                rows.append((off * weight, gradient))
        # Length between the ends: gradient minus and plus the unit vector.
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
        """Compute rows of the pose alone: residuals (b, r) and gradients (b, r, 6)."""
        rows = []
        if self.logged is not None:
            rows.append(_off_pose(self.logged, which, center, rotation))
        if self.held is not None:  # no other row depends on these three: they are met exactly
            at, turn = self.held[0][which], self.held[1][which]
            off = np.zeros((len(which), 3))
            off[:, :2] = (center - at)[:, :2]
            away = log_so3(rotation @ turn.swapaxes(1, 2))
            off[:, 2] = away[:, 2]
            gradient = np.zeros((len(which), 3, 6))
            gradient[:, 0, 0] = gradient[:, 1, 1] = 1.0
            # For R = exp(v) R_0: a turn a behind R is the turn R a before it.
            gradient[:, 2, 3:] = (right_jacobian_inverse(-away) @ rotation)[:, 2]
            rows.append((off, gradient))
        return rows


def _off_pose(
    logged: LoggedPoses, which: Ints, center: Floats, rotation: Floats
) -> tuple[Floats, Floats]:
    turn = log_so3(logged.rotation[which].swapaxes(1, 2) @ rotation)
    off = np.concatenate([center - logged.center[which], turn], axis=1) / logged.sigma
    gradient = np.zeros((len(which), 6, 6))
    gradient[:, :3, :3] = np.eye(3)
    gradient[:, 3:, 3:] = right_jacobian_inverse(turn)
    return off, gradient / logged.sigma[:, None]


def intersect_ground_picks(
    rows: FeatureRows, center: Floats, rotation: Floats
) -> tuple[Floats, Bools]:
    """Compute ground points (B, n, 2, 2) of the picks under poses; mark photos where all exist.

    Parameters
    ----------
    rows
        Observations.
    center, rotation
        (B, 3), (B, 3, 3).
    """
    point, _, _ = intersect_ground_rays(rows.calibration, rows.pixel_px, center, rotation)
    good: Bools = np.all(np.isfinite(point), axis=(1, 2, 3))
    return np.where(good[:, None, None, None], point, 0.0), good


def intersect_ground_rays(
    calibration: Calibration, pixel_px: Floats, center: Floats, rotation: Floats
) -> tuple[Floats, Floats, Floats]:
    """Intersect the rays of picks with the ground z = 0.

    Parameters
    ----------
    calibration
        Calibration of the lens.
    pixel_px
        (B, ..., 2).
    center, rotation
        (B, 3), (B, 3, 3).

    Returns
    -------
    point : (B, ..., 2)
        NaN if a ray does not go down to the ground.
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


@dataclass(frozen=True, eq=False)
class LineRows(PoseRows):
    """Picks on lines, N in each of B photos, over ground at z = 0.

    Attributes
    ----------
    ray
        (B, N, 3) undistorted, z = 1.
    ray_root
        (B, N, 2, 2) L with L L^T the covariance of x and y of each ray.
    start_m, along
        (B, N, 2) a place on the line of each, and the line's unit vector.
    sigma_m
        (B, N) sigma of the line's place, perpendicular to it.
    """

    ray: Floats
    ray_root: Floats
    start_m: Floats
    along: Floats
    sigma_m: Floats

    def of_photos(self, photo: Ints) -> LineRows:
        """Return the rows of photos (b,), which may repeat."""
        return LineRows(
            self.ray[photo],
            self.ray_root[photo],
            self.start_m[photo],
            self.along[photo],
            self.sigma_m[photo],
        )

    @property
    def across(self) -> Floats:
        """(B, N, 2) unit vectors perpendicular to the lines, to the left."""
        return np.stack([-self.along[..., 1], self.along[..., 0]], axis=-1)

    def rows(self, which: Ints, state: State) -> tuple[Floats, Floats]:
        """Compute distances (b, N) of picks from the images of their lines, over their sigmas.

        NaN if a ray does not go down to the ground. The Jacobian (b, N, 6) is by centre [m] and
        rotation [rad].

        Notes
        -----
        A ray d (world) through the line at A along u: m . d = 0 with m = u x (A - C), the normal of
        the plane through camera and line. Its variance is that of the ray, and that of the line,
        which moves it by d_z; with both the quotient is the distance in sigmas to first order
        (Sampson 1982).

        Lines do not distinguish a camera from its mirror image below the ground: they look the same
        from (x, y, -z), as rays have no direction on them (Xu, Zhang, Cheng and Koch 2017, "Pose
        estimation from line correspondences: a complete analysis and a series of solutions", on
        signs of the depth). Here rays go forward to the ground below the camera, which excludes the
        mirror image.
        """
        center, rotation = state[:2]
        ray, root, turn = self.ray[which], self.ray_root[which], rotation[:, None]
        along = np.zeros(ray.shape)
        along[..., :2] = self.along[which]
        away = -np.broadcast_to(center[:, None], ray.shape)
        away = away + np.concatenate([self.start_m[which], ray[..., 2:] * 0.0], axis=-1)
        # Normal of the plane through camera and line, in the camera's axes.
        normal = _turned_back(turn, np.cross(along, away))
        world = (turn @ ray[..., None])[..., 0]
        down = np.where((world[..., 2] < 0) & (center[:, 2:] > 0), world[..., 2], np.nan)
        miss = np.sum(normal * ray, axis=-1)
        by_noise = (root.swapaxes(-1, -2) @ normal[..., :2, None])[..., 0]
        variance = np.sum(by_noise**2, axis=-1) + (self.sigma_m[which] * down) ** 2
        miss_by = np.concatenate([-np.cross(world, along), np.cross(ray, normal)], axis=-1)
        # d normal / d centre = -R^T hat(u), / d rotation = hat(normal)
        normal_by = np.concatenate([-turn.swapaxes(-1, -2) @ hat(along), hat(normal)], axis=-1)
        half = np.einsum("bnij,bnj,bnik->bnk", root, by_noise, normal_by[..., :2, :])
        down_by = -(turn @ hat(ray))[..., 2, :]
        half[..., 3:] += (self.sigma_m[which] ** 2 * down)[..., None] * down_by
        residual = miss / np.sqrt(variance)
        jacobian = miss_by / np.sqrt(variance)[..., None]
        jacobian -= (residual / variance)[..., None] * half
        return residual, jacobian


def _turned_back(turn: Floats, vectors: Floats) -> Floats:
    return np.asarray((turn.swapaxes(-1, -2) @ vectors[..., None])[..., 0])


@dataclass(frozen=True, eq=False)
class RayRows(PoseRows):
    """Rays to points of known position, N in each of B photos.

    Attributes
    ----------
    ray
        (B, N, 3) unit vectors in the camera.
    across
        (B, N, 2, 3) rows normal to the rays that convert small differences of unit vectors into
        sigmas; zero for rays without weight.
    world_m
        (B, N, 3) points.
    """

    ray: Floats
    across: Floats
    world_m: Floats

    def rows(self, which: Ints, state: State) -> tuple[Floats, Floats]:
        """Compute residuals of rays in sigmas (b, 2 N), and Jacobians (b, 2 N, 6).

        NaN if a point with weight is not before its camera.
        """
        residual, by_point, by_turn = compute_ray_residuals(
            self.ray[which], self.across[which], self.world_m[which], (state[0], state[1])
        )
        jacobian = np.concatenate([-by_point, by_turn], axis=-1)
        return residual.reshape(len(which), -1), jacobian.reshape(len(which), -1, 6)


def compute_across_axes(ray: Floats) -> Floats:
    """Return two unit vectors (..., 2, 3) perpendicular to a third (..., 3) and to each other."""
    least = np.eye(3)[np.argmin(np.abs(ray), axis=-1)]
    first = np.cross(ray, least)
    first /= np.linalg.norm(first, axis=-1, keepdims=True)
    return np.stack([first, np.cross(ray, first)], axis=-2)


def compute_ray_residuals(
    ray: Floats, across: Floats, world_m: Floats, pose: tuple[Floats, Floats]
) -> tuple[Floats, Floats, Floats]:
    """Compute residuals of rays against points, and their derivatives.

    Parameters
    ----------
    ray, across, world_m
        (..., N, 3), (..., N, 2, 3), (..., N, 3) as in `RayRows`.
    pose
        (..., 3), (..., 3, 3) centre and rotation of the camera, world from camera.

    Returns
    -------
    residual : (..., N, 2)
        NaN behind the camera.
    by_point, by_turn : (..., N, 2, 3)
        By the point, or minus the centre [1/m]; by a rotation behind that of the camera [1/rad].
    """
    center, rotation = pose[0][..., None, :], pose[1][..., None, :, :]
    seen = ((world_m - center)[..., None, :] @ rotation)[..., 0, :]
    distance = np.linalg.norm(seen, axis=-1, keepdims=True)
    behind = (np.sum(seen * ray, axis=-1) <= 0.0) & (across != 0.0).any(axis=(-2, -1))
    seen = np.where(behind[..., None], np.nan, seen / distance)
    # Across is normal to the ray, and (I - seen seen^T) hat(seen) = hat(seen).
    onto = across - (across @ seen[..., None]) * seen[..., None, :]
    by_point = onto @ rotation.swapaxes(-1, -2) / distance[..., None]
    return (across @ seen[..., None])[..., 0], by_point, across @ hat(seen)
