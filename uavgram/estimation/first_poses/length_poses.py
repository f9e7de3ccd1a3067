"""Pose of single frames from known lengths, by maximum likelihood, many frames at once.

What the joint adjustment does with one frame and no telemetry, cut down to what it needs: three
unknowns m of the plane a frame; picked pixels, lengths and the interior orientation are
observations, all three with their covariances. A point at which two lines meet is one pick. First
values of the joint adjustment, and what a frame's lengths alone say of other lengths, come from
here.

Gauss-Helmert model (Mikhail 1976; Neitzel 2010, linearised at the adjusted observations): per
line f(m, pixels, interior) - length = 0 (`Conditions`). With A, B, C the derivatives by m, pixels
and interior, W = S_length + B S_pixel B^T + C S_interior C^T is the misclosures' covariance and
(A^T W^-1 A)^-1 that of m.
"""

from __future__ import annotations

import math
from contextlib import suppress
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from uavgram.estimation.first_poses.plane_search import PlaneCandidate, search_planes
from uavgram.estimation.survey.likelihood import covariance_root
from uavgram.geometry.camera.back_projection import back_project, rays_and_lens
from uavgram.geometry.camera.lens import Distorted, distort, each, write_parameter_derivative
from uavgram.geometry.ground.plane_pose import by_ends, by_plane, lengths_on_plane, reach_of
from uavgram.model.arrays import Bools, Floats, Ints
from uavgram.model.camera.calibration import Calibration


class LengthFrames(NamedTuple):
    """B frames, each with up to E picks and up to n known lengths between them.

    Attributes
    ----------
    pixel_px, pixel_sigma_px
        (B, E, 2), (B, E) picks; one no line refers to may hold any finite numbers.
    start, end
        (B, n) pick at each end of a line.
    length_m, length_sigma_m
        (B, n); an infinite sigma says that the frame has no such line (its ends are any two
        picks).
    """

    pixel_px: Floats
    pixel_sigma_px: Floats
    start: Ints
    end: Ints
    length_m: Floats
    length_sigma_m: Floats

    def take(self, rows: Ints | slice) -> LengthFrames:
        """Some of the frames, by index or slice."""
        return LengthFrames._make(column[rows] for column in self)


class View(NamedTuple):
    """A lens at the undistorted points of both ends of all lines: how pixels hang on them.

    Attributes
    ----------
    off
        (2, 2, B, n) picked u and v (first axis) less those at which the points are seen.
    inverse
        (2, 2, 2, B, n) inverse of the lens's Jacobian: dx/du, dy/du; dx/dv, dy/dv.
    d_interior
        (2, P, 2, B, n) of u and v by the interior orientation.
    """

    off: Floats
    inverse: Floats
    d_interior: Floats


class Conditions(NamedTuple):
    """The conditions of all lines, linearised.

    Attributes
    ----------
    by_plane
        (3, B, n) A.
    noise
        (B, n, 2 E + r): B and C times the roots of their observations' covariances.
    misclosure
        (B, n) length minus what the observed pixels and interior give, to first order.
    """

    by_plane: Floats
    noise: Floats
    misclosure: Floats


