"""Poses of single frames from known lengths, and a gate for them by the poses of the telemetry.

A reduced form of the joint adjustment for one frame without telemetry: three unknowns m of the
plane for each frame; picked pixels, lengths and the interior orientation are observations, all
three with their covariances. A point at which two lines meet is one pick. The results are initial
values of the joint adjustment.

Gauss-Helmert model (Mikhail 1976; Neitzel 2010, linearised at the adjusted observations): per line
f(m, pixels, interior) - length = 0 (`Conditions`). With A, B, C the derivatives by m, pixels and
interior, W = S_length + B S_pixel B^T + C S_interior C^T is the misclosures' covariance and (A^T
W^-1 A)^-1 that of m.
"""

from __future__ import annotations

import math
from contextlib import suppress
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from scipy.special import chdtri

from uavgram.estimation.first_poses.plane_search import KnownPlanes, search_planes
from uavgram.estimation.survey.likelihood import compute_covariance_root
from uavgram.geometry.camera.lens import (
    Distorted,
    distort,
    split_components,
    write_parameter_derivative,
)
from uavgram.geometry.camera.projection import back_project, rays_and_lens
from uavgram.geometry.ground.plane import (
    compute_end_components,
    differentiate_by_ends,
    differentiate_by_plane,
    lengths_on_plane,
)
from uavgram.geometry.motion.rotation import exp_so3
from uavgram.model.arrays import Bools, Floats, Ints
from uavgram.model.camera import Calibration
from uavgram.model.survey import Ground


class LengthFrames(NamedTuple):
    """B frames, each with up to E picks and up to n known lengths between them.

    Attributes
    ----------
    pixel_px, pixel_sigma_px
        (B, E, 2), (B, E) picks; a pick without a line may have any finite values.
    start, end
        (B, n) pick at each end of a line.
    length_m, length_sigma_m
        (B, n); an infinite sigma marks a line that the frame does not have (its ends are any two
        picks).
    """

    pixel_px: Floats
    pixel_sigma_px: Floats
    start: Ints
    end: Ints
    length_m: Floats
    length_sigma_m: Floats

    def take(self, rows: Ints | slice) -> LengthFrames:
        """Return some of the frames, by index or slice."""
        return LengthFrames._make(column[rows] for column in self)


class View(NamedTuple):
    """Projection of both ends of all lines, linearised in the undistorted points.

    Attributes
    ----------
    off
        (2, 2, B, n) picked u and v (first axis) minus predicted ones.
    inverse
        (2, 2, 2, B, n) inverse of the lens's Jacobian: dx/du, dy/du; dx/dv, dy/dv.
    d_interior
        (2, P, 2, B, n) derivatives of u and v by the interior orientation.
    """

    off: Floats
    inverse: Floats
    d_interior: Floats


class Conditions(NamedTuple):
    """Linearised conditions of all lines.

    Attributes
    ----------
    by_plane
        (3, B, n) A.
    noise
        (B, n, 2 E + r): B and C times the roots of their observations' covariances.
    misclosure
        (B, n) length minus its prediction from the observed pixels and interior, to first order.
    """

    by_plane: Floats
    noise: Floats
    misclosure: Floats


