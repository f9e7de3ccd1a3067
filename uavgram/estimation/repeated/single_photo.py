"""Adjustment of many single photos with known lengths, and predicted accuracy of lengths in them.

The errors of predicted lengths are those of readings, of picks, of the prior pose, and those that
all sightings or all readings share, each in its sigmas and in this order.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from uavgram.estimation.first_poses.photo_problem import (
    POSE,
    PhotoProblem,
    PhotoRows,
    Photos,
    SharedErrors,
    State,
    compute_places,
    rotate,
)
from uavgram.estimation.measuring.second_order import (
    SecondOrderTerms,
    compute_second_order_terms,
    make_moves,
)
from uavgram.estimation.solver.batched import invert_each, minimise_each
from uavgram.geometry.camera.projection import back_project
from uavgram.geometry.motion.rotation import exp_so3, log_so3
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


MIN_VARIANCE_SHARE = 1e-9
"""Variance, as a share of the largest, below which directions move no length."""


def compute_second_order(
    shared: SharedErrors, exact: Photos, pairs: Ints, by_error: Floats
) -> SecondOrderTerms:
    """Compute second-order terms of measured lengths by moving all errors and readjusting.

    Parameters
    ----------
    shared, exact, pairs
        As in `predict_lengths`. An end without a known length belongs to one pair only.
    by_error
        (R, n) slopes of lengths by the errors: of the measured ones, and of others that show how
        the errors move the photo.
    """
    directions = _directions(exact, pairs, by_error)
    moved = np.concatenate([make_moves(directions), np.zeros((1, by_error.shape[1]))])
    start = exact.center[0], exact.rotation[0]
    found = adjust_photos(shared, add_errors(shared, exact, moved), start)
    ends = found.place_m[:, pairs]
    length = np.linalg.norm(ends[:, :, 1] - ends[:, :, 0], axis=2)
    length[~found.converged] = np.nan
    return compute_second_order_terms(length[:-1], length[-1])


def _directions(exact: Photos, pairs: Ints, by_error: Floats) -> Floats:
    """Return (d, n) orthonormal directions of the errors with the largest first-order effects.

    Those that move the photo are common to all lengths. Ends without a known length move only their
    own one: those of all pairs move at once.
    """
    line = exact.line[0]
    picks = len(line) + np.arange(2 * exact.height_m.shape[1]).reshape(-1, 2)
    loose = np.setdiff1d(pairs, line)
    common = by_error.copy()
    common[:, picks[loose].ravel()] = 0.0
    size = np.linalg.norm(by_error, axis=1, keepdims=True)
    _, spread, axes = np.linalg.svd(common / np.where(size > 0, size, 1.0), full_matrices=False)
    own = np.zeros((4, by_error.shape[1]))
    for end in (0, 1):
        for k in (0, 1):
            own[2 * end + k, picks[np.intersect1d(pairs[:, end], loose), k]] = 1.0
    return np.concatenate([axes[spread**2 > MIN_VARIANCE_SHARE * spread[0] ** 2], own])


def add_errors(shared: SharedErrors, exact: Photos, moved: Floats) -> Photos:
    """Return a photo's observations with errors.

    Parameters
    ----------
    shared, exact
        Shared errors, and the photo without any error.
    moved
        (S, n) the errors. Those of camera and tape are errors of their stated values: at a positive
        one the picks and readings are those of a smaller true value.
    """
    points, known = exact.height_m.shape[1], exact.line.shape[1]
    reading, pick, pose, common = np.split(
        moved, [known, known + 2 * points, known + 2 * points + 6], axis=1
    )
    # Shifts of the picks by the camera's errors, at the true places.
    by_camera = _linearise(shared, exact).shift[0][..., POSE.stop :][..., shared.camera]
    pick = pick.reshape(-1, points, 2) - np.einsum(
        "ejk,sk->sej", by_camera, common[:, shared.camera]
    )
    length = exact.reading_m + reading / exact.reading_weight
    if shared.tape_scale_sigma:
        length = length / (1.0 - shared.tape_scale_sigma * common[:, -1:])
    # Prior pose: errors of sigma 1 times the inverse root of its information.
    off = pose @ np.linalg.pinv(compute_root(exact.information[0]))
    return exact.repeat(len(moved))._replace(
        pixel_px=exact.pixel_px + pick / exact.pixel_weight[..., None],
        reading_m=length,
        center=exact.center + off[:, :3],
        rotation=exact.rotation @ exp_so3(off[:, 3:]),
        ground=exact.ground + common[:, shared.ground] @ shared.ground_root.T,
    )


def compute_root(information: Floats) -> Floats:
    """Compute the (n, n) symmetric root of a positive semidefinite matrix."""
    value, axes = np.linalg.eigh(information)
    return np.asarray(axes * np.sqrt(np.maximum(value, 0.0)) @ axes.T)


class PredictedLengths(NamedTuple):
    """M variances [m²], their parts by source, and second-order terms.

    Attributes
    ----------
    variance
        (M,) to first order.
    bent
        Second-order terms of the variance and of the mean.
    lengths, picks, prior, camera, tape, ground
        (M,) parts of the variance: by the readings, by all picks, by the prior pose, by the
        camera's parameters, by the tape's scale, by the ground's plane. They add up to it.
    """

    variance: Floats
    bent: SecondOrderTerms
    lengths: Floats
    picks: Floats
    prior: Floats
    camera: Floats
    tape: Floats
    ground: Floats

    @property
    def parts(self) -> tuple[Floats, ...]:
        """Parts of the variance, in their order."""
        return self[2:]

    @property
    def error_m(self) -> Floats:
        """(M,) root mean square of the errors, to second order.

        To first order if errors of little more than their sigmas have no solution.
        """
        whole = self.variance + self.bent.variance + self.bent.bias**2
        return np.sqrt(np.where(np.isfinite(whole), whole, self.variance))


def predict_lengths(shared: SharedErrors, exact: Photos, pairs: Ints) -> PredictedLengths:
    """Predict the covariance of the adjustment at the truth, its parts, and second-order terms.

    With unknowns x, all with priors except through the readings, the estimate's error is C (H^T
    R^-1 n + L b), with n the errors of readings and b those of the priors; the errors are
    independent, so the variance is the sum over them.

    Parameters
    ----------
    shared, exact
        Shared errors, and the photo without any error.
    pairs
        (M, 2) points at the ends of the measured lengths. A point without a known length belongs to
        one of them only.
    """
    slopes = compute_slopes(shared, exact, pairs)
    known = exact.line.shape[1]
    first = known + 2 * exact.height_m.shape[1] + 6
    at = [known, first - 6, first, first + shared.ground.start, first + shared.ground.stop]
    # Variance by each error: squared slope; summed by source.
    squares = slopes.by_error[known:] ** 2
    lengths, picks, prior, camera, ground, tape = (
        part.sum(axis=1) for part in np.split(squares, at, axis=1)
    )
    return PredictedLengths(
        variance=slopes.variance,
        bent=compute_second_order(shared, exact, pairs, slopes.by_error),
        lengths=lengths,
        picks=picks,
        prior=prior,
        camera=camera,
        tape=tape,
        ground=ground,
    )


class LengthSlopes(NamedTuple):
    """Derivatives of adjusted lengths by the errors of the observations.

    Attributes
    ----------
    by_error
        (L + M, n) of the known lengths, and of the measured ones, by errors in their sigmas, in the
        order of the rows of the adjustment.
    variance
        (M,) variances of the measured ones [m²].
    """

    by_error: Floats
    variance: Floats


def compute_slopes(shared: SharedErrors, exact: Photos, pairs: Ints) -> LengthSlopes:
    """Compute the slopes of the adjustment at the truth.

    Parameters
    ----------
    shared, exact, pairs
        As in `predict_lengths`.
    """
    known, picks = exact.line.shape[1], 2 * exact.height_m.shape[1]
    # All lengths, the known and the measured ones.
    measured = np.ones((1, len(pairs)))
    every = exact._replace(
        line=np.concatenate([exact.line, pairs[None]], axis=1),
        reading_m=np.concatenate([exact.reading_m, measured], axis=1),
        reading_weight=np.concatenate([exact.reading_weight, measured], axis=1),
    )
    linear = _linearise(shared, every)
    by_pose, by_common = np.split(linear.by_unknown[0], [POSE.stop], axis=1)
    if shared.tape_scale_sigma:
        by_common[known:, -1] = 0.0  # measured lengths are not read on a tape
    by_pick = linear.by_error[0].reshape(-1, picks)
    weighted = np.concatenate([by_pose, by_pick, by_common], axis=1)
    rows = weighted / every.reading_weight[0][:, None]
    # Gain of the estimate: rows (prior information + H^T R^-1 H)^-1.
    before = np.eye(rows.shape[1])
    before[POSE, POSE] = exact.information[0]
    gain = rows @ np.linalg.inv(before + weighted[:known].T @ weighted[:known])
    pose, pick, common = np.split(gain, [6, 6 + picks], axis=1)
    parts = [gain @ weighted[:known].T, pick, pose @ compute_root(exact.information[0]), common]
    variance = np.einsum("mi,mi->m", gain[known:], rows[known:])
    return LengthSlopes(np.concatenate(parts, axis=1), variance)


def _linearise(shared: SharedErrors, exact: Photos) -> PhotoRows:
    """Linearise photos without errors at their poses, and at the places of their picks."""
    place = intersect_ground(shared.calibration, exact, (exact.center, exact.rotation))
    none = np.zeros_like(exact.center), place, np.zeros((len(place), shared.size))
    return PhotoProblem(shared, exact).compute_rows(exact, State(exact.center, *none))
