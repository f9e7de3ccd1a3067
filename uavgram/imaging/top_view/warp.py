"""Warping of photos to windows of a top view, each spot from the photo most above it."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import cv2
import numpy as np
from scipy.interpolate import CubicSpline

from uavgram.geometry.ground.top_view import MAX_OFF_NADIR, View
from uavgram.imaging.photos.preview import Pixels
from uavgram.imaging.top_view.brightness import Map, PhotoCache
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


FEATHER = 0.01
"""Difference of the tangents of two photos' angles from the vertical over which they are blended.

At 60 m above ground this is about a metre on each side of a seam.
"""

FADED = 0.01
"""Weight relative to the heaviest photo below which a photo does not show."""

REACH = -FEATHER * float(np.log(FADED))
"""Difference of the tangents at which the weight is `FADED`."""

BORDER_SHARE = 0.03
"""Width of the rim, as a share of a photo's shorter side, in which it is faded out.

So no picture ends abruptly where another goes on.
"""

BEHIND = 100.0
"""Tangent that is added where a photo is faded out: more than any that is shown."""


def warp_window(
    view: View, raster: GroundRaster, window: Window, candidates: Ints, photos: PhotoCache
) -> Pixels:
    """Compose a window (height, width, 4) of the top view in RGB and opacity.

    Parameters
    ----------
    view
        Photos and ground.
    raster
        Top view.
    window
        Requested part of it.
    candidates
        Photos of the view that may show it.
    photos
        Photos by index of the view.
    """
    width, height = window[2:]
    sights = _nearest(project_window(view, raster, window, candidates), _rim_px(view))
    if len(sights) == 1 and sights[0].within(EDGE_PX):
        return photos.get(sights[0].index).sample(*sights[0].pixel_maps())
    shots = [maps for maps in (sight.maps() for sight in sights) if maps.shown.any()]
    if not shots:
        return np.zeros((height, width, 4), np.uint8)
    if len(shots) > 1:
        return _blend(shots, view, photos)
    out = photos.get(shots[0].index).sample(shots[0].u, shots[0].v)
    out.view(np.uint32)[..., 0] *= shots[0].shown  # four bytes at once
    return out


def _rim_px(view: View) -> float:
    camera = view.result.camera
    return BORDER_SHARE * min(camera.width_px, camera.height_px)


def _nearest(sights: list[PhotoLattice], rim_px: float) -> list[PhotoLattice]:
    """Select the photos that are somewhere nearly as much above the ground as any other."""
    if len(sights) < 2:
        return sights
    least = np.full(sights[0].off_nadir.shape, np.inf)
    for sight in sights:
        solid = sight.shown_nodes(rim_px, grown=-1)
        least[solid] = np.minimum(least, sight.off_nadir)[solid]
    with np.errstate(invalid="ignore"):
        return [
            sight
            for sight in sights
            if (sight.shown_nodes(-EDGE_PX, grown=2) & ~(sight.off_nadir > least + REACH)).any()
        ]


def _blend(shots: list[PixelMaps], view: View, photos: PhotoCache) -> Pixels:
    """Blend photos: each spot from the photo most above it, with a transition at seams."""
    shape = shots[0].u.shape
    picture = np.zeros((*shape, 4), np.float32)
    for maps, share in zip(shots, _shares(shots, view), strict=True):
        if share.any():
            picture += photos.get(maps.index).sample(maps.u, maps.v) * share[..., None]
    picture += np.float32(0.5)  # round to nearest
    return picture.astype(np.uint8)


def _shares(shots: list[PixelMaps], view: View) -> list[Map]:
    """Compute shares (height, width) of each photo; their sum is one where any photo shows a spot.

    There are two layers. In the upper one, photos are ranked by the angle from the vertical, and
    transparent in their rims; in the lower one, rims rank behind everything else. So a photo fades
    over its whole rim into the one that continues beyond it, at any obliqueness.
    """
    infinite = np.float32(np.inf)
    tangent = [np.where(maps.shown, maps.off_nadir, infinite) for maps in shots]
    opacity = [_opacity(maps, view) for maps in shots]
    above = _compute_shares(tangent)
    if not any((over < 1).any() for over in opacity):
        return above
    behind = np.float32(BEHIND)
    below = _compute_shares(
        [t + behind * (over < 1) for t, over in zip(tangent, opacity, strict=True)]
    )
    above = [share * over for share, over in zip(above, opacity, strict=True)]
    left = np.float32(1.0) - np.sum(above, axis=0)
    return [over + left * under for over, under in zip(above, below, strict=True)]


def _compute_shares(distance: list[Map]) -> list[Map]:
    """Compute shares from distances (infinite: none): all to the least, and to both near a tie."""
    nearest = np.minimum.reduce(distance)
    nearest[~np.isfinite(nearest)] = 0.0  # avoid inf - inf
    fade, none = np.float32(FADED), np.float32(0.0)
    weight = [
        np.maximum(np.exp((nearest - d) / np.float32(FEATHER)) - fade, none) for d in distance
    ]
    total = np.maximum(np.sum(weight, axis=0), np.float32(1e-6))
    return [each / total for each in weight]


def _opacity(maps: PixelMaps, view: View) -> Map:
    """Compute the opacity (height, width): 1 inside the rim, 0 at the border and where hidden."""
    camera, half = view.result.camera, np.float32(0.5)
    inner = np.minimum(maps.u + half, np.float32(camera.width_px) - half - maps.u)
    inner = np.minimum(inner, maps.v + half)
    inner = np.minimum(inner, np.float32(camera.height_px) - half - maps.v)
    depth = np.clip(inner / np.float32(_rim_px(view)), np.float32(0.0), np.float32(1.0))
    return np.where(maps.shown, depth, np.float32(0.0))  # NaN where the lens model has no pixel
