"""Poses from the fewest rays that determine them, by OpenCV: for random samples of tie points."""

from __future__ import annotations

import cv2
import numpy as np

from uavgram.model.arrays import Floats


def compute_essential_matrices(first: Floats, second: Floats) -> Floats:
    """Compute matrices E with second . E first = 0 from samples of five rays each.

    Parameters
    ----------
    first, second
        (S, 5, 3) rays to the same points from the two cameras, forward (z > 0).

    Returns
    -------
    (M, 3, 3)
        Of all samples together, up to ten of each; two singular values are 1, the third 0.

    Notes
    -----
    Nister 2004, "An efficient solution to the five-point relative pose problem". It holds for
    points in a plane too.
    """
    pairs = zip(_project_rays(first), _project_rays(second), strict=True)
    found = [cv2.findEssentialMat(one, other, np.eye(3))[0] for one, other in pairs]
    # A sample has no solution, or several one below the other.
    stacked = [np.zeros((0, 3)), *(one for one in found if one is not None)]
    essential = np.concatenate(stacked).reshape(-1, 3, 3)
    essential = essential[np.isfinite(essential).all(axis=(1, 2))]
    size = np.linalg.norm(essential, axis=(1, 2), keepdims=True)
    return np.asarray(essential / size * np.sqrt(2.0))


def solve_three_points(world: Floats, ray: Floats) -> tuple[Floats, Floats]:
    """Compute centres (M, 3) and rotations (M, 3, 3), world from camera, from three points each.

    Up to four poses of each sample.

    Parameters
    ----------
    world
        (S, 3, 3) three points of each sample.
    ray
        (S, 3, 3) rays to them, in the camera, forward (z > 0).
    """
    turns, shifts = [], []
    for points, image in zip(world, _project_rays(ray), strict=True):
        _, turn, shift = cv2.solveP3P(points, image, np.eye(3), None, cv2.SOLVEPNP_P3P)
        turns += [cv2.Rodrigues(one)[0] for one in turn]
        shifts += list(shift)
    rotation = np.array(turns, dtype=np.float64).reshape(-1, 3, 3).swapaxes(1, 2)
    center = (-rotation @ np.array(shifts, dtype=np.float64).reshape(-1, 3, 1))[..., 0]
    solved = np.isfinite(center).all(axis=1)
    return center[solved], rotation[solved]


def _project_rays(ray: Floats) -> Floats:
    """Return (..., 2) x and y of rays at z = 1."""
    return np.ascontiguousarray(ray[..., :2] / ray[..., 2:])
