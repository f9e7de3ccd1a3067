"""Poses of photos from known points, by maximum likelihood, and the picks that agree on one pose.

`minimise_each` (`estimation.solver.batched`) solves the problem for B photos together. The unknowns
are the pose of each photo. The observations are:

* `LineRows`: rays that end on lines of known position, the points eliminated beforehand;
* `make_ray_problem`: rays to points of known position.

Photos whose picks are observations of ground points are adjusted in
`estimation/repeated/single_photo.py`.

Consensus of the smallest sets of picks that determine a pose (Fischler and Bolles 1981, "Random
sample consensus"), here all of these sets or a fixed sample.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations
from math import comb
from typing import NamedTuple

import numpy as np

from uavgram.estimation.solver.batched import ExplicitProblem, Minima, State, minimise_each
from uavgram.estimation.survey.adjustment import Adjustment
from uavgram.geometry.camera.projection import back_project
from uavgram.geometry.ground.plane import factor_homographies, make_homography_rows, mirror_plane
from uavgram.geometry.motion.rotation import cross, exp_so3, hat
from uavgram.model.arrays import Bools, Floats, Ints
from uavgram.model.survey import Survey


def move_poses(state: State, step: Floats) -> State:
    """Apply steps (b, 6), centre [m] and rotation behind that of the photo [rad], to poses."""
    return state[0] + step[:, :3], state[1] @ exp_so3(step[:, 3:])


class LineRows(NamedTuple):
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
        return LineRows(*(column[photo] for column in self))

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
        normal = _rotate_back(turn, cross(along, away))
        world = (turn @ ray[..., None])[..., 0]
        down = np.where((world[..., 2] < 0) & (center[:, 2:] > 0), world[..., 2], np.nan)
        miss = np.sum(normal * ray, axis=-1)
        by_noise = (root.swapaxes(-1, -2) @ normal[..., :2, None])[..., 0]
        variance = np.sum(by_noise**2, axis=-1) + (self.sigma_m[which] * down) ** 2
        miss_by = np.concatenate([-cross(world, along), cross(ray, normal)], axis=-1)
        # d normal / d centre = -R^T hat(u), / d rotation = hat(normal)
        normal_by = np.concatenate([-turn.swapaxes(-1, -2) @ hat(along), hat(normal)], axis=-1)
        half = np.einsum("bnij,bnj,bnik->bnk", root, by_noise, normal_by[..., :2, :])
        down_by = -(turn @ hat(ray))[..., 2, :]
        half[..., 3:] += (self.sigma_m[which] ** 2 * down)[..., None] * down_by
        residual = miss / np.sqrt(variance)
        jacobian = miss_by / np.sqrt(variance)[..., None]
        jacobian -= (residual / variance)[..., None] * half
        return residual, jacobian


def _rotate_back(turn: Floats, vectors: Floats) -> Floats:
    return np.asarray((turn.swapaxes(-1, -2) @ vectors[..., None])[..., 0])


def make_ray_problem(ray: Floats, across: Floats, world_m: Floats) -> ExplicitProblem:
    """Return the problem of photos with rays to points of known position.

    Parameters
    ----------
    ray
        (B, N, 3) unit vectors in the camera.
    across
        (B, N, 2, 3) rows normal to the rays that convert small differences of unit vectors into
        sigmas; zero for rays without weight.
    world_m
        (B, N, 3) points.
    """

    def rows(which: Ints, state: State) -> tuple[Floats, Floats]:
        residual, by_point, by_turn = compute_ray_residuals(
            ray[which], across[which], world_m[which], (state[0], state[1])
        )
        jacobian = np.concatenate([-by_point, by_turn], axis=-1)
        return residual.reshape(len(which), -1), jacobian.reshape(len(which), -1, 6)

    return ExplicitProblem(rows, move_poses)


def compute_across_axes(ray: Floats) -> Floats:
    """Return two unit vectors (..., 2, 3) perpendicular to a third (..., 3) and to each other."""
    least = np.eye(3)[np.argmin(np.abs(ray), axis=-1)]
    first = cross(ray, least)
    first /= np.linalg.norm(first, axis=-1, keepdims=True)
    return np.stack([first, cross(ray, first)], axis=-2)


def compute_ray_residuals(
    ray: Floats, across: Floats, world_m: Floats, pose: tuple[Floats, Floats]
) -> tuple[Floats, Floats, Floats]:
    """Compute residuals of rays against points, and their derivatives.

    Parameters
    ----------
    ray, across, world_m
        (..., N, 3), (..., N, 2, 3), (..., N, 3) as in `make_ray_problem`.
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


