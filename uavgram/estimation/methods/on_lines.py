"""Picks that lie on lines of known position, in many photos at once: residuals.

From where a camera is to where its mirror image below the ground is, lines tell no difference: they
look the same from (x, y, -z) as rays have no direction on them (Xu, Zhang, Cheng and Koch 2017,
"Pose estimation from line correspondences: a complete analysis and a series of solutions", on signs
of the depth). Here rays go forward to the ground below the camera: that one falls away.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from uavgram.estimation.methods.damped import Linear, State, pose_moved
from uavgram.geometry.motion.rotation import hat
from uavgram.model.arrays import Floats, Ints


@dataclass(frozen=True, eq=False)
class OnLines:
    """N picks on lines in each of B photos, over ground at z = 0.

    Attributes
    ----------
    ray
        (B, N, 3) undistorted, z = 1.
    ray_root
        (B, N, 2, 2) L with L L^T the covariance of x and y of each ray.
    start_m, along
        (B, N, 2) a place on the line of each, and the line's unit vector.
    sigma_m
        (B, N) of the line's place, square to it.
    """

    ray: Floats
    ray_root: Floats
    start_m: Floats
    along: Floats
    sigma_m: Floats

    @property
    def across(self) -> Floats:
        """(B, N, 2) unit vectors square to the lines, to the left."""
        return np.stack([-self.along[..., 1], self.along[..., 0]], axis=-1)

    def linearised(self, which: Ints, state: State) -> Linear:
        """Distances of the picks from the images of their lines, over their sigmas.

        Notes
        -----
        A ray d (world) through the line at A along u: m . d = 0 with m = u x (A - C), the normal of
        the plane through camera and line. Its variance is that of the ray, and that of the line,
        which moves it by d_z; with both the quotient is the distance in sigmas to first order
        (Sampson 1982).
        """
        residual, jacobian = self.residuals(which, *state[:2])
        transposed = jacobian.swapaxes(1, 2)
        return Linear(
            np.sum(residual**2, axis=1),
            transposed @ jacobian,
            (transposed @ residual[..., None])[..., 0],
        )

    def moved(self, state: State, linear: Linear, step: Floats) -> State:  # noqa: ARG002
        """The poses after steps.

        Parameters
        ----------
        state
            Of b problems.
        linear
            As it was linearised there.
        step
            (b, 6) of centre [m] and rotation [rad].
        """
        return pose_moved(state, step)

    def residuals(self, which: Ints, center: Floats, rotation: Floats) -> tuple[Floats, Floats]:
        """Residuals and their Jacobians; NaN where a ray does not go down to the ground.

        Parameters
        ----------
        which
            (b,) photos.
        center, rotation
            (b, 3), (b, 3, 3) their poses.

        Returns
        -------
        residual : (b, N)
        jacobian : (b, N, 6)
            By centre [m] and rotation [rad].
        """
        ray, root, turn = self.ray[which], self.ray_root[which], rotation[:, None]
        along = np.zeros(ray.shape)
        along[..., :2] = self.along[which]
        away = -np.broadcast_to(center[:, None], ray.shape)
        away = away + np.concatenate([self.start_m[which], ray[..., 2:] * 0.0], axis=-1)
        normal = _turned_back(turn, np.cross(along, away))  # of the plane, in the camera's axes
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
