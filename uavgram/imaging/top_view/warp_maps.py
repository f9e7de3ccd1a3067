"""Where the pixels of a window of a top view lie in each photo: computed at nodes, then spread."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import cv2
import numpy as np
from scipy.interpolate import CubicSpline

from uavgram.geometry.ground.top_view import MOST_OFF_NADIR, View
from uavgram.imaging.top_view.photo_cache import Map
from uavgram.model.arrays import Bools, Floats, Ints
from uavgram.model.maps import GroundRaster

NODE_STEP_PX = 32
"""Most pixels of the top view from one node to the next."""

NODE_STEP_SHARE = 1 / 32
"""Of the least height above ground is the longest step between nodes on it: a lens and a
perspective are smooth on that scale, and a cubic spline between them good to 0.01 px."""

EDGE_PX = 1.0
"""Nodes so far inside a photo prove that what lies between them is inside too."""

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
        """(rows, columns, 3) of the nodes."""
        column, row, width, height = self.window
        across, down = _nodes(width, self.step), _nodes(height, self.step)
        return self.view.ground(self.raster, column + across, row + down)

    def each(self, nodes: Bools) -> tuple[Lattice, tuple[slice, slice]]:
        """A node on each pixel around some of the nodes, and the part of the window they fill."""
        column, row, width, height = self.window
        rows, columns = (np.flatnonzero(nodes.any(axis=axis)) * self.step for axis in (1, 0))
        top, left = max(int(rows[0]) - self.step, 0), max(int(columns[0]) - self.step, 0)
        bottom = min(int(rows[-1]) + self.step, height)
        right = min(int(columns[-1]) + self.step, width)
        window = column + left, row + top, right - left, bottom - top
        part = slice(top, bottom), slice(left, right)
        return Lattice(self.view, self.raster, window, 1), part

    def spread(self, field: Floats) -> Map:
        """(height, width) values between those at the nodes."""
        width, height = self.window[2:]
        if self.step == 1:
            return np.asarray(field[:height, :width], np.float32)
        middle = field.mean()  # small numbers keep their digits in single precision
        near, none = np.asarray(field - middle, np.float32), np.empty((0, 0), np.float32)
        down, across = _spline(height, self.step), _spline(width, self.step)
        # OpenCV's product: BLAS would start all cores for each window, in every thread of ours
        rows = cv2.gemm(down, near, 1.0, none, 0.0)
        fine = cv2.gemm(rows, across, 1.0, none, 0.0, flags=cv2.GEMM_2_T)
        return np.asarray(fine + np.float32(middle), np.float32)


@dataclass(frozen=True, eq=False)
class Sight:
    """A window in one photo, at the nodes of a lattice.

    Attributes
    ----------
    index
        Of the photo in its view.
    lattice
        The nodes.
    pixel
        (rows, columns, 2) where they lie in the photo as if it had no border; NaN where the lens
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
        """Whether values can be found between the nodes."""
        return bool(np.isfinite(self.pixel).all() and np.isfinite(self.off_nadir).all())

    def within(self, border_px: float) -> bool:
        """Whether the photo shows all of the window, and nothing of it nearer to its border."""
        return bool(self.shown_nodes(border_px).all())

    def shown_nodes(self, border_px: float, grown: int = 0) -> Bools:
        """(rows, columns) whether the photo shows a node so far from its border, steeply enough.

        Parameters
        ----------
        border_px
            Negative: and as far outside.
        grown
            So many nodes around them too; negative: without so many along their edge.
        """
        camera = self.lattice.view.result.camera
        size = np.array([camera.width_px, camera.height_px])
        inner = np.minimum(self.pixel + 0.5, size - 0.5 - self.pixel).min(axis=-1)
        shown = (inner > border_px) & (self.off_nadir < MOST_OFF_NADIR)  # NaN compares False
        if grown:
            morph = cv2.dilate if grown > 0 else cv2.erode
            side = np.ones((3, 3), np.uint8)
            shown = morph(shown.astype(np.uint8), side, iterations=abs(grown)) > 0
        return np.asarray(shown)

    def misses(self) -> bool:
        """Whether the whole window lies beyond one side of the photo."""
        camera = self.lattice.view.result.camera
        size = np.array([camera.width_px, camera.height_px])
        before = (self.pixel < -0.5 - EDGE_PX).all(axis=(0, 1))
        behind = (self.pixel > size - 0.5 + EDGE_PX).all(axis=(0, 1))
        nowhere = np.isnan(self.pixel[..., 0]) | ~(self.off_nadir < MOST_OFF_NADIR)
        return bool(before.any() or behind.any() or nowhere.all())

    def pixel_maps(self) -> tuple[Map, Map]:
        """(height, width) u and v of each pixel of the window."""
        return self.lattice.spread(self.pixel[..., 0]), self.lattice.spread(self.pixel[..., 1])

    def maps(self) -> Maps:
        """All values at each pixel of the window."""
        if self.smooth:
            u, v = self.pixel_maps()
            off_nadir = self.lattice.spread(self.off_nadir)
        else:  # the lens model, or the ground below, ends here
            u, v, off_nadir = self._exact_maps()
        shown = self.lattice.view.shows(u, v, off_nadir)
        return Maps(self.index, u, v, off_nadir, shown)

    def _exact_maps(self) -> tuple[Map, Map, Map]:
        """u, v and tangent at each pixel near what is shown; NaN elsewhere."""
        width, height = self.lattice.window[2:]
        u, v, off_nadir = np.full((3, height, width), np.nan, np.float32)
        near = self.shown_nodes(-EDGE_PX, grown=1)
        if near.any():
            lattice, part = self.lattice.each(near)
            sight = look(lattice, self.index)
            u[part], v[part] = sight.pixel_maps()
            off_nadir[part] = lattice.spread(sight.off_nadir)
        return u, v, off_nadir