Pose = tuple[Floats, Floats]
"""Centre (3,) in the axes of the plane [m], and rotation (3, 3), plane from camera."""

MAX_ITERATIONS = 20
"""Number of iterations."""

MIN_SINGULAR_RATIO = 1e-9
"""Ratio of the second smallest to the largest singular value below which the points are in line."""


def resect_from_plane(point_m: Floats, ray: Floats) -> Pose | None:
    """Estimate the pose of a camera from points on the plane z = 0, as `resect_each`.

    None if the points do not determine it, or a ray or a point is not finite.
    """
    center, plane_from_camera = resect_each(point_m, ray)
    return (center, plane_from_camera) if np.isfinite(center).all() else None


def resect_each(point_m: Floats, ray: Floats) -> Pose:
    """Estimate the poses of many cameras from points on the plane z = 0.

    Parameters
    ----------
    point_m
        (..., N, 2) plane coordinates, N >= 4, not all but one in line.
    ray
        (..., N, 3) undistorted rays in the camera frame, z = 1.

    Returns
    -------
    center_m : (..., 3)
        In the axes of the plane; NaN if the points do not determine the pose, or a ray or a point
        is not finite.
    plane_from_camera : (..., 3, 3)

    Notes
    -----
    Direct linear transformation of the homography with normalised coordinates (Hartley and
    Zisserman 2004, algorithm 4.2), and its factorisation by orthonormality (Zhang 2000, sec. 3.1).
    """
    mean = point_m.mean(axis=-2)
    off = point_m - mean[..., None, :]
    size = np.sqrt(np.mean(np.sum(off**2, axis=-1), axis=-1))
    scaled = off / np.where(size > 0.0, size, 1.0)[..., None, None]
    rows = make_homography_rows(np.broadcast_to(scaled, (*ray.shape[:-1], 2)), ray[..., :2])
    is_finite = np.isfinite(rows).all(axis=(-2, -1))  # otherwise a ray beyond the lens
    rows[~is_finite] = 0.0
    _, singular, vectors = np.linalg.svd(rows)
    second = singular[..., -2 if singular.shape[-1] == 9 else -1]
    is_determined = (second >= MIN_SINGULAR_RATIO * singular[..., 0]) & is_finite
    homography = vectors[..., -1, :].reshape(*is_finite.shape, 3, 3)
    camera_from_plane, origin = factor_homographies(homography)
    plane_from_camera = camera_from_plane.swapaxes(-1, -2)
    center = -(plane_from_camera @ origin[..., None])[..., 0] * size[..., None]
    center[..., :2] += mean
    return np.where(is_determined[..., None], center, np.nan), plane_from_camera


def find_second_pose(pose: Pose, point_m: Floats) -> Pose:
    """Compute the second pose that shows points of the plane z = 0 (N, 2) nearly alike."""
    center, plane_from_camera = pose
    middle = np.array([*point_m.mean(axis=0), 0.0])
    sight = plane_from_camera.T @ (middle - center)
    turned = mirror_plane(plane_from_camera.T, sight).T
    return middle - turned @ sight, turned


