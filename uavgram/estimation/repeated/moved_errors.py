"""Second-order terms of lengths in one photo, as functions of its errors.

The errors are those of readings, of picks, of the prior pose, and those that all sightings or all
readings share, each in its sigmas and in this order.
"""

from __future__ import annotations

import numpy as np

from uavgram.estimation.measuring.second_order import (
    SecondOrderTerms,
    compute_second_order_terms,
    make_moves,
)
from uavgram.estimation.repeated.common_errors import ground_slice
from uavgram.estimation.repeated.single_photo import adjust_photos
from uavgram.geometry.motion.rotation import exp_so3
from uavgram.model.arrays import Floats, Ints
from uavgram.model.simulation import PhotoDesign, PhotoDraws

MIN_VARIANCE_SHARE = 1e-9
"""Variance, as a share of the largest, below which directions move no length."""


def compute_second_order(
    design: PhotoDesign, exact: PhotoDraws, pairs: Ints, by_error: Floats, shifts: Floats
) -> SecondOrderTerms:
    """Compute second-order terms of measured lengths by moving all errors and readjusting.

    Parameters
    ----------
    design, exact, pairs
        As in `predict_lengths`. An end without a known length belongs to one pair only.
    by_error
        (R, n) slopes of lengths by the errors: of the measured ones, and of others that show how
        the errors move the photo.
    shifts
        (2, E, K) shifts of the sightings by shared errors, in sigmas.
    """
    directions = _directions(design, pairs, by_error)
    moved = np.concatenate([make_moves(directions), np.zeros((1, by_error.shape[1]))])
    draws = add_errors(design, exact, moved, shifts)
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


def add_errors(design: PhotoDesign, exact: PhotoDraws, moved: Floats, shifts: Floats) -> PhotoDraws:
    """Return the observations with errors.

    Parameters
    ----------
    design, exact
        Photo, and one draw without any error.
    moved
        (S, n) the errors.
    shifts
        As in `compute_second_order`.
    """
    ends, known = len(design.height_m), len(design.line)
    reading, pick, pose, shared = np.split(
        moved, [known, known + 2 * ends, known + 2 * ends + 6], axis=1
    )
    pick = pick.reshape(-1, ends, 2) - np.einsum("jek,sk->sej", shifts, shared)
    length = exact.length_m + design.length_sigma_m * reading
    if design.tape_scale_sigma:
        length = length / (1.0 - design.tape_scale_sigma * shared[:, -1:])
    ground = exact.ground
    if design.ground_root is not None:
        ground = ground + shared[:, ground_slice(design)] @ design.ground_root.T
    # Prior pose: errors of sigma 1 times the inverse root of its information.
    off = pose @ np.linalg.pinv(compute_root(design.information))
    return PhotoDraws(
        pixel_px=exact.pixel_px + design.pixel_sigma_px[:, None] * pick,
        length_m=length,
        center_world_m=exact.center_world_m + off[:, :3],
        world_from_camera=exact.world_from_camera @ exp_so3(off[:, 3:]),
        ground=np.broadcast_to(ground, (len(moved), 3)),
    )


def compute_root(information: Floats) -> Floats:
    """Compute an (n, n) root of a positive semidefinite matrix: it is root times root^T."""
    value, axes = np.linalg.eigh(information)
    return np.asarray(axes * np.sqrt(np.maximum(value, 0.0)))
