"""Projection of the pixels of a top view's window into each photo, interpolated between nodes."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import cv2
import numpy as np
from scipy.interpolate import CubicSpline

from uavgram.geometry.ground.top_view import MAX_OFF_NADIR, View
from uavgram.imaging.top_view.photo_cache import Map
from uavgram.model.arrays import Bools, Floats, Ints
from uavgram.model.maps import GroundRaster

NODE_STEP_PX = 32
"""Largest step of the nodes in pixels of the top view."""

NODE_STEP_SHARE = 1 / 32
"""Largest step of the nodes on the ground, as a share of the least height above it.

Lens and perspective are smooth on this scale: a cubic spline between the nodes is good to 0.01 px.
"""

EDGE_PX = 1.0
"""Margin inside a photo of the nodes that ensures that all pixels between them are inside."""

Window = tuple[int, int, int, int]
"""First column, first row, width, height."""


@dataclass(frozen=True, eq=False)
class Lattice:
    """Nodes over a window: every `step` pixels, the last ones on or beyond its end."""

    view: View
    raster: GroundRaster
    window: Window
    step: int

    def world(self) -> Floats:
        """Compute world positions (rows, columns, 3) of the nodes."""
        column, row, width, height = self.window
        across, down = _nodes(width, self.step), _nodes(height, self.step)
        return self.view.ground(self.raster, column + across, row + down)

    def each(self, nodes: Bools) -> tuple[Lattice, tuple[slice, slice]]:
        """Create nodes on each pixel around some nodes; return also their part of the window."""
        column, row, width, height = self.window
        rows, columns = (np.flatnonzero(nodes.any(axis=axis)) * self.step for axis in (1, 0))
        top, left = max(int(rows[0]) - self.step, 0), max(int(columns[0]) - self.step, 0)
        bottom = min(int(rows[-1]) + self.step, height)
        right = min(int(columns[-1]) + self.step, width)
        window = column + left, row + top, right - left, bottom - top
        part = slice(top, bottom), slice(left, right)
        return Lattice(self.view, self.raster, window, 1), part

    def spread(self, field: Floats) -> Map:
        """Interpolate values (height, width) between those at the nodes."""
        width, height = self.window[2:]
        if self.step == 1:
            return np.asarray(field[:height, :width], np.float32)
        middle = field.mean()  # smaller numbers lose fewer digits in single precision
        near, none = np.asarray(field - middle, np.float32), np.empty((0, 0), np.float32)
        down, across = _spline(height, self.step), _spline(width, self.step)
        # OpenCV's product: BLAS would start all cores for each window, in each of our threads
        rows = cv2.gemm(down, near, 1.0, none, 0.0)
        fine = cv2.gemm(rows, across, 1.0, none, 0.0, flags=cv2.GEMM_2_T)
        return np.asarray(fine + np.float32(middle), np.float32)


@dataclass(frozen=True, eq=False)
class PhotoLattice:
    """Window in one photo, at the nodes of a lattice.

    Attributes
    ----------
    index
        Index of the photo in its view.
    lattice
        Nodes.
    pixel
        (rows, columns, 2) their places in the photo, also beyond its border; NaN where the lens
        model has no pixel.
    off_nadir
        (rows, columns) tangent of the angle from the vertical; NaN where the place is not below.
    """

    index: int
    lattice: Lattice
    pixel: Floats
    off_nadir: Floats

    @property
    def smooth(self) -> bool:
        """Return whether values between the nodes can be interpolated."""
        return bool(np.isfinite(self.pixel).all() and np.isfinite(self.off_nadir).all())

    def within(self, border_px: float) -> bool:
        """Return whether the photo shows all of the window, at this distance from its border."""
        return bool(self.shown_nodes(border_px).all())

    def shown_nodes(self, border_px: float, grown: int = 0) -> Bools:
        """Mark the nodes (rows, columns) shown at this distance from the border, steeply enough.

        Parameters
        ----------
        border_px
            Least distance from the border; negative: also outside.
        grown
            Number of nodes by which the area is grown; negative: shrunk.
        """
        camera = self.lattice.view.result.camera
        size = np.array([camera.width_px, camera.height_px])
        inner = np.minimum(self.pixel + 0.5, size - 0.5 - self.pixel).min(axis=-1)
        shown = (inner > border_px) & (self.off_nadir < MAX_OFF_NADIR)  # NaN compares False
        if grown:
            morph = cv2.dilate if grown > 0 else cv2.erode
            side = np.ones((3, 3), np.uint8)
            shown = morph(shown.astype(np.uint8), side, iterations=abs(grown)) > 0
        return np.asarray(shown)

    def misses(self) -> bool:
        """Return whether the whole window is beyond one side of the photo."""
        camera = self.lattice.view.result.camera
        size = np.array([camera.width_px, camera.height_px])
        before = (self.pixel < -0.5 - EDGE_PX).all(axis=(0, 1))
        behind = (self.pixel > size - 0.5 + EDGE_PX).all(axis=(0, 1))
        nowhere = np.isnan(self.pixel[..., 0]) | ~(self.off_nadir < MAX_OFF_NADIR)
        return bool(before.any() or behind.any() or nowhere.all())

    def pixel_maps(self) -> tuple[Map, Map]:
        """Interpolate u and v (height, width) of each pixel of the window."""
        return self.lattice.spread(self.pixel[..., 0]), self.lattice.spread(self.pixel[..., 1])

    def maps(self) -> PixelMaps:
        """Compute all values at each pixel of the window."""
        if self.smooth:
            u, v = self.pixel_maps()
            off_nadir = self.lattice.spread(self.off_nadir)
        else:  # the lens model, or the ground below, ends here
            u, v, off_nadir = self._exact_maps()
        shown = self.lattice.view.shows(u, v, off_nadir)
        return PixelMaps(self.index, u, v, off_nadir, shown)

    def _exact_maps(self) -> tuple[Map, Map, Map]:
        """Compute u, v and tangent at each pixel near the shown area; NaN elsewhere."""
        width, height = self.lattice.window[2:]
        u, v, off_nadir = np.full((3, height, width), np.nan, np.float32)
        near = self.shown_nodes(-EDGE_PX, grown=1)
        if near.any():
            lattice, part = self.lattice.each(near)
            sight = project_lattice(lattice, self.index)
            u[part], v[part] = sight.pixel_maps()
            off_nadir[part] = lattice.spread(sight.off_nadir)
        return u, v, off_nadir


@dataclass(frozen=True, eq=False)
class PixelMaps:
    """Place of each pixel of a window in one photo.

    Attributes
    ----------
    index
        Index of the photo in its view.
    u, v
        (height, width) pixels.
    off_nadir
        (height, width) tangent of the angle from the vertical.
    shown
        (height, width) whether the photo shows the place.
    """

    index: int
    u: Map
    v: Map
    off_nadir: Map
    shown: Bools


def make_lattice(view: View, raster: GroundRaster, window: Window) -> Lattice:
    """Create nodes dense enough for the lowest of the photos.

    Parameters
    ----------
    view
        Photos and ground.
    raster
        Top view.
    window
        Requested part of it.
    """
    above = view.least_height_m * NODE_STEP_SHARE / raster.pixel_m
    step = 1 if above < 2 else min(NODE_STEP_PX, int(above))
    return Lattice(view, raster, window, step)


def project_lattice(lattice: Lattice, index: int, world: Floats | None = None) -> PhotoLattice:
    """Project a lattice into one photo.

    Parameters
    ----------
    lattice
        Nodes over a window.
    index
        Index of the photo in its view.
    world
        (rows, columns, 3) of the nodes; None: computed here.
    """
    ground = lattice.world() if world is None else world
    return PhotoLattice(index, lattice, *lattice.view.look(index, ground))


def project_window(
    view: View, raster: GroundRaster, window: Window, candidates: Ints
) -> list[PhotoLattice]:
    """Project a window into every photo, except those that certainly show none of it.

    Parameters
    ----------
    view
        Photos and ground.
    raster
        Top view.
    window
        Requested part of it.
    candidates
        (n,) photos of the view that may show it.
    """
    if not len(candidates):
        return []
    lattice = make_lattice(view, raster, window)
    world = lattice.world()
    sights = [project_lattice(lattice, int(k), world) for k in candidates]
    return [sight for sight in sights if not sight.misses()]


def _nodes(size: int, step: int) -> Floats:
    """Return the nodes' pixels along one side, the last one on or beyond the end."""
    count = max(4, -(-(size - 1) // step) + 1)  # a cubic needs four
    return np.arange(count, dtype=np.float64) * step


@lru_cache(maxsize=64)
def _spline(size: int, step: int) -> Map:
    """Compute the weight of each node at each pixel of a side, (size, nodes)."""
    nodes = _nodes(size, step)
    return np.asarray(CubicSpline(nodes, np.eye(len(nodes)))(np.arange(size)), np.float32)