@dataclass(frozen=True, eq=False)
class Maps:
    """Where each pixel of a window lies in one photo.

    Attributes
    ----------
    index
        Of the photo in its view.
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


def lay_lattice(view: View, raster: GroundRaster, window: Window) -> Lattice:
    """Nodes close enough for the lowest of the photos.

    Parameters
    ----------
    view
        The photos and the ground.
    raster
        The top view.
    window
        The part of it that is asked for.
    """
    above = view.least_height_m * NODE_STEP_SHARE / raster.pixel_m
    step = 1 if above < 2 else min(NODE_STEP_PX, int(above))
    return Lattice(view, raster, window, step)


def look(lattice: Lattice, index: int, world: Floats | None = None) -> Sight:
    """One photo's sight of a lattice (whose world positions may be known already).

    Parameters
    ----------
    lattice
        Nodes over a window.
    index
        Of the photo in its view.
    world
        (rows, columns, 3) of the nodes; None: computed here.
    """
    ground = lattice.world() if world is None else world
    return Sight(index, lattice, *lattice.view.look(index, ground))


def look_from(view: View, raster: GroundRaster, window: Window, candidates: Ints) -> list[Sight]:
    """Every photo's sight of a window, without those that certainly show none of it.

    Parameters
    ----------
    view
        The photos and the ground.
    raster
        The top view.
    window
        The part of it that is asked for.
    candidates
        (n,) photos of the view that may show it.
    """
    if not len(candidates):
        return []
    lattice = lay_lattice(view, raster, window)
    world = lattice.world()
    sights = [look(lattice, int(k), world) for k in candidates]
    return [sight for sight in sights if not sight.misses()]


def _nodes(size: int, step: int) -> Floats:
    """Pixels along one side, the last one on or beyond the end."""
    count = max(4, -(-(size - 1) // step) + 1)  # a cubic needs four
    return np.arange(count, dtype=np.float64) * step


@lru_cache(maxsize=64)
def _spline(size: int, step: int) -> Map:
    """(size, nodes) what each node contributes to each pixel of a side."""
    nodes = _nodes(size, step)
    return np.asarray(CubicSpline(nodes, np.eye(len(nodes)))(np.arange(size)), np.float32)