class FrameBlock:
    """Some frames, with the positions of each line's picks among the observations.

    All arrays are ordered by the ends of lines, (2, B, n); a pick at which two lines meet occurs
    twice, but is one observation.
    """

    def __init__(self, calibration: Calibration, root: Floats, frames: LengthFrames) -> None:
        self.calibration, self.root = calibration, root
        count, picks = frames.pixel_sigma_px.shape
        lines = frames.start.shape[1]
        self.split = 2 * picks  # first column of the interior, after those of the pixels
        self.shape = (count, lines, self.split + root.shape[1])
        ends = np.stack([frames.start, frames.end])
        frame = np.arange(count)[:, None]
        self.pixel = frames.pixel_px[frame, ends]
        self.sigma = frames.pixel_sigma_px[frame, ends]
        # Positions of u and v of each end among the observations, and in the entries of `noise`.
        uv = np.stack([ends, ends + picks])
        self.pick = uv + frame * self.shape[2]
        self.place = uv + (frame * lines + np.arange(lines)) * self.shape[2]
        self.there = np.isfinite(frames.length_sigma_m)
        self.all_there = bool(self.there.all())
        self.length = frames.length_m
        # Constant parts of the system: the lengths' own variance, and no information about the
        # plane (the smallest number in its place keeps a singular matrix from stopping the others).
        self.system = np.zeros((count, lines + 3, lines + 3))
        diagonal = np.einsum("bii->bi", self.system)  # a view
        diagonal[:, :lines] = np.where(self.there, frames.length_sigma_m, 1.0) ** 2
        diagonal[:, lines:] = -1e-300

    def first_view(self) -> tuple[Floats, View]:
        """Compute rays (3, 2, B, n) of the ends by the given lens, z = 1, and the view there."""
        model, interior = self.calibration.model, self.calibration.parameters
        x, y, lens = rays_and_lens(model, interior, self.pixel)
        ray = np.ones((3, *x.shape))
        ray[0], ray[1] = x, y
        return ray, self._view(interior, ray, lens, np.zeros((2, *x.shape)))

    def view(self, own: Floats, ray: Floats) -> View:
        """Compute the view with each frame's own interior (B, P), at rays (3, 2, B, n)."""
        interior = own.T[:, None, :, None] if len(own) > 1 else own[0]
        lens = distort(self.calibration.model, interior[4:], ray[0], ray[1])
        fx, fy, cx, cy = split_components(interior[:4])
        off = np.empty((2, *lens.x.shape))
        np.subtract(self.pixel[..., 0], fx * lens.x + cx, out=off[0])
        np.subtract(self.pixel[..., 1], fy * lens.y + cy, out=off[1])
        return self._view(interior, ray, lens, off)

    def _view(self, interior: Floats, ray: Floats, lens: Distorted, off: Floats) -> View:
        fx, fy = split_components(interior[:2])
        # Inverse of the symmetric 2 x 2 Jacobian [[a, b], [b, c]] of the distortion, over fx and
        # fy.
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
            View at these rays.
        """
        lengths = lengths_on_plane(plane.T[:, :, None], ray)
        reach = compute_end_components(lengths)
        by_m = differentiate_by_plane(lengths, reach)
        # Chain rule from the undistorted point to the pixel: (u or v, end, B, n).
        by_pixel = np.add.reduce(view.inverse * differentiate_by_ends(lengths, reach), axis=1)
        # By the interior at a fixed pixel: the undistorted point moves in the opposite sense.
        by_interior = np.add.reduce(view.d_interior * by_pixel[:, None], axis=(0, 2))
        noise = np.zeros(self.shape)
        noise.reshape(-1)[self.place] = by_pixel * self.sigma
        by_white = np.matmul(by_interior.transpose(1, 2, 0), -self.root)
        noise[..., self.split :] = by_white
        # Length minus f at the observed l0, t0 to first order: f(m, l, t) + B (l0 - l) + C (t0 -
        # t).
        misclosure = self.length - lengths.length
        misclosure -= np.add.reduce(by_pixel * view.off, axis=(0, 1))
        misclosure += np.matmul(by_white, whitened[..., None])[..., 0]
        if not self.all_there:
            by_m[:, ~self.there] = 0.0
            noise[~self.there] = 0.0
            misclosure[~self.there] = 0.0
        return Conditions(by_m, noise, misclosure)

    def corrections(self, adjusted: Floats) -> Floats:
        """Return (2, 2, B, n) corrections of the pixels [px], from (B, 2 E + r) in sigmas."""
        return np.asarray(adjusted.reshape(-1)[self.pick] * self.sigma)

    def follow(self, view: View, adjusted: Floats, change: Floats) -> Floats:
        """Compute (2, 2, B, n) Newton steps in undistorted x and y to the adjusted observations.

        Parameters
        ----------
        adjusted, change
            (B, 2 E + r) corrections of the observations in sigmas, and their change since `view`
            was computed.
        """
        off = self.corrections(adjusted) + view.off
        interior = np.matmul(change[:, self.split :], self.root.T)
        off -= np.add.reduce(view.d_interior * interior.T[:, None, :, None], axis=1)
        return np.asarray(np.add.reduce(off[:, None] * view.inverse, axis=0))


MAX_ITERATIONS = 30
MAX_LAST_CHANGE = 1e-4
"""Largest change of a plane or an adjusted observation, in its sigmas, at which the iterations end:
the next would be ten times smaller."""

MAX_VIEW_CHANGE = 5e-4
"""Largest change of an adjusted observation, in sigmas, for which the view is kept: its Jacobians
change by some millionths, and its pixels as predicted."""

MAX_STEP_SIGMAS = 10.0
"""Step of the plane, in its sigmas, below which the observations are adjusted together with it."""

MAX_RELATIVE_SIGMA = 10.0
"""Sigma of a plane, relative to its size, above which the lengths do not determine it: its numbers
have no meaning, and any step is small in such sigmas."""

MAX_HALVINGS = 12
"""Largest number of halvings of a step that would bring a picked point behind the camera."""

FRAMES_AT_ONCE = 96
"""Frames at a time: their matrices stay in the processor's cache."""


