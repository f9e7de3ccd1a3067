"""How well lengths in one photo will be known, and what makes their errors: without any draw."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from uavgram.estimation.repeated.common_errors import common_count, of_ground
from uavgram.estimation.repeated.photo_step import State, draws_last, linearise
from uavgram.model.arrays import Floats, Ints
from uavgram.model.simulation.photo import PhotoDesign, PhotoDraws


class PredictedLengths(NamedTuple):
    """M variances [m²], and what of them comes from each source.

    Attributes
    ----------
    variance
        (M,).
    lengths, picks, beforehand, camera, tape, ground
        (M,) parts of it: of the readings, of all picks, of the pose beforehand, of the camera's
        parameters, of the tape's scale, of the ground's plane. They add up to the variance.
    """

    variance: Floats
    lengths: Floats
    picks: Floats
    beforehand: Floats
    camera: Floats
    tape: Floats
    ground: Floats


def predict_lengths(
    design: PhotoDesign, exact: PhotoDraws, place_m: Floats, pairs: Ints
) -> PredictedLengths:
    """Covariance of the adjustment at the truth, and its parts.

    With unknowns x, of which everything but the readings has a prior, the estimate's error is
    C (H^T R^-1 n + L b), n being errors of readings and b those of what is known beforehand; the
    errors are independent, so the variance is the sum over them.

    Parameters
    ----------
    design
        Of the photo.
    exact
        One draw without any error.
    place_m
        (E, 2) true places of its ends.
    pairs
        (M, 2) ends of the lengths that are measured.
    """
    used = len(design.line)
    every = replace(
        design,
        line=np.concatenate([design.line, pairs]),
        length_sigma_m=np.concatenate([design.length_sigma_m, np.ones(len(pairs))]),
    )
    reading = np.concatenate([exact.length_m[0], np.ones(len(pairs))])
    draws = draws_last(exact)._replace(length=reading[:, None])
    common = np.zeros((common_count(design), 1))
    state = State(exact.center_world_m.T, np.zeros((3, 1)), place_m.T[..., None], common)
    line = linearise(every, draws, state)
    ends, shared = place_m.shape[0], common.shape[0]
    rows = np.zeros((len(every.line), 6 + 2 * ends + shared))
    rows[:, :6] = line.lower[..., 0] @ line.by_pose[..., 0]
    for own, at in zip(line.by_error[..., 0], every.line.T, strict=True):
        for k in (0, 1):
            rows[np.arange(len(rows)), 6 + 2 * at + k] += own[k]
    rows[:, 6 + 2 * ends :] = line.by_common[..., 0]
    if design.tape_scale_sigma:
        rows[used:, -1] = 0.0  # what is measured, no tape reads
    before = np.eye(rows.shape[1])
    before[:6, :6] = design.information
    weighted = rows[:used] / design.length_sigma_m[:, None]
    covariance = np.linalg.inv(before + weighted.T @ weighted)
    gain = rows[used:] @ covariance
    of_readings = gain @ weighted.T
    picks, of_plane = slice(6, 6 + 2 * ends), of_ground(design)
    ground = slice(picks.stop + of_plane.start, picks.stop + of_plane.stop)
    return PredictedLengths(
        variance=np.einsum("mi,mi->m", gain, rows[used:]),
        lengths=np.sum(of_readings**2, axis=1),
        picks=np.sum(gain[:, picks] ** 2, axis=1),
        beforehand=np.einsum("mi,ij,mj->m", gain[:, :6], design.information, gain[:, :6]),
        camera=np.sum(gain[:, picks.stop : ground.start] ** 2, axis=1),
        tape=np.sum(gain[:, ground.stop :] ** 2, axis=1),
        ground=np.sum(gain[:, ground] ** 2, axis=1),
    )
