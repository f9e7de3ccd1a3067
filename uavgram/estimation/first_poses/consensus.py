"""Find the picks of a photo that agree on one pose, among wrong ones.

Consensus of the smallest sets of picks that determine a pose (Fischler and Bolles 1981, "Random
sample consensus"), here all of these sets or a fixed sample.
"""

from __future__ import annotations

from itertools import combinations
from math import comb

import numpy as np

from uavgram.estimation.first_poses.homography import resect_from_plane
from uavgram.model.arrays import Bools, Floats, Ints

MIN_PICKS = 4
"""Number of picks that determine a pose above known points of a plane."""

MAX_SETS = 500
"""Largest number of sets of picks that are tried."""

AGREEMENT_SIGMAS = 12.0
"""Largest distance from the predicted place, in sigmas of a pick, of a pick that agrees: a
prediction by four picks with errors of a sigma each is itself uncertain by several sigmas."""


def find_consensus(world: Floats, ray: Floats, sigma: Floats) -> Bools | None:
    """Mark the picks (n,) that agree on the pose of largest consensus.

    Parameters
    ----------
    world
        Points of the picks on the plane (n, 2), in metres.
    ray
        Their lines of sight in the camera's axes (n, 3), of depth 1.
    sigma
        (n,) sigmas of the picks, in normalised image coordinates.

    Returns
    -------
    None where no pose can be found.
    """
    best = None
    for chosen in _sets(len(ray)):
        agree = _agreeing(world, ray, sigma, np.array(chosen))
        if agree is not None and (best is None or agree.sum() > best.sum()):
            best = agree
    if best is None or best.sum() < MIN_PICKS:
        return best
    return _agreeing(world, ray, sigma, np.flatnonzero(best))


def _sets(n: int) -> list[tuple[int, ...]]:
    """Return the smallest sets of n picks: all, or a fixed random sample."""
    if comb(n, MIN_PICKS) <= MAX_SETS:
        return list(combinations(range(n), MIN_PICKS))
    rng = np.random.default_rng(0)
    return [tuple(rng.choice(n, MIN_PICKS, replace=False)) for _ in range(MAX_SETS)]


def _agreeing(world: Floats, ray: Floats, sigma: Floats, chosen: Ints) -> Bools | None:
    pose = resect_from_plane(world[chosen], ray[chosen])
    if pose is None:
        return None
    distance = np.linalg.norm(project_plane(world, pose) - ray[:, :2], axis=1)
    return np.asarray(distance < AGREEMENT_SIGMAS * sigma)


def project_plane(world: Floats, pose: tuple[Floats, Floats]) -> Floats:
    """Project points of the plane to normalised image coordinates (n, 2); NaN behind the camera."""
    center, plane_from_camera = pose
    camera = (np.column_stack([world, np.zeros(len(world))]) - center) @ plane_from_camera
    depth = np.where(camera[:, 2:] > 0, camera[:, 2:], np.nan)
    return np.asarray(camera[:, :2] / depth)
