"""Pose of single frames from known lengths, by maximum likelihood, many frames at once.

What the joint adjustment does with one frame and no telemetry, cut down to what it needs: three
unknowns m of the plane a frame; picked pixels, lengths and the interior orientation are
observations, all three with their covariances. A point at which two lines meet is one pick. First
values of the joint adjustment, and what a frame's lengths alone say of other lengths, come from
here.

Gauss-Helmert model (Mikhail 1976; Neitzel 2010, linearised at the adjusted observations): per
line f(m, pixels, interior) - length = 0. With A, B, C the derivatives by m, pixels and interior,
W = S_length + B S_pixel B^T + C S_interior C^T is the misclosures' covariance and (A^T W^-1 A)^-1
that of m.
"""

from __future__ import annotations

import math
from contextlib import suppress
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from uavgram.estimation.first_poses.length_conditions import Block, Conditions, LengthFrames
from uavgram.estimation.first_poses.plane_search import PlaneCandidate, search_planes
from uavgram.estimation.survey.likelihood import covariance_root
from uavgram.geometry.camera.back_projection import back_project
from uavgram.model.arrays import Bools, Floats, Ints
from uavgram.model.camera.calibration import Calibration

ITERATIONS = 30
AT_REST = 1e-4
"""Largest change of a plane or an adjusted observation, in its sigmas, at which the iterations end:
the next would be ten times smaller."""

SAME_VIEW = 5e-4
"""Largest change of an adjusted observation, in sigmas, after which the lens looks as it did: its
Jacobians move by some millionths, its pixels as predicted."""

NEAR = 10.0
"""Step of the plane, in its sigmas, below which the observations are adjusted along with it."""

OPEN = 10.0
"""Sigma of a plane, in its own size, from which on the lengths leave it open: such numbers mean
nothing, and any step is small in such sigmas."""

SHORTENINGS = 12
"""Halvings of a step that would bring a picked point behind the camera."""

NEWTON_STEPS = 4
"""From the rays of the lens as given to those of one a few sigmas away: quadratic."""

BLOCK = 96
"""Frames at a time: their matrices stay in the processor's cache."""


class LengthPoses(NamedTuple):
    """Poses of B frames over the plane.

    Attributes
    ----------
    plane
        (B, 3) m = normal / height in the camera frame [1/m]; NaN where nothing was found.
    interior
        (B, P) adjusted interior orientation.
    covariance
        (B, 3 + P, 3 + P) of plane and interior together.
    cost
        (B,) weighted sum of squared residuals; degrees of freedom: number of lines - 3.
    converged
        (B,) whether the iterations came to rest, at a plane that the lengths determine.
    """

    plane: Floats
    interior: Floats
    covariance: Floats
    cost: Floats
    converged: Bools

    def take(self, rows: Ints) -> LengthPoses:
        """Some of the poses, by index."""
        return LengthPoses._make(column[rows] for column in self)


def resect_from_lengths(
    calibration: Calibration, frames: LengthFrames, start_plane: Floats | None = None
) -> LengthPoses:
    """Poses of frames from the lengths they show.

    Parameters
    ----------
    calibration
        Of the one camera that took them all.
    frames
        What was picked and taped.
    start_plane
        (B, 3) first values of the planes; None: the best that `search_planes` finds.

    Returns
    -------
    LengthPoses
        Where `converged` is False, the numbers mean nothing.
    """
    if start_plane is None:
        found = search_frames(calibration, frames)
        best = [c[0].plane if c else np.full(3, np.nan) for c in found]
        start_plane = np.array(best).reshape(-1, 3)
    root = _root(calibration.covariance.tobytes())
    if len(start_plane) <= BLOCK:
        return _solve(calibration, root, frames, start_plane)
    parts = []
    for first in range(0, len(start_plane), BLOCK):
        rows = slice(first, first + BLOCK)
        parts.append(_solve(calibration, root, frames.take(rows), start_plane[rows]))
    return LengthPoses(*(np.concatenate(column) for column in zip(*parts, strict=True)))


