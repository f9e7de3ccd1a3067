"""Initial poses of many photos at once, by maximum likelihood from observations of their points.

`minimise_each` (`estimation.solver.batched`) solves the problem for B photos together. The unknowns
are the pose of each photo. The observations are:

* `LineRows`: rays that end on lines of known position, the points eliminated beforehand;
* `make_ray_problem`: rays to points of known position.

Photos whose picks are observations of ground points are adjusted in
`estimation/repeated/single_photo.py`.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from uavgram.estimation.solver.batched import ExplicitProblem, State
from uavgram.geometry.motion.rotation import exp_so3, hat
from uavgram.model.arrays import Floats, Ints


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
