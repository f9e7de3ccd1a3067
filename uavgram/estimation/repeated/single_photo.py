"""Adjustment of many single photos with known lengths, such as draws of one photo."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from uavgram.estimation.first_poses.photo_problem import (
    POSE,
    PhotoProblem,
    Photos,
    SharedErrors,
    State,
    compute_places,
    rotate,
)
from uavgram.estimation.solver.batched import invert_each, minimise_each
from uavgram.geometry.camera.projection import back_project
from uavgram.geometry.motion.rotation import log_so3
from uavgram.model.arrays import Bools, Floats, Ints
from uavgram.model.camera import Calibration

BLOCK_SIZE = 2000
"""Draws at a time: enough that the overhead of Python is negligible, few enough for the cache."""

MIN_REDUCTION = 1e-14
"""Expected reduction of the sum of squares by the last step: the remaining one is smaller by
another factor of ten to a thousand."""

UNDAMPED_STEPS, SMALL_DAMPING = 12, 1e-9
"""Largest number of first steps: regardless of the sum of squares and with hardly any damping; the
few draws that do not converge start again with damped steps."""


class PhotoPoses(NamedTuple):
    """B adjusted photos.

    Attributes
    ----------
    center_world_m, world_from_camera, covariance
        (B, 3), (B, 3, 3), (B, 6, 6) as in `Poses`; NaN covariance where the adjustment did not
        converge.
    place_m
        (B, E, 3) of the points.
    common
        (B, K) the errors of camera, ground and tape, in that order; K = 0 where all are exact.
    cost
        (B,) weighted sum of squares; NaN where the initial pose was impossible.
    converged, steps
        (B,) whether the adjustment converged, and its number of steps.
    """

    center_world_m: Floats
    world_from_camera: Floats
    covariance: Floats
    place_m: Floats
    common: Floats
    cost: Floats
    converged: Bools
    steps: Ints


def adjust_photos(
    shared: SharedErrors,
    photos: Photos,
    start: tuple[Floats, Floats] | None = None,
    undamped: int = UNDAMPED_STEPS,
    settled: float = MIN_REDUCTION,
) -> PhotoPoses:
    """Adjust every photo; those that did not converge are marked.

    Parameters
    ----------
    shared, photos
        Errors that all observations of a photo share, and B photos.
    start
        (3,), (3, 3) initial pose, or (B, 3), (B, 3, 3); None: each starts at its prior pose.
    undamped
        Largest number of steps before the damped ones; 0 for poor starts.
    settled
        Expected reduction of the sum of squares by the last step.
    """
    center, rotation = start or (photos.center, photos.rotation)
    center = np.broadcast_to(center, photos.center.shape)
    rotation = np.broadcast_to(rotation, photos.rotation.shape)
    first = State(
        center,
        log_so3(photos.rotation.swapaxes(1, 2) @ rotation),
        intersect_ground(shared.calibration, photos, (center, rotation)),
        np.zeros((len(center), shared.size)),
    )
    found = []
    for begin in range(0, len(center), BLOCK_SIZE):
        rows = slice(begin, begin + BLOCK_SIZE)
        begun = State(*(part[rows] for part in first))
        found.append(_adjust_block(shared, photos.take(rows), begun, undamped, settled))
    return PhotoPoses(*(np.concatenate(column) for column in zip(*found, strict=True)))


def intersect_ground(camera: Calibration, photos: Photos, poses: tuple[Floats, Floats]) -> Floats:
    """Intersect the picks' rays with the prior ground: (B, E, 2) east and north, or NaN.

    Parameters
    ----------
    camera, photos
        Camera, and its photos.
    poses
        (B, 3), (B, 3, 3).
    """
    center, rotation = poses
    ray = back_project(camera.model, camera.parameters, photos.pixel_px)
    ray = ray @ rotation.swapaxes(1, 2)
    # Ray parameter: height of the camera over the ground by the fall of the ray against it.
    level, slope = photos.ground[:, :1], photos.ground[:, 1:, None]
    ground = level + photos.height_m + (center[:, None, :2] @ slope)[..., 0]
    above = ground - center[:, None, 2]
    falling = ray[..., 2] - (ray[..., :2] @ slope)[..., 0]
    with np.errstate(invalid="ignore", divide="ignore"):
        along = above / falling
    along = np.where(along > 0, along, np.nan)
    return np.asarray(center[:, None, :2] + along[..., None] * ray[..., :2])


@np.errstate(invalid="ignore", over="ignore")  # some photos may get lost
def _adjust_block(
    shared: SharedErrors, photos: Photos, first: State, undamped: int, settled: float
) -> PhotoPoses:
    """Adjust photos that fit the processor's cache together."""
    problem = PhotoProblem(shared, photos)
    ends = minimise_each(
        problem, first, undamped, settled=settled, damping=SMALL_DAMPING, descending=False
    )
    left = np.flatnonzero(~ends.converged & np.isfinite(first.place).all(axis=(1, 2)))
    if len(left):
        again = PhotoProblem(shared, photos.take(left))
        begun = tuple(part[left] for part in first)
        ends.put(left, minimise_each(again, begun, settled=settled), problem.axis)
    state, at_rest = State(*ends.state), ends.converged
    rotation, by_vector = rotate(photos, state)
    # Covariances of the centre, and of a rotation in the camera's axes.
    covariance = invert_each(ends.normal)[:, POSE, POSE]
    by_step = np.zeros_like(covariance)
    by_step[:, range(3), range(3)] = 1.0
    by_step[:, 3:, 3:] = by_vector
    covariance = by_step @ covariance @ by_step.swapaxes(1, 2)
    place, _ = compute_places(shared, photos, state)
    return PhotoPoses(
        center_world_m=state.center,
        world_from_camera=rotation,
        covariance=np.where(at_rest[:, None, None], covariance, np.nan),
        place_m=np.where(np.isfinite(place), place, np.nan),
        common=state.common,
        cost=np.where(np.isfinite(ends.cost), ends.cost, np.nan),
        converged=at_rest,
        steps=ends.steps,
    )
