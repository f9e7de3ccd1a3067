"""The conditions that known lengths put on single frames, many frames at once.

Per line: its length on the plane m, seen through picked pixels and the interior orientation,
equals the one taped. Linearised here at the adjusted observations, solved in `resection`.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from uavgram.geometry.camera.back_projection import rays_and_lens
from uavgram.geometry.camera.lens import Distorted, distort, each, write_parameter_derivative
from uavgram.geometry.ground.plane_pose import by_ends, by_plane, lengths_on_plane, reach_of
from uavgram.model.arrays import Floats, Ints
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