class LengthPoses(NamedTuple):
    """Poses of B frames over the plane.

    Attributes
    ----------
    plane
        (B, 3) m = normal / height in the camera frame [1/m]; NaN if none was found.
    covariance
        (B, 3, 3) of the plane, with the effect of the interior orientation's covariance.
    cost
        (B,) weighted sum of squared residuals; degrees of freedom: number of lines - 3.
    converged
        (B,) whether the iterations converged to a plane that the lengths determine.
    """

    plane: Floats
    covariance: Floats
    cost: Floats
    converged: Bools

    def take(self, rows: Ints) -> LengthPoses:
        """Return some of the poses, by index."""
        return LengthPoses._make(column[rows] for column in self)


def resect_from_lengths(
    calibration: Calibration, frames: LengthFrames, start_plane: Floats | None = None
) -> LengthPoses:
    """Estimate the pose of each frame from known lengths.

    Parameters
    ----------
    calibration
        Calibration of the one camera that took all frames.
    frames
        Picks and taped lengths.
    start_plane
        (B, 3) initial planes; None: the best that `search_planes` finds.

    Returns
    -------
    LengthPoses
        If `converged` is False, the numbers have no meaning.
    """
    if start_plane is None:
        found = search_frames(calibration, frames)
        best = [planes.plane[0] if len(planes.plane) else np.full(3, np.nan) for planes in found]
        start_plane = np.array(best).reshape(-1, 3)
    root = _root(calibration.covariance.tobytes())
    if len(start_plane) <= FRAMES_AT_ONCE:
        return _solve(calibration, root, frames, start_plane)
    parts = []
    for first in range(0, len(start_plane), FRAMES_AT_ONCE):
        rows = slice(first, first + FRAMES_AT_ONCE)
        parts.append(_solve(calibration, root, frames.take(rows), start_plane[rows]))
    return LengthPoses(*(np.concatenate(column) for column in zip(*parts, strict=True)))


@lru_cache(maxsize=16)
def _root(covariance: bytes) -> Floats:
    """Compute `covariance_root`, once for all frames of a camera."""
    flat = np.frombuffer(covariance)
    size = math.isqrt(len(flat))
    return compute_covariance_root(flat.reshape(size, size))


def compute_line_sigmas(frames: LengthFrames) -> Floats:
    """Compute (B, n) sigmas of lengths including their two picks, by the line's own scale [m/px].

    Accurate enough for the search; the resection itself propagates picks through lens and plane.
    """
    rows = np.arange(len(frames.start))[:, None]
    along = frames.pixel_px[rows, frames.start] - frames.pixel_px[rows, frames.end]
    along_px = np.maximum(np.linalg.norm(along, axis=-1), 1.0)
    start, end = (frames.pixel_sigma_px[rows, at] for at in (frames.start, frames.end))
    from_picks = frames.length_m * np.hypot(start, end) / along_px
    return np.asarray(np.hypot(frames.length_sigma_m, from_picks))


def search_frames(calibration: Calibration, frames: LengthFrames) -> list[KnownPlanes]:
    """Search planes of frames by `search_planes`, from their picks."""
    ray = back_project(calibration.model, calibration.parameters, frames.pixel_px)
    rows = np.arange(len(ray))[:, None]
    return search_planes(
        ray[rows, frames.start], ray[rows, frames.end], frames.length_m, compute_line_sigmas(frames)
    )


