"""Predicted accuracy of lengths in one photo, with its second-order terms, without any draw.

The errors are those of readings, of picks, of the prior pose, and those that all sightings or all
readings share, each in its sigmas and in this order.
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from uavgram.estimation.first_poses.photo_problem import (
    POSE,
    PhotoProblem,
    PhotoRows,
    Photos,
    SharedErrors,
    State,
)
from uavgram.estimation.measuring.second_order import (
    SecondOrderTerms,
    compute_second_order_terms,
    make_moves,
)
from uavgram.estimation.repeated.single_photo import (
    adjust_photos,
    intersect_ground,
    make_photos,
    make_shared_errors,
)
from uavgram.geometry.motion.rotation import exp_so3
from uavgram.model.arrays import Floats, Ints
from uavgram.model.simulation import PhotoDesign, PhotoDraws

MIN_VARIANCE_SHARE = 1e-9
"""Variance, as a share of the largest, below which directions move no length."""


def compute_second_order(
    design: PhotoDesign, exact: PhotoDraws, pairs: Ints, by_error: Floats
) -> SecondOrderTerms:
    """Compute second-order terms of measured lengths by moving all errors and readjusting.

    Parameters
    ----------
    design, exact, pairs
        As in `predict_lengths`. An end without a known length belongs to one pair only.
    by_error
        (R, n) slopes of lengths by the errors: of the measured ones, and of others that show how
        the errors move the photo.
    """
    directions = _directions(design, pairs, by_error)
    moved = np.concatenate([make_moves(directions), np.zeros((1, by_error.shape[1]))])
    draws = add_errors(design, exact, moved)
    start = exact.center_world_m[0], exact.world_from_camera[0]
    found = adjust_photos(design, draws, start)
    ends = found.place_m[:, pairs]
    length = np.linalg.norm(ends[:, :, 1] - ends[:, :, 0], axis=2)
    length[~found.converged] = np.nan
    return compute_second_order_terms(length[:-1], length[-1])


def _directions(design: PhotoDesign, pairs: Ints, by_error: Floats) -> Floats:
    """Return (d, n) orthonormal directions of the errors with the largest first-order effects.

    Those that move the photo are common to all lengths. Ends without a known length move only their
    own one: those of all pairs move at once.
    """
    picks = len(design.line) + np.arange(2 * len(design.height_m)).reshape(-1, 2)
    loose = np.setdiff1d(pairs, design.line)
    shared = by_error.copy()
    shared[:, picks[loose].ravel()] = 0.0
    size = np.linalg.norm(by_error, axis=1, keepdims=True)
    _, spread, axes = np.linalg.svd(shared / np.where(size > 0, size, 1.0), full_matrices=False)
    own = np.zeros((4, by_error.shape[1]))
    for end in (0, 1):
        for k in (0, 1):
            own[2 * end + k, picks[np.intersect1d(pairs[:, end], loose), k]] = 1.0
    return np.concatenate([axes[spread**2 > MIN_VARIANCE_SHARE * spread[0] ** 2], own])


def add_errors(design: PhotoDesign, exact: PhotoDraws, moved: Floats) -> PhotoDraws:
    """Return the observations with errors.

    Parameters
    ----------
    design, exact
        Photo, and one draw without any error.
    moved
        (S, n) the errors. Those of camera and tape are errors of their stated values: at a positive
        one the picks and readings are those of a smaller true value.
    """
    ends, known = len(design.height_m), len(design.line)
    reading, pick, pose, shared = np.split(
        moved, [known, known + 2 * ends, known + 2 * ends + 6], axis=1
    )
    # Shifts of the picks by the camera's errors, at the true places.
    errors, photos = make_shared_errors(design), make_photos(design, exact)
    place = intersect_ground(design.calibration, photos, (photos.center, photos.rotation))
    by_camera = _linearise(errors, photos, place).shift[0][..., POSE.stop :][..., errors.camera]
    pick = pick.reshape(-1, ends, 2) - np.einsum("ejk,sk->sej", by_camera, shared[:, errors.camera])
    length = exact.length_m + design.length_sigma_m * reading
    if design.tape_scale_sigma:
        length = length / (1.0 - design.tape_scale_sigma * shared[:, -1:])
    ground = exact.ground + shared[:, errors.ground] @ errors.ground_root.T
    # Prior pose: errors of sigma 1 times the inverse root of its information.
    off = pose @ np.linalg.pinv(compute_root(design.information))
    return PhotoDraws(
        pixel_px=exact.pixel_px + design.pixel_sigma_px[:, None] * pick,
        length_m=length,
        center_world_m=exact.center_world_m + off[:, :3],
        world_from_camera=exact.world_from_camera @ exp_so3(off[:, 3:]),
        ground=ground,
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
    lengths, picks, beforehand, camera, tape, ground
        (M,) parts of the variance: by the readings, by all picks, by the prior pose, by the
        camera's parameters, by the tape's scale, by the ground's plane. They add up to it.
    """

    variance: Floats
    bent: SecondOrderTerms
    lengths: Floats
    picks: Floats
    beforehand: Floats
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