def lengths_between(
    calibration: Calibration,
    poses: LengthPoses,
    pixel_px: Floats,
    pixel_sigma_px: Floats,
    pairs: tuple[Ints, Ints],
) -> tuple[Floats, Floats]:
    """Lengths on the ground between other pixels of the frames, and how well they are known.

    Parameters
    ----------
    calibration
        As given to `resect_from_lengths`.
    poses
        Of B frames.
    pixel_px, pixel_sigma_px
        (B, E, 2), (B, E) picks of their own: not those that the poses came from.
    pairs
        (B, k), (B, k) picks at either end.

    Returns
    -------
    length_m : (B, k)
        NaN where an end does not meet the ground.
    covariance_m2 : (B, k, k)
        Joint: pose and interior serve all lengths of a frame, a pick all that end in it.
    """
    number = pairs[0].shape
    frames = LengthFrames(
        pixel_px, pixel_sigma_px, *pairs, length_m=np.zeros(number), length_sigma_m=np.ones(number)
    )
    block = Block(calibration, np.eye(len(calibration.parameters)), frames)
    ray, _ = block.first_view()
    with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
        for _ in range(NEWTON_STEPS):  # from the lens as given to that of each frame
            view = block.view(poses.interior, ray)
            ray[:2] += np.add.reduce(view.off[:, None] * view.inverse, axis=0)
        view = block.view(poses.interior, ray)
        line = block.conditions(poses.plane, np.zeros_like(poses.interior), ray, view)
    from_picks, by_interior = line.noise[..., : block.split], line.noise[..., block.split :]
    jacobian = np.concatenate([line.by_plane.transpose(1, 2, 0), by_interior], axis=2)
    covariance = np.matmul(np.matmul(jacobian, poses.covariance), jacobian.swapaxes(1, 2))
    return -line.misclosure, covariance + np.matmul(from_picks, from_picks.swapaxes(1, 2))


@lru_cache(maxsize=16)
def _root(covariance: bytes) -> Floats:
    """`covariance_root`, once for all frames of a camera."""
    flat = np.frombuffer(covariance)
    size = math.isqrt(len(flat))
    return covariance_root(flat.reshape(size, size))


def line_sigmas(frames: LengthFrames) -> Floats:
    """(B, n) sigma of each length with that of its two picks, from the line's own metres a pixel.

    Good enough to search by; the resection itself carries picks through the lens and plane.
    """
    rows = np.arange(len(frames.start))[:, None]
    along = frames.pixel_px[rows, frames.start] - frames.pixel_px[rows, frames.end]
    along_px = np.maximum(np.linalg.norm(along, axis=-1), 1.0)
    start, end = (frames.pixel_sigma_px[rows, at] for at in (frames.start, frames.end))
    from_picks = frames.length_m * np.hypot(start, end) / along_px
    return np.asarray(np.hypot(frames.length_sigma_m, from_picks))


def search_frames(
    calibration: Calibration, frames: LengthFrames
) -> list[tuple[PlaneCandidate, ...]]:
    """`search_planes` over frames as they were picked."""
    ray = back_project(calibration.model, calibration.parameters, frames.pixel_px)
    rows = np.arange(len(ray))[:, None]
    return search_planes(
        ray[rows, frames.start], ray[rows, frames.end], frames.length_m, line_sigmas(frames)
    )


@np.errstate(invalid="ignore", divide="ignore", over="ignore")  # frames that fail, of many
def _solve(
    calibration: Calibration, root: Floats, frames: LengthFrames, start_plane: Floats
) -> LengthPoses:
    """Gauss-Helmert iterations of some frames together; first values of the planes (B, 3)."""
    block = Block(calibration, root, frames)
    split = block.split
    ray, view = block.first_view()
    plane, adjusted = start_plane, np.zeros((len(start_plane), block.shape[2]))
    for _ in range(ITERATIONS):
        line = block.conditions(plane, adjusted[:, split:], ray, view)
        fit = _fit(block, line)
        step = np.maximum.reduce(np.abs(fit.step) / fit.sigma, axis=1)
        # Far from the plane, the misclosures say nothing of the observations' own errors.
        correction = np.matmul(fit.multiplier[:, None], line.noise)[:, 0]
        correction[step >= NEAR] = 0.0
        change = correction - adjusted
        adjusted = correction
        plane = plane + _shortened(plane, fit.step, ray)
        moved = np.maximum.reduce(np.abs(change), axis=1)
        largest = np.maximum(moved, step)
        if not (largest >= AT_REST).any():  # NaN is no longer going either
            break
        ray[:2] += block.follow(view, adjusted, change)
        if np.maximum.reduce(moved) < SAME_VIEW:
            view = view._replace(off=-block.corrections(adjusted))
        else:
            view = block.view(calibration.parameters + adjusted[:, split:] @ root.T, ray)
    interior = calibration.parameters + adjusted[:, split:] @ root.T
    covariance = _joint_covariance(fit, line.noise[..., split:], root)
    cost = np.add.reduce(fit.multiplier * line.misclosure, axis=1)
    determined = fit.sigma.max(axis=1) < OPEN * np.abs(plane).max(axis=1)
    return LengthPoses(plane, interior, covariance, cost, (largest < AT_REST) & determined)