@np.errstate(invalid="ignore", divide="ignore", over="ignore")  # some frames may fail
def _solve(
    calibration: Calibration, root: Floats, frames: LengthFrames, start_plane: Floats
) -> LengthPoses:
    """Iterate the Gauss-Helmert model of some frames together, from initial planes (B, 3)."""
    block = FrameBlock(calibration, root, frames)
    split = block.split
    ray, view = block.first_view()
    plane, adjusted = start_plane, np.zeros((len(start_plane), block.shape[2]))
    for _ in range(MAX_ITERATIONS):
        line = block.conditions(plane, adjusted[:, split:], ray, view)
        fit = _fit(block, line)
        step = np.maximum.reduce(np.abs(fit.step) / fit.sigma, axis=1)
        # Far from the solution the misclosures contain no information on the observations' errors.
        correction = np.matmul(fit.multiplier[:, None], line.noise)[:, 0]
        correction[step >= MAX_STEP_SIGMAS] = 0.0
        change = correction - adjusted
        adjusted = correction
        plane = plane + _shorten(plane, fit.step, ray)
        moved = np.maximum.reduce(np.abs(change), axis=1)
        largest = np.maximum(moved, step)
        if not (largest >= MAX_LAST_CHANGE).any():  # NaN counts as ended
            break
        ray[:2] += block.follow(view, adjusted, change)
        if np.maximum.reduce(moved) < MAX_VIEW_CHANGE:
            view = view._replace(off=-block.corrections(adjusted))
        else:
            view = block.view(calibration.parameters + adjusted[:, split:] @ root.T, ray)
    cost = np.add.reduce(fit.multiplier * line.misclosure, axis=1)
    determined = fit.sigma.max(axis=1) < MAX_RELATIVE_SIGMA * np.abs(plane).max(axis=1)
    converged = (largest < MAX_LAST_CHANGE) & determined
    return LengthPoses(plane, -fit.inverse[:, block.shape[1] :, block.shape[1] :], cost, converged)


class _Fit(NamedTuple):
    """One solution of the linearised conditions.

    Attributes
    ----------
    step, sigma
        (B, 3) of the plane.
    multiplier
        (B, n) Lagrange multipliers: P times the misclosure.
    inverse
        (B, n + 3, n + 3) of [[W, A], [A^T, 0]]: [[P, K^T], [K, -(A^T W^-1 A)^-1]], with K = (A^T
        W^-1 A)^-1 A^T W^-1 and P = W^-1 (I - A K).
    """

    step: Floats
    sigma: Floats
    multiplier: Floats
    inverse: Floats


def _fit(block: FrameBlock, line: Conditions) -> _Fit:
    n = block.shape[1]
    # Bordered system [[W, A], [A^T, 0]] of the conditions and the plane.
    system = block.system.copy()
    system[:, :n, :n] += np.matmul(line.noise, line.noise.swapaxes(1, 2))
    system[:, :n, n:] = line.by_plane.transpose(1, 2, 0)
    system[:, n:, :n] = line.by_plane.transpose(1, 0, 2)
    inverse = _inverses(system)
    solution = np.matmul(inverse[:, :, :n], line.misclosure[..., None])[..., 0]
    sigma = np.sqrt(-inverse.diagonal(axis1=1, axis2=2)[:, n:])
    return _Fit(solution[:, n:], sigma, solution[:, :n], inverse)


def _inverses(system: Floats) -> Floats:
    """Invert (B, m, m); NaN if a frame's conditions do not determine its plane at all."""
    try:
        return np.asarray(np.linalg.inv(system))
    except np.linalg.LinAlgError:  # one singular frame stops the inversion of all
        inverse = np.full_like(system, np.nan)
        for frame, own in enumerate(system):
            with suppress(np.linalg.LinAlgError):
                inverse[frame] = np.linalg.inv(own)
        return inverse


def _shorten(plane: Floats, step: Floats, ray: Floats) -> Floats:
    """Halve steps (B, 3) until all rays (3, 2, B, n) meet the ground in front of the camera."""
    for _ in range(MAX_HALVINGS):
        depth = np.add.reduce((plane + step).T[:, None, :, None] * ray, axis=0)
        if depth.min() > 0:
            break
        behind = depth.min(axis=(0, 2)) <= 0
        step = np.where(behind[:, None], 0.5 * step, step)
    return step


OUTSIDE_PROBABILITY = 0.001
"""Probability that a true pose is outside the gate."""

HEIGHT, TILT = 0, slice(1, 3)