def predict_lengths(
    design: PhotoDesign, exact: PhotoDraws, place_m: Floats, pairs: Ints
) -> PredictedLengths:
    """Predict the covariance of the adjustment at the truth, its parts, and second-order terms.

    With unknowns x, all with priors except through the readings, the estimate's error is C (H^T
    R^-1 n + L b), with n the errors of readings and b those of the priors; the errors are
    independent, so the variance is the sum over them.

    Parameters
    ----------
    design
        Design of the photo.
    exact
        One draw without any error.
    place_m
        (E, 2) true places of its ends.
    pairs
        (M, 2) ends of the measured lengths. An end without a known length belongs to one of them
        only.
    """
    slopes = compute_slopes(design, exact, place_m, pairs)
    of_plane = make_shared_errors(design).ground
    known, first = len(design.line), 2 * len(place_m) + len(design.line) + 6
    at = [known, first - 6, first, first + of_plane.start, first + of_plane.stop]
    # Variance by each error: squared slope; summed by source.
    squares = slopes.by_error[known:] ** 2
    lengths, picks, beforehand, camera, ground, tape = (
        part.sum(axis=1) for part in np.split(squares, at, axis=1)
    )
    return PredictedLengths(
        variance=slopes.variance,
        bent=compute_second_order(design, exact, pairs, slopes.by_error),
        lengths=lengths,
        picks=picks,
        beforehand=beforehand,
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
        order of `estimation/repeated/predicted_lengths.py`.
    variance
        (M,) variances of the measured ones [m²].
    """

    by_error: Floats
    variance: Floats


def compute_slopes(
    design: PhotoDesign, exact: PhotoDraws, place_m: Floats, pairs: Ints
) -> LengthSlopes:
    """Compute the slopes of the adjustment at the truth.

    Parameters
    ----------
    design, exact, place_m, pairs
        As in `predict_lengths`.
    """
    known, picks = len(design.line), 2 * len(place_m)
    # All lengths, the known and the measured ones, at the truth.
    every = replace(
        design,
        line=np.concatenate([design.line, pairs]),
        length_sigma_m=np.concatenate([design.length_sigma_m, np.ones(len(pairs))]),
    )
    reading = np.concatenate([exact.length_m, np.ones((1, len(pairs)))], axis=1)
    shared = make_shared_errors(every)
    photos = make_photos(every, replace(exact, length_m=reading))
    linear = _linearise(shared, photos, place_m[None])
    by_pose, by_common = np.split(linear.by_unknown[0], [POSE.stop], axis=1)
    if design.tape_scale_sigma:
        by_common[known:, -1] = 0.0  # measured lengths are not read on a tape
    by_pick = linear.by_error[0].reshape(len(every.line), -1)
    weighted = np.concatenate([by_pose, by_pick, by_common], axis=1)
    rows = weighted * every.length_sigma_m[:, None]
    # Gain of the estimate: rows (prior information + H^T R^-1 H)^-1.
    before = np.eye(rows.shape[1])
    before[POSE, POSE] = design.information
    gain = rows @ np.linalg.inv(before + weighted[:known].T @ weighted[:known])
    pose, pick, common = np.split(gain, [6, 6 + picks], axis=1)
    parts = [gain @ weighted[:known].T, pick, pose @ compute_root(design.information), common]
    variance = np.einsum("mi,mi->m", gain[known:], rows[known:])
    return LengthSlopes(np.concatenate(parts, axis=1), variance)


def _linearise(shared: SharedErrors, photos: Photos, place_m: Floats) -> PhotoRows:
    """Linearise photos at their prior poses and at places (B, E, 2), without errors."""
    none = np.zeros_like(photos.center), place_m, np.zeros((len(place_m), shared.count))
    return PhotoProblem(shared, photos).compute_rows(photos, State(photos.center, *none))