def refine_pose(
    starts: Sequence[Pose], world_m: Floats, ray: Floats, sigma: Floats
) -> tuple[float, Pose] | None:
    """Refine a pose to the best fit of the rays, and return its sum of squares with it.

    Parameters
    ----------
    starts
        Initial poses, all refined together; the best end is returned.
    world_m
        (N, 3) points on the plane z = 0 or near it.
    ray
        (N, 3) undistorted, z = 1.
    sigma
        (N,) of their x and y.

    Returns
    -------
    None
        If at each end a point is not before the camera, or the camera not above the plane.
    """
    count = len(starts)
    each = (np.broadcast_to(one, (count, *one.shape)) for one in (world_m, ray, sigma))
    center, rotation = (np.stack(part) for part in zip(*starts, strict=True))
    ends = _refine_each((center, rotation), *each)
    center, rotation = ends.state
    cost = np.where(center[:, 2] > 0, ends.cost, np.inf)
    best = int(np.argmin(cost))
    return (float(cost[best]), (center[best], rotation[best])) if cost[best] < np.inf else None


def resect_in_space(world_m: Floats, ray: Floats, sigma: Floats) -> Pose:
    """Estimate the poses of many cameras from points on a nearly level ground, and above it.

    Parameters
    ----------
    world_m
        (..., N, 3) points, N >= 4, not all but one in line.
    ray
        (..., N, 3) undistorted rays in the camera frame, z = 1.
    sigma
        (..., N) of their x and y.

    Returns
    -------
    center_m : (..., 3)
        NaN if the points do not determine the pose, or a ray or a point is not finite.
    world_from_camera : (..., 3, 3)

    Notes
    -----
    Least squares with all coordinates, from the pose over the level plane at the mean height.
    """
    shape = np.broadcast_shapes(world_m.shape[:-2], ray.shape[:-2])
    number = ray.shape[-2]
    every, rays = (
        np.broadcast_to(one, (*shape, number, 3)).reshape(-1, number, 3) for one in (world_m, ray)
    )
    sigmas = np.broadcast_to(sigma, (*shape, number)).reshape(-1, number)
    level_m = every[..., 2].mean(axis=1)
    center, rotation = resect_each(every[..., :2], rays)
    center[:, 2] += level_m
    known = np.flatnonzero(np.isfinite(center).all(axis=1) & (center[:, 2] > level_m))
    found = np.full(center.shape, np.nan)
    if len(known):
        start = (center[known], rotation[known])
        ends = _refine_each(start, every[known], rays[known], sigmas[known])
        found[known], rotation[known] = ends.state
    return found.reshape(*shape, 3), rotation.reshape(*shape, 3, 3)


def _refine_each(starts: Pose, world_m: Floats, ray: Floats, sigma: Floats) -> Minima:
    """Refine poses (B, 3), (B, 3, 3) to the best fit of rays (B, N, 3) to points (B, N, 3)."""
    size = np.linalg.norm(ray, axis=-1, keepdims=True)
    across = np.zeros((*ray.shape[:-1], 2, 3))  # from unit vectors to x and y at z = 1
    across[..., [0, 1], [0, 1]] = 1.0
    across[..., 2] = -ray[..., :2]
    across *= (size / sigma[..., None])[..., None]
    return minimise_each(make_ray_problem(ray / size, across, world_m), starts, MAX_ITERATIONS)


MIN_PICKS = 4
"""Number of picks that determine a pose above known points."""

MAX_SETS = 500
"""Largest number of sets of picks that are tried."""

AGREEMENT_SIGMAS = 12.0
"""Largest distance from the predicted place, in sigmas of a pick, of a pick that agrees: a
prediction by four picks with errors of a sigma each is itself uncertain by several sigmas."""