class SeedComparison(NamedTuple):
    """Comparison of C candidate planes of one frame with its seed.

    Attributes
    ----------
    squared_distance
        (C,) squared Mahalanobis distances.
    shift
        (C, 3) shift of the seed to the weighted mean of seed and candidate: in height [m], and in
        two tilts [rad].
    """

    squared_distance: Floats
    shift: Floats


def compare_with_seed(
    center_world_m: Floats,
    world_from_camera: Floats,
    covariance: Floats,
    ground: Ground,
    poses: LengthPoses,
) -> SeedComparison:
    """Compare poses from lengths with the one from the telemetry.

    Three numbers are compared: the height above the ground, and the two differences in the
    direction of down in the camera; lengths do not determine the place along the ground and the
    heading.

    Parameters
    ----------
    center_world_m, world_from_camera, covariance
        (3,), (3, 3), (6, 6) of the seed, with the contribution of the telemetry's shared unknowns.
    ground
        Prior of the plane; its sigmas widen the gate.
    poses
        C converged candidates of that frame, with their own covariances.
    """
    down = -world_from_camera[2]
    size = np.linalg.norm(poses.plane, axis=1)
    normal = poses.plane / size[:, None]
    # Two directions in the camera, perpendicular to the seed's down.
    sideways = np.asarray(np.linalg.svd(down[None]).Vh[1:])
    seed_height = center_world_m[2] - ground.height_m
    turn = _turn(down, normal)
    difference = np.column_stack([1.0 / size - seed_height, turn @ sideways.T])
    # Seed: with R exp(a), down in the camera turns by -a, of which only the part across it counts.
    by_pose = np.zeros((3, 6))
    by_pose[HEIGHT, 2] = 1.0
    by_pose[TILT, 3:] = -sideways
    prior = by_pose @ covariance @ by_pose.T
    prior[HEIGHT, HEIGHT] += ground.height_sigma_m**2
    prior[TILT, TILT] += ground.slope_sigma_rad**2 * np.eye(2)
    # Candidate: m = n / h, so dh = -h^2 (n . dm), and n turns by h (n x dm).
    by_plane = np.empty((len(normal), 3, 3))
    by_plane[:, HEIGHT] = -normal / size[:, None] ** 2
    across = np.cross(normal[:, None], np.eye(3)[None]) / size[:, None, None]
    by_plane[:, TILT] = np.einsum("ti,cji->ctj", sideways, across)
    own = by_plane @ poses.covariance @ by_plane.swapaxes(1, 2)
    # Squared Mahalanobis distance d^T (P + C)^-1 d, and shift P (P + C)^-1 d to the weighted mean.
    weighted = np.linalg.solve(prior + own, difference[..., None])
    return SeedComparison(np.sum(difference * weighted[..., 0], axis=1), (prior @ weighted)[..., 0])


def find_allowed(squared_distance: Floats) -> Bools:
    """Mark the candidates (C,) inside the gate (chi-square with three degrees of freedom)."""
    return np.asarray(squared_distance <= float(chdtri(3, OUTSIDE_PROBABILITY)))


def move_seed_to_plane(
    center_world_m: Floats, world_from_camera: Floats, ground: Ground, plane: Floats
) -> tuple[Floats, Floats]:
    """Replace height and level of the seed by those of a candidate plane (3,).

    Parameters
    ----------
    center_world_m, world_from_camera
        (3,), (3, 3) of the seed.
    ground
        Prior of the plane, for its height.
    plane
        (3,) m = normal / height in the camera frame [1/m].
    """
    size = np.linalg.norm(plane)
    center = center_world_m.copy()
    center[2] = ground.height_m + 1.0 / size
    # R exp(a) has down of the candidate in the direction where R had that of the seed.
    turn = _turn(-world_from_camera[2], (plane / size)[None])
    return center, world_from_camera @ exp_so3(-turn)[0]


def _turn(start: Floats, ends: Floats) -> Floats:
    """Compute the shortest rotation vectors (C, 3) from a unit vector (3,) to others (C, 3)."""
    axis = np.cross(start, ends)
    sine = np.linalg.norm(axis, axis=1)
    angle = np.arctan2(sine, ends @ start)
    return np.asarray(
        axis * np.divide(angle, sine, out=np.ones_like(sine), where=sine > 0)[:, None]
    )
