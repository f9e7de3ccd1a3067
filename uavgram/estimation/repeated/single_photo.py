"""Adjustment of one photo with known lengths, for many draws of its observations at once."""

from __future__ import annotations

import numpy as np

from uavgram.estimation.first_poses.photo_problem import (
    POSE,
    PhotoProblem,
    Photos,
    SharedErrors,
    State,
    compute_places,
    rotate,
    share_nothing,
)
from uavgram.estimation.solver.batched import invert_each, minimise_each
from uavgram.geometry.camera.projection import back_project
from uavgram.geometry.motion.rotation import log_so3
from uavgram.model.arrays import Floats
from uavgram.model.camera import Calibration
from uavgram.model.simulation import PhotoDesign, PhotoDraws, PhotoPosesFound

BLOCK_SIZE = 2000
"""Draws at a time: enough that the overhead of Python is negligible, few enough for the cache."""

MIN_REDUCTION = 1e-14
"""Expected reduction of the sum of squares by the last step: the remaining one is smaller by
another factor of ten to a thousand."""

UNDAMPED_STEPS, SMALL_DAMPING = 12, 1e-9
"""Largest number of first steps: regardless of the sum of squares and with hardly any damping; the
few draws that do not converge start again with damped steps."""


def make_shared_errors(design: PhotoDesign) -> SharedErrors:
    """Return the errors that all observations of a photo share."""
    shared = share_nothing(design.calibration)
    return SharedErrors(
        design.calibration,
        shared.camera_root if design.camera_root is None else design.camera_root,
        shared.ground_root if design.ground_root is None else design.ground_root,
        design.tape_scale_sigma,
    )


def make_photos(design: PhotoDesign, draws: PhotoDraws) -> Photos:
    """Return the observations of every draw."""
    count = len(draws.length_m)

    def each(value: Floats) -> Floats:
        return np.broadcast_to(value, (count, *value.shape))

    return Photos(
        pixel_px=draws.pixel_px,
        pixel_weight=each(1.0 / design.pixel_sigma_px),
        height_m=each(design.height_m),
        ground=draws.ground,
        center=draws.center_world_m,
        rotation=draws.world_from_camera,
        information=each(design.information),
        line=np.broadcast_to(design.line, (count, *design.line.shape)),
        toward=np.zeros((count, 0, 2)),
        placed=np.zeros((count, 0), np.int64),
        reading_m=draws.length_m,
        reading_weight=each(1.0 / design.length_sigma_m),
    )


def adjust_photos(
    design: PhotoDesign,
    draws: PhotoDraws,
    start: tuple[Floats, Floats] | None = None,
    undamped: int = UNDAMPED_STEPS,
    settled: float = MIN_REDUCTION,
) -> PhotoPosesFound:
    """Adjust every draw.

    Parameters
    ----------
    design
        Design common to the draws.
    draws
        B draws.
    start
        (3,), (3, 3) initial pose, or (B, 3), (B, 3, 3); None: each starts at its prior pose.
    undamped
        Largest number of steps before the damped ones; 0 for poor starts.
    settled
        Expected reduction of the sum of squares by the last step.

    Returns
    -------
    PhotoPosesFound
        Draws that did not converge are marked.
    """
    photos = make_photos(design, draws)
    center, rotation = start or (photos.center, photos.rotation)
    begun = (
        np.broadcast_to(center, photos.center.shape),
        np.broadcast_to(rotation, photos.rotation.shape),
    )
    return adjust_each(make_shared_errors(design), photos, begun, undamped, settled)


def adjust_each(
    shared: SharedErrors,
    photos: Photos,
    start: tuple[Floats, Floats],
    undamped: int = UNDAMPED_STEPS,
    settled: float = MIN_REDUCTION,
) -> PhotoPosesFound:
    """Adjust photos from initial poses (B, 3), (B, 3, 3); see `adjust_photos`."""
    center, rotation = start
    first = State(
        center,
        log_so3(photos.rotation.swapaxes(1, 2) @ rotation),
        intersect_ground(shared.calibration, photos, start),
        np.zeros((len(center), shared.count)),
    )
    found = []
    for begin in range(0, len(center), BLOCK_SIZE):
        rows = slice(begin, begin + BLOCK_SIZE)
        begun = State(*(part[rows] for part in first))
        found.append(_adjust_block(shared, photos.take(rows), begun, undamped, settled))
    names = vars(found[0])
    return PhotoPosesFound(
        **{name: np.concatenate([getattr(one, name) for one in found]) for name in names}
    )


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


def _adjust_block(
    shared: SharedErrors, photos: Photos, first: State, undamped: int, settled: float
) -> PhotoPosesFound:
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
    return PhotoPosesFound(
        center_world_m=state.center,
        world_from_camera=rotation,
        covariance=np.where(at_rest[:, None, None], covariance, np.nan),
        place_m=np.where(np.isfinite(place), place, np.nan),
        common=state.common,
        cost=np.where(np.isfinite(ends.cost), ends.cost, np.nan),
        converged=at_rest,
        steps=ends.steps,
    )