def find_consensus(world: Floats, ray: Floats, sigma: Floats) -> Bools | None:
    """Mark the picks (n,) that agree on the pose of largest consensus, and of equal ones the best.

    Parameters
    ----------
    world
        Points of the picks (n, 3), in metres.
    ray
        Their lines of sight in the camera's axes (n, 3), of depth 1.
    sigma
        (n,) sigmas of the picks, in normalised image coordinates.

    Returns
    -------
    None where no pose can be found.
    """
    if len(ray) < MIN_PICKS:
        return None
    offset = _find_offsets(world, ray, sigma, np.array(_sets(len(ray))))
    offset = offset[~np.isnan(offset[:, 0])]
    if not len(offset):
        return None
    agrees = offset < AGREEMENT_SIGMAS
    squares = np.sum(np.where(agrees, offset, 0.0) ** 2, axis=1)
    best = agrees[np.lexsort((squares, -agrees.sum(axis=1)))[0]]
    if best.sum() < MIN_PICKS:
        return np.asarray(best)
    (again,) = _find_offsets(world, ray, sigma, np.flatnonzero(best)[None])
    return None if np.isnan(again[0]) else np.asarray(again < AGREEMENT_SIGMAS)


def _sets(n: int) -> list[tuple[int, ...]]:
    """Return the smallest sets of n picks: all, or a fixed random sample."""
    if comb(n, MIN_PICKS) <= MAX_SETS:
        return list(combinations(range(n), MIN_PICKS))
    rng = np.random.default_rng(0)
    return [tuple(rng.choice(n, MIN_PICKS, replace=False)) for _ in range(MAX_SETS)]


def _find_offsets(world: Floats, ray: Floats, sigma: Floats, chosen: Ints) -> Floats:
    """Compute distances (S, n) of all picks from poses by chosen ones (S, k), in their sigmas.

    NaN where these determine no pose.
    """
    pose = resect_in_space(world[chosen], ray[chosen], sigma[chosen])
    distance = np.linalg.norm(project_points(world, pose) - ray[:, :2], axis=-1) / sigma
    distance = np.where(np.isnan(distance), np.inf, distance)
    return np.where(np.isnan(pose[0][:, :1]), np.nan, distance)


def project_points(world: Floats, pose: Pose) -> Floats:
    """Project points (n, 3) to normalised image coordinates in photos, (..., n, 2).

    NaN behind the camera.
    """
    center, world_from_camera = pose
    camera = (world - center[..., None, :]) @ world_from_camera
    depth = np.where(camera[..., 2:] > 0, camera[..., 2:], np.nan)
    return np.asarray(camera[..., :2] / depth)


class PhotoSights(NamedTuple):
    """Picks of one photo, of N adjusted points of known height.

    Attributes
    ----------
    world_m
        (N, 3) positions of the points.
    ray
        (..., N, 3) rays in the camera frame, z = 1; NaN outside the lens model.
    sigma
        (N,) of their x and y.
    """

    world_m: Floats
    ray: Floats
    sigma: Floats

    def resect(self) -> Pose:
        """Estimate the pose of the photo; its position is NaN where it is undetermined."""
        return resect_in_space(self.world_m, self.ray, self.sigma)

    def offsets(self, pose: Pose) -> Floats:
        """Compute (..., N, 2) residuals of the picks at a pose, in sigmas.

        NaN behind the camera.
        """
        off = project_points(self.world_m, pose) - self.ray[..., :2]
        return np.asarray(off / self.sigma[:, None])


def sight_adjusted_points(
    adjustment: Adjustment, survey: Survey, row_of_label: Ints, picks: Ints, pixel_px: Floats
) -> PhotoSights:
    """Collect the picks of a photo whose points are adjusted and have a known height.

    Parameters
    ----------
    adjustment
        Adjustment with the points.
    survey
        Survey with the photo.
    row_of_label
        (K,) labels of the adjustment for those of the survey; -1 where it has none.
    picks
        (n,) picks of the photo.
    pixel_px
        (..., n, 2) their pixels, which may differ from those of the survey.
    """
    label, camera = survey.pick_label[picks], survey.calibration
    known = np.flatnonzero((row_of_label[label] >= 0) & ~survey.is_free[label])
    world_m, _, _ = adjustment.problem.world_points(adjustment.state, row_of_label[label[known]])
    return PhotoSights(
        world_m,
        back_project(camera.model, camera.parameters, pixel_px[..., known, :]),
        survey.pick_sigma_px[picks[known]] / camera.parameters[0],
    )