class _Fit(NamedTuple):
    """One solution of the linearised conditions.

    Attributes
    ----------
    step, sigma
        (B, 3) of the plane.
    multiplier
        (B, n) Lagrange multipliers: P times the misclosure.
    inverse
        (B, n + 3, n + 3) of [[W, A], [A^T, 0]]: [[P, K^T], [K, -(A^T W^-1 A)^-1]], with
        K = (A^T W^-1 A)^-1 A^T W^-1 and P = W^-1 (I - A K).
    """

    step: Floats
    sigma: Floats
    multiplier: Floats
    inverse: Floats


def _fit(block: Block, line: Conditions) -> _Fit:
    n = block.shape[1]
    system = block.system.copy()
    system[:, :n, :n] += np.matmul(line.noise, line.noise.swapaxes(1, 2))
    system[:, :n, n:] = line.by_plane.transpose(1, 2, 0)
    system[:, n:, :n] = line.by_plane.transpose(1, 0, 2)
    inverse = _inverses(system)
    solution = np.matmul(inverse[:, :, :n], line.misclosure[..., None])[..., 0]
    sigma = np.sqrt(-inverse.diagonal(axis1=1, axis2=2)[:, n:])
    return _Fit(solution[:, n:], sigma, solution[:, :n], inverse)


def _inverses(system: Floats) -> Floats:
    """Inverses (B, m, m); NaN where a frame's conditions do not determine its plane at all."""
    try:
        return np.asarray(np.linalg.inv(system))
    except np.linalg.LinAlgError:  # one singular frame would take all others with it
        inverse = np.full_like(system, np.nan)
        for frame, own in enumerate(system):
            with suppress(np.linalg.LinAlgError):
                inverse[frame] = np.linalg.inv(own)
        return inverse


def _shortened(plane: Floats, step: Floats, ray: Floats) -> Floats:
    """Steps (B, 3), halved until all rays (3, 2, B, n) meet the ground in front of the camera."""
    for _ in range(SHORTENINGS):
        depth = np.add.reduce((plane + step).T[:, None, :, None] * ray, axis=0)
        if depth.min() > 0:
            break
        behind = depth.min(axis=(0, 2)) <= 0
        step = np.where(behind[:, None], 0.5 * step, step)
    return step


def _joint_covariance(fit: _Fit, c: Floats, root: Floats) -> Floats:
    """(B, 3 + P, 3 + P) of plane and adjusted interior; c is (B, n, r).

    Cov(m, t) = -K C and Cov(t) = I - C^T P C for the interior t in sigmas.
    """
    n, size = c.shape[1], 3 + len(root)
    reached = np.matmul(fit.inverse[:, :, :n], c)  # P C, K C
    white = np.eye(c.shape[2]) - np.matmul(c.swapaxes(1, 2), reached[:, :n])
    covariance = np.empty((len(c), size, size))
    covariance[:, :3, :3] = -fit.inverse[:, n:, n:]
    covariance[:, :3, 3:] = -np.matmul(reached[:, n:], root.T)
    covariance[:, 3:, :3] = covariance[:, :3, 3:].swapaxes(1, 2)
    covariance[:, 3:, 3:] = np.matmul(np.matmul(root, white), root.T)
    return covariance
