"""The conditions that known lengths put on single frames, many frames at once.

Per line: its length on the plane m, seen through picked pixels and the interior orientation,
equals the one taped. Linearised here at the adjusted observations, solved in `length_resection`.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from uavgram.geometry.back_projection import rays_and_lens
from uavgram.geometry.lens import Distorted, distort, each, write_parameter_derivative
from uavgram.geometry.plane_pose import by_ends, by_plane, lengths_on_plane, ray_pairs
from uavgram.model.arrays import Floats, Ints
from uavgram.model.camera import Calibration


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
        return LengthFrames(
            self.pixel_px[rows],
            self.pixel_sigma_px[rows],
            self.start[rows],
            self.end[rows],
            self.length_m[rows],
            self.length_sigma_m[rows],
        )


class View(NamedTuple):
    """A lens at K undistorted points: how pixels and they depend on each other.

    Attributes
    ----------
    off
        (2, K) picked u and v less those at which the points are seen.
    inverse
        (2, 2, K) inverse of the lens's Jacobian: dx/du, dy/du; dx/dv, dy/dv.
    d_white
        (2, r, K) of u and v by the interior orientation in sigmas.
    """

    off: Floats
    inverse: Floats
    d_white: Floats

    def at(self, picks: Ints) -> View:
        """The same at some of the points."""
        return View(self.off[:, picks], self.inverse[:, :, picks], self.d_white[:, :, picks])


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
    """Some frames, all of their picks in one row: where each line finds its ends and writes."""

    def __init__(self, calibration: Calibration, root: Floats, frames: LengthFrames) -> None:
        self.calibration, self.root = calibration, root
        count, self.picks = frames.pixel_sigma_px.shape
        lines, rank = frames.start.shape[1], root.shape[1]
        width = 2 * self.picks + rank
        ends = np.empty((2, count, lines), dtype=np.int64)
        ends[0], ends[1] = frames.start, frames.end
        frame = np.arange(count)[:, None]
        self.ends = ends + frame * self.picks
        self.pixel = np.ascontiguousarray(frames.pixel_px.reshape(-1, 2).T)
        self.sigma = frames.pixel_sigma_px.ravel()
        self.end_sigma = self.sigma[self.ends]
        self.there = np.isfinite(frames.length_sigma_m)
        self.all_there = bool(self.there.all())
        self.length = frames.length_m
        self.shape = (count, lines, width)
        # Where the derivative by u and v of each end stands among the entries of `noise`.
        row = (frame * lines + np.arange(lines)) * width
        self.place = np.empty((2, 2, count, lines), dtype=np.int64)
        np.add(row, ends, out=self.place[0])
        np.add(self.place[0], self.picks, out=self.place[1])
        # The system's parts that stay: the lengths' own variance, and no information at all
        # about the plane (the smallest number in its place keeps a singular matrix from stopping
        # the others).
        self.system = np.zeros((count, lines + 3, lines + 3))
        diagonal = self.system.reshape(count, -1)[:, :: lines + 4]
        diagonal[:, :lines] = np.where(self.there, frames.length_sigma_m, 1.0) ** 2
        diagonal[:, lines:] = -1e-300

    def per_pick(self, values: Floats) -> Floats:
        """Of values (B, k) of the frames, those (k, B E) of their picks; (k, 1) of a single one."""
        return values.T.repeat(self.picks, axis=1) if len(values) > 1 else values.T

    def first_view(self) -> tuple[Floats, View]:
        """Undistorted points (2, B E) of the picks by the lens as given, and the lens there."""
        model, interior = self.calibration.model, self.calibration.parameters
        x, y, lens = rays_and_lens(model, interior, self.pixel.T)
        point = np.empty((2, len(x)))
        point[0], point[1] = x, y
        return point, self._view(interior, point, lens, np.zeros_like(point))

    def view(self, own: Floats, point: Floats) -> View:
        """The lens with each frame's own interior (B, P), at undistorted points (2, B E)."""
        interior = self.per_pick(own) if len(own) > 1 else own[0]
        lens = distort(self.calibration.model, interior[4:], *point)
        fx, fy, cx, cy = each(interior[:4])
        off = np.empty_like(point)
        np.subtract(self.pixel[0], fx * lens.x + cx, out=off[0])
        np.subtract(self.pixel[1], fy * lens.y + cy, out=off[1])
        return self._view(interior, point, lens, off)

    def _view(self, interior: Floats, point: Floats, lens: Distorted, off: Floats) -> View:
        model, (x, y) = self.calibration.model, point
        fx, fy = each(interior[:2])
        over = 1.0 / (lens.a * lens.c - lens.b * lens.b)
        over_x, over_y = over / fx, over / fy
        inverse = np.empty((2, 2, len(x)))
        np.multiply(lens.c, over_x, out=inverse[0, 0])
        np.multiply(lens.b, -over_x, out=inverse[0, 1])
        np.multiply(lens.b, -over_y, out=inverse[1, 0])
        np.multiply(lens.a, over_y, out=inverse[1, 1])
        d_interior = np.empty((2, len(interior), len(x)))
        by_point = d_interior.transpose(2, 0, 1)
        write_parameter_derivative(by_point, model, interior, lens, (x, y))
        return View(off, inverse, np.matmul(self.root.T, d_interior))

    def conditions(self, plane: Floats, whitened: Floats, ray: Floats, view: View) -> Conditions:
        """Linearise at planes (B, 3), interior in sigmas (B, r), rays (2, 3, B, n) of the ends."""
        lines = ray_pairs(ray)
        lengths = lengths_on_plane(plane.T[:, :, None], lines)
        off, inverse, d_white = view.at(self.ends)
        # From the derivative by the undistorted point to that by the pixel: (u or v, end, B, n).
        by_xy = by_ends(lengths, lines).swapaxes(0, 1)
        by_pixel = np.add.reduce(inverse * by_xy, axis=1)
        # Of the interior at a fixed pixel: the point moves against it.
        by_white = np.add.reduce(d_white * by_pixel[:, None], axis=(0, 2)).transpose(1, 2, 0)
        misclosure = self.length - lengths.length
        misclosure -= np.add.reduce(by_pixel * off, axis=(0, 1))
        misclosure -= np.matmul(by_white, whitened[..., None])[..., 0]
        noise = np.zeros(self.shape)
        noise.reshape(-1)[self.place] = by_pixel * self.end_sigma
        np.negative(by_white, out=noise[..., 2 * self.picks :])
        by_m = by_plane(lengths, lines)
        if not self.all_there:
            by_m[:, ~self.there] = 0.0
            noise[~self.there] = 0.0
            misclosure[~self.there] = 0.0
        return Conditions(by_m, noise, misclosure)

    def corrections(self, adjusted: Floats) -> Floats:
        """(2, B E) corrections of the pixels [px], from (B, 2 E + r) in sigmas."""
        count = len(adjusted)
        by_pick = adjusted[:, : 2 * self.picks].reshape(count, 2, self.picks).swapaxes(0, 1)
        return by_pick.reshape(2, -1) * self.sigma

    def follow(self, view: View, point: Floats, adjusted: Floats, change: Floats) -> Floats:
        """Undistorted points (2, B E) of adjusted pixels and interior: one Newton step.

        Parameters
        ----------
        adjusted, change
            (B, 2 E + r) corrections of the observations in sigmas, and how they differ from those
            at which `view` was taken.
        """
        off = self.corrections(adjusted)
        off += view.off
        interior = self.per_pick(change[:, 2 * self.picks :])
        off -= np.add.reduce(view.d_white * interior, axis=1)
        return np.asarray(point + np.add.reduce(off[:, None] * view.inverse, axis=0))
