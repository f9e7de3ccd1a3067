"""Cells of the mosaic: which frame shows each of them, and how it fades into its neighbours."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from uavgram.geometry.ground.row_projection import RowPoses, project_rows
from uavgram.model.arrays import Bools, Floats, Ints
from uavgram.model.result.result import Result

# Rays flatter than this above the ground (20 degrees) smear one photo pixel over many metres.
LEAST_SINE = 0.342
# Neighbouring frames fade into each other over this many pixels to each side of a seam, but over
# one cell at least.
FEATHER_PX = 32
# Along a side of a cell, however large: so many places and the polynomial through them.
MOST_NODES = 8
# Sums of a box filter are not exactly zero where they should be.
LEAST_WEIGHT = 1e-4
# Corners of a cell: it is the frame's that shows all of them, sooner than one that shows some.
CORNERS = 4


@dataclass(frozen=True, eq=False)
class Cameras:
    """N poses: (N, 3) centres and (N, 3, 3) rotations in the world, and (N, 6) sweeps of rows."""

    center_m: Floats
    world_from_camera: Floats
    sweep: Floats


@dataclass(frozen=True, eq=False)
class Grid:
    """Square cells of the mosaic, `cell_px` pixels wide, and how frames see them."""

    result: Result
    west_m: float
    north_m: float
    pixel_size_m: float
    cell_px: int
    shape: tuple[int, int]

    def world(self, column_px: Floats, row_px: Floats) -> Floats:
        """(..., 3) world positions of points given in pixels from the north-west corner."""
        spots = np.stack(
            [
                self.west_m + column_px * self.pixel_size_m,
                self.north_m - row_px * self.pixel_size_m,
            ],
            axis=-1,
        )
        return np.concatenate([spots, self.result.plane.height_at(spots)[..., None]], axis=-1)

    def pixels_in(self, cameras: Cameras, frame: int, world_m: Floats) -> Floats:
        """(..., 2) original pixels of a frame; NaN outside the photo and where rays are flat.

        Parameters
        ----------
        cameras
            All poses.
        frame
            Row of one of them.
        world_m
            (..., 3) points.
        """
        pixel = self._projected(cameras, frame, world_m)
        shows = self._shows(pixel, world_m - cameras.center_m[frame])
        return np.where(shows[..., None], pixel, np.nan)

    def _projected(self, cameras: Cameras, frame: int, world_m: Floats) -> Floats:
        """(..., 2) where a frame would have points, were it large enough."""
        poses = RowPoses(
            cameras.center_m[frame], cameras.world_from_camera[frame], cameras.sweep[frame]
        )
        lens = self.result.shared.intrinsics.value
        return project_rows(self.result.camera, lens, poses, world_m, steps=1)

    def _shows(self, pixel: Floats, rays: Floats) -> Bools:
        """(...) whether pixels lie in the photo, and the rays (..., 3) to them are not too flat."""
        size = np.array([self.result.camera.width_px, self.result.camera.height_px]) - 1
        inside = (pixel >= 0) & (pixel <= size)
        return np.asarray(inside[..., 0] & inside[..., 1] & (_sine(rays) > LEAST_SINE))

    def pixels_in_cells(self, cameras: Cameras, frame: int, i: Ints, j: Ints) -> Floats:
        """(n, cell * cell, 2) original pixels of a frame, at the middles of all pixels of cells.

        Within a cell a frame's pixels are almost those of an affine map: a few places along each
        side say them all. Where these have none, a cell is counted out pixel by pixel.

        Parameters
        ----------
        cameras, frame
            As for `pixels_in`.
        i, j
            (n,) row and column of each cell.
        """
        cell = self.cell_px
        middles: Floats = np.arange(cell, dtype=np.float64) + 0.5
        count = min(2 + cell // 16, MOST_NODES)
        nodes = np.linspace(0.5, cell - 0.5, count)
        ground = self._in_cells(i, j, nodes)
        found = self._projected(cameras, frame, ground)
        unknown = ~np.isfinite(found).all(axis=(1, 2, 3))
        shown = self._shows(found, ground - cameras.center_m[frame])
        between = _lagrange(nodes, middles)
        along = np.einsum("xk,nykc->nyxc", between, found[~unknown], optimize=True)
        pixel = np.empty((len(i), cell, cell, 2))
        pixel[~unknown] = np.einsum("yk,nkxc->nyxc", between, along, optimize=True)
        at_edge = np.flatnonzero(~shown.all(axis=(1, 2)) & ~unknown)
        rays = self._in_cells(i[at_edge], j[at_edge], middles) - cameras.center_m[frame]
        pixel[at_edge] = np.where(
            self._shows(pixel[at_edge], rays)[..., None], pixel[at_edge], np.nan
        )
        each = self._in_cells(i[unknown], j[unknown], middles)
        pixel[unknown] = self.pixels_in(cameras, frame, each)
        return pixel.reshape(len(i), cell * cell, 2)

    def _in_cells(self, i: Ints, j: Ints, places: Floats) -> Floats:
        """(n, p, p, 3) the ground at p places [px] down and across each cell."""
        row = np.broadcast_to(
            (i[:, None] * self.cell_px + places)[:, :, None], (len(i), len(places), len(places))
        )
        column = np.broadcast_to((j[:, None] * self.cell_px + places)[:, None], row.shape)
        return self.world(column, row)

    def finest_pixel(self, cameras: Cameras, frame: int, preview_scale: float) -> float:
        """What a pixel of a frame's preview measures on the ground below it [m].

        Parameters
        ----------
        cameras
            All poses.
        frame
            Row of one of them.
        preview_scale
            Original pixels per pixel of its preview.
        """
        center = cameras.center_m[frame]
        height = abs(float(center[2] - self.result.plane.height_at(center[:2])))
        return height * preview_scale / float(self.result.shared.intrinsics.value[0])


def choose(grid: Grid, cameras: Cameras) -> Ints:
    """(R, C) the frame that sees most corners of a cell, and it most steeply; -1 for none."""
    edges = [np.arange(n + 1.0) * grid.cell_px for n in grid.shape]
    row, column = np.meshgrid(*edges, indexing="ij")
    world = grid.world(column, row)
    middle = (world[:-1, :-1] + world[1:, 1:]) / 2
    best = np.zeros(grid.shape)
    choice = np.full(grid.shape, -1, dtype=np.int64)
    for frame in range(len(cameras.center_m)):
        corner = np.isfinite(grid.pixels_in(cameras, frame, world)[..., 0]).astype(np.int64)
        seen = corner[:-1, :-1] + corner[1:, :-1] + corner[:-1, 1:] + corner[1:, 1:]
        # a sine is at most 1: what shows all of a cell goes before what shows some of it
        score = (seen > 0) * (_sine(middle - cameras.center_m[frame]) + 2.0 * (seen == CORNERS))
        better = score > best
        best[better], choice[better] = score[better], frame
    return choice


def corner_weights(grid: Grid, chosen: Bools) -> Floats:
    """(R + 1, C + 1) share of a frame among the cells about each corner of the (R, C) cells."""
    feather = max(FEATHER_PX // grid.cell_px, 1)
    around = np.pad(chosen.astype(np.float32), feather)
    width = 2 * feather
    share = cv2.boxFilter(around, -1, (width, width), anchor=(0, 0))
    rows, columns = chosen.shape
    return np.asarray(share[: rows + 1, : columns + 1], dtype=np.float64)


def weights_within(corner: Floats, share: Floats) -> tuple[Ints, Ints, Floats]:
    """Cells with a weight at any corner, and their (n, cell, cell) weights, linear in between.

    Parameters
    ----------
    corner
        (R + 1, C + 1) weights at the corners of cells.
    share
        (cell,) places within a cell, 0 to 1.

    Returns
    -------
    i, j
        (n,) row and column of each cell.
    weight
        (n, cell, cell).
    """
    some = corner > LEAST_WEIGHT
    i, j = np.nonzero(some[:-1, :-1] | some[1:, :-1] | some[:-1, 1:] | some[1:, 1:])
    down, right = share[:, None], share[None, :]
    inside = (
        corner[i, j][:, None, None] * (1 - down) * (1 - right)
        + corner[i + 1, j][:, None, None] * down * (1 - right)
        + corner[i, j + 1][:, None, None] * (1 - down) * right
        + corner[i + 1, j + 1][:, None, None] * down * right
    )
    return i, j, np.asarray(inside, dtype=np.float64)


def _lagrange(nodes: Floats, at: Floats) -> Floats:
    """(n, k) weights of values at k nodes, of the polynomial through them at n places."""
    weights = np.ones((len(at), len(nodes)))
    for k, node in enumerate(nodes):
        for other in np.delete(nodes, k):
            weights[:, k] *= (at - other) / (node - other)
    return weights


def gain_field(grid: Grid, choice: Ints, gains: Floats) -> Floats:
    """(H, W) factor of each pixel: of the frames that it is blended of, in their shares.

    Parameters
    ----------
    grid
        The cells.
    choice
        (R, C) the frame of each; -1 for none.
    gains
        (N,) of the frames.
    """
    around = np.zeros((2, *np.add(grid.shape, 1)))
    for frame in np.unique(choice[choice >= 0]):
        share = corner_weights(grid, choice == frame)
        around += share * np.array([gains[frame], 1.0])[:, None, None]
    down, across = (_between_corners(count, grid.cell_px) for count in grid.shape)
    weighted, weight = np.einsum("hr,krc,wc->khw", down, around, across, optimize=True)
    field = np.ones(weight.shape)
    np.divide(weighted, weight, out=field, where=weight > LEAST_WEIGHT)
    return field


def _between_corners(cells: int, cell_px: int) -> Floats:
    """(cells * cell_px, cells + 1) shares of the corners in pixels between them, linear."""
    at = (np.arange(cells * cell_px) + 0.5) / cell_px
    return np.maximum(1.0 - np.abs(at[:, None] - np.arange(cells + 1.0)), 0.0)


def _sine(rays: Floats) -> Floats:
    """(...) sine of the angle at which (..., 3) rays from above meet level ground."""
    return np.asarray(-rays[..., 2] / np.linalg.norm(rays, axis=-1), dtype=np.float64)