class Block:
    """Some frames: where each line finds its picks among the observations, and writes.

    Everything stands by the ends of lines, (2, B, n); a pick at which two lines meet is there
    twice, and one observation all the same.
    """

    def __init__(self, calibration: Calibration, root: Floats, frames: LengthFrames) -> None:
        self.calibration, self.root = calibration, root
        count, picks = frames.pixel_sigma_px.shape
        lines = frames.start.shape[1]
        self.split = 2 * picks  # of the observations: pixels before, interior behind
        self.shape = (count, lines, self.split + root.shape[1])
        ends = np.stack([frames.start, frames.end])
        frame = np.arange(count)[:, None]
        self.pixel = frames.pixel_px[frame, ends]
        self.sigma = frames.pixel_sigma_px[frame, ends]
        # Where u and v of each end stand among the observations, and in the entries of `noise`.
        uv = np.stack([ends, ends + picks])
        self.pick = uv + frame * self.shape[2]
        self.place = uv + (frame * lines + np.arange(lines)) * self.shape[2]
        self.there = np.isfinite(frames.length_sigma_m)
        self.all_there = bool(self.there.all())
        self.length = frames.length_m
        # The system's parts that stay: the lengths' own variance, and no information at all
        # about the plane (the smallest number in its place keeps a singular matrix from stopping
        # the others).
        self.system = np.zeros((count, lines + 3, lines + 3))
        diagonal = np.einsum("bii->bi", self.system)  # a view
        diagonal[:, :lines] = np.where(self.there, frames.length_sigma_m, 1.0) ** 2
        diagonal[:, lines:] = -1e-300

    def first_view(self) -> tuple[Floats, View]:
        """Rays (3, 2, B, n) of the ends by the lens as given, z = 1, and the lens there."""
        model, interior = self.calibration.model, self.calibration.parameters
        x, y, lens = rays_and_lens(model, interior, self.pixel)
        ray = np.ones((3, *x.shape))
        ray[0], ray[1] = x, y
        return ray, self._view(interior, ray, lens, np.zeros((2, *x.shape)))

    def view(self, own: Floats, ray: Floats) -> View:
        """The lens with each frame's own interior (B, P), at rays (3, 2, B, n)."""
        interior = own.T[:, None, :, None] if len(own) > 1 else own[0]
        lens = distort(self.calibration.model, interior[4:], ray[0], ray[1])
        fx, fy, cx, cy = each(interior[:4])
        off = np.empty((2, *lens.x.shape))
        np.subtract(self.pixel[..., 0], fx * lens.x + cx, out=off[0])
        np.subtract(self.pixel[..., 1], fy * lens.y + cy, out=off[1])
        return self._view(interior, ray, lens, off)

    def _view(self, interior: Floats, ray: Floats, lens: Distorted, off: Floats) -> View:
        fx, fy = each(interior[:2])
        over = 1.0 / (lens.a * lens.c - lens.b * lens.b)
        over_x, over_y = over / fx, over / fy
        inverse = np.empty((2, 2, *over.shape))
        np.multiply(lens.c, over_x, out=inverse[0, 0])
        np.multiply(lens.b, -over_x, out=inverse[0, 1])
        np.multiply(lens.b, -over_y, out=inverse[1, 0])
        np.multiply(lens.a, over_y, out=inverse[1, 1])
        d_interior = np.empty((2, len(interior), *over.shape))
        by_end = d_interior.transpose(2, 3, 4, 0, 1)
        write_parameter_derivative(by_end, self.calibration.model, interior, lens, (ray[0], ray[1]))
        return View(off, inverse, d_interior)

    def conditions(self, plane: Floats, whitened: Floats, ray: Floats, view: View) -> Conditions:
        """Linearise at planes (B, 3), interior in sigmas (B, r), rays (3, 2, B, n) of the ends.

        Parameters
        ----------
        plane
            (B, 3) m = normal / height in the camera frame [1/m].
        whitened
            (B, r) departures of the interior orientation, in sigmas.
        ray
            (3, 2, B, n) rays of the lines' ends, in the camera frame.
        view
            The lens at these rays.
        """
        lengths = lengths_on_plane(plane.T[:, :, None], ray)
        reach = reach_of(lengths)
        by_m = by_plane(lengths, reach)
        # From the derivative by the undistorted point to that by the pixel: (u or v, end, B, n).
        by_pixel = np.add.reduce(view.inverse * by_ends(lengths, reach), axis=1)
        # Of the interior at a fixed pixel: the point moves against it.
        by_interior = np.add.reduce(view.d_interior * by_pixel[:, None], axis=(0, 2))
        noise = np.zeros(self.shape)
        noise.reshape(-1)[self.place] = by_pixel * self.sigma
        by_white = np.matmul(by_interior.transpose(1, 2, 0), -self.root)
        noise[..., self.split :] = by_white
        misclosure = self.length - lengths.length
        misclosure -= np.add.reduce(by_pixel * view.off, axis=(0, 1))
        misclosure += np.matmul(by_white, whitened[..., None])[..., 0]
        if not self.all_there:
            by_m[:, ~self.there] = 0.0
            noise[~self.there] = 0.0
            misclosure[~self.there] = 0.0
        return Conditions(by_m, noise, misclosure)

    def corrections(self, adjusted: Floats) -> Floats:
        """(2, 2, B, n) corrections of the pixels [px], from (B, 2 E + r) in sigmas."""
        return np.asarray(adjusted.reshape(-1)[self.pick] * self.sigma)

    def follow(self, view: View, adjusted: Floats, change: Floats) -> Floats:
        """(2, 2, B, n) to adjusted pixels and interior, in undistorted x and y: a Newton step.

        Parameters
        ----------
        adjusted, change
            (B, 2 E + r) corrections of the observations in sigmas, and how they differ from those
            at which `view` was taken.
        """
        off = self.corrections(adjusted) + view.off
        interior = np.matmul(change[:, self.split :], self.root.T)
        off -= np.add.reduce(view.d_interior * interior.T[:, None, :, None], axis=1)
        return np.asarray(np.add.reduce(off[:, None] * view.inverse, axis=0))


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

FRAMES_AT_ONCE = 96
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
    if len(start_plane) <= FRAMES_AT_ONCE:
        return _solve(calibration, root, frames, start_plane)
    parts = []
    for first in range(0, len(start_plane), FRAMES_AT_ONCE):
        rows = slice(first, first + FRAMES_AT_ONCE)
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
