"""Cells of the mosaic: choice of the frame of each, and blending with neighbours."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from uavgram.geometry.ground.row_projection import RowPoses, project_rows
from uavgram.model.arrays import Bools, Floats, Ints
from uavgram.model.result.result import Result

Singles = NDArray[np.float32]
Values = Floats | Singles
NOWHERE = np.float32(np.nan)

# Least sine of a ray's angle above the ground (20 degrees): flatter ones smear one photo pixel over
# many metres.
LEAST_SINE = 0.342
# Pixels to each side of a seam over which neighbouring frames are blended; one cell at least.
FEATHER_PX = 32
# Step of the places at which projections are computed; a cell is a multiple of it wide.
STEP_PX = 8
# Rows of pixels that are processed at a time.
BAND_PX = 128
# Rounding errors of a box filter's sums that count as zero.
LEAST_WEIGHT = 1e-4
# Number of a cell's corners: a frame that shows all of them has priority.
CORNERS = 4


class Box(NamedTuple):
    """Block of neighbouring cells: its first row and column, and those after the last."""

    top: int
    bottom: int
    left: int
    right: int

    def pixels(self, cell_px: int) -> tuple[slice, slice]:
        """Return rows and columns of their pixels."""
        return (
            slice(self.top * cell_px, self.bottom * cell_px),
            slice(self.left * cell_px, self.right * cell_px),
        )


class Places(NamedTuple):
    """Projections of some cells into a frame, at places `STEP_PX` apart, and one step beyond them.

    (h, w) original pixels u and v, and the sine of the rays, from the north-west on.
    """

    frame: int
    box: Box
    u: Floats
    v: Floats
    sine: Floats


@dataclass(frozen=True, eq=False)
class Cameras:
    """N poses: (N, 3) centres and (N, 3, 3) rotations in the world, and (N, 6) sweeps of rows."""

    center_m: Floats
    world_from_camera: Floats
    sweep: Floats


@dataclass(frozen=True, eq=False)
class Grid:
    """Square cells of the mosaic, `cell_px` pixels wide, and their projection into frames."""

    result: Result
    west_m: float
    north_m: float
    pixel_size_m: float
    cell_px: int
    shape: tuple[int, int]

    def world(self, column_px: Floats, row_px: Floats) -> Floats:
        """Compute world positions (..., 3) of points given in pixels from the north-west corner."""
        spots = np.stack(
            [
                self.west_m + column_px * self.pixel_size_m,
                self.north_m - row_px * self.pixel_size_m,
            ],
            axis=-1,
        )
        return np.concatenate([spots, self.result.plane.height_at(spots)[..., None]], axis=-1)

    def pixels_in(self, cameras: Cameras, frame: int, world_m: Floats) -> Floats:
        """Project points to original pixels (..., 2) of a frame.

        NaN outside the photo and where rays are flat.

        Parameters
        ----------
        cameras
            All poses.
        frame
            Row of one of them.
        world_m
            (..., 3) points.
        """
        pixel = self._project_points(cameras, frame, world_m)
        shows = self._shows(pixel[..., 0], pixel[..., 1], _sine(world_m - cameras.center_m[frame]))
        return np.where(shows[..., None], pixel, np.nan)

    def _project_points(self, cameras: Cameras, frame: int, world_m: Floats) -> Floats:
        """Project points to pixels (..., 2) of a frame, regardless of its borders."""
        poses = RowPoses(
            cameras.center_m[frame], cameras.world_from_camera[frame], cameras.sweep[frame]
        )
        lens = self.result.shared.intrinsics.value
        return project_rows(self.result.camera, lens, poses, world_m, steps=1)

    def _shows(self, u: Values, v: Values, sine: Values) -> Bools:
        """Mark the pixels (...) inside the photo whose rays are not too flat."""
        inside = (u >= 0) & (u <= self.result.camera.width_px - 1)
        inside &= (v >= 0) & (v <= self.result.camera.height_px - 1)
        return np.asarray(inside & (sine > LEAST_SINE))

    def places_about(self, cameras: Cameras, frame: int, box: Box) -> Places:
        """Project places a few pixels apart, over some cells and around them, into a frame.

        Parameters
        ----------
        cameras, frame
            As for `pixels_in`.
        box
            Cells.
        """
        share = self.cell_px // STEP_PX
        # one more place on each side, so that the outermost pixels are between places, too
        row, column = (
            (np.arange(first * share - 1, end * share + 1) + 0.5) * STEP_PX
            for first, end in ((box.top, box.bottom), (box.left, box.right))
        )
        ground = self.world(*np.meshgrid(column, row))
        pixel = self._project_points(cameras, frame, ground)
        sine = _sine(ground - cameras.center_m[frame])
        return Places(frame, box, pixel[..., 0], pixel[..., 1], sine)

    def pixels_at(self, cameras: Cameras, places: Places, box: Box) -> tuple[Singles, Singles]:
        """Compute u and v (H, W) in a frame of the centres of all pixels of cells.

        NaN as in `pixels_in`. Between places a few pixels apart the projection is almost linear,
        and is inside the photo where theirs is. Where one of four such places has no projection,
        the pixels between them are projected one by one.

        Parameters
        ----------
        cameras
            All poses.
        places
            Projections of these cells and of others into the frame.
        box
            Cells.
        """
        share, inner = self.cell_px // STEP_PX, slice(STEP_PX, -STEP_PX)
        rows = slice((box.top - places.box.top) * share, (box.bottom - places.box.top) * share + 2)
        columns = slice(
            (box.left - places.box.left) * share, (box.right - places.box.left) * share + 2
        )
        some = [one[rows, columns] for one in (places.u, places.v, places.sine)]
        u, v = (_enlarge(one, STEP_PX)[inner, inner] for one in some[:2])
        if self._shows(*some).all():
            return u, v
        unknown = np.isnan(u)
        hidden = ~self._shows(u, v, _enlarge(some[2], STEP_PX)[inner, inner])
        u[hidden] = v[hidden] = NOWHERE
        if unknown.any():
            down, across = np.nonzero(unknown)
            corner = self.cell_px * np.array([box.left, box.top]) + 0.5
            each = self.world(across + corner[0], down + corner[1])
            u[unknown], v[unknown] = self.pixels_in(cameras, places.frame, each).T
        return u, v

    def finest_pixel(self, cameras: Cameras, frame: int, preview_scale: float) -> float:
        """Compute the ground size [m] of a pixel of a frame's preview straight below it.

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


def choose_frames(grid: Grid, cameras: Cameras) -> Ints:
    """Choose the frame (R, C) that sees most corners of a cell, then most steeply; -1 for none."""
    edges = [np.arange(n + 1.0) * grid.cell_px for n in grid.shape]
    row, column = np.meshgrid(*edges, indexing="ij")
    world = grid.world(column, row)
    middle = (world[:-1, :-1] + world[1:, 1:]) / 2
    best = np.zeros(grid.shape)
    choice = np.full(grid.shape, -1, dtype=np.int64)
    for frame, box in enumerate(find_boxes_below(grid, cameras)):
        if box.bottom <= box.top or box.right <= box.left:
            continue
        inside = slice(box.top, box.bottom), slice(box.left, box.right)
        corners = world[box.top : box.bottom + 1, box.left : box.right + 1]
        corner = np.isfinite(grid.pixels_in(cameras, frame, corners)[..., 0]).astype(np.int64)
        seen = corner[:-1, :-1] + corner[1:, :-1] + corner[:-1, 1:] + corner[1:, 1:]
        # a sine is at most 1: a frame that shows all of a cell has priority over one that shows a
        # part
        sine = _sine(middle[inside] - cameras.center_m[frame])
        score = (seen > 0) * (sine + 2.0 * (seen == CORNERS))
        better = score > best[inside]
        best[inside][better], choice[inside][better] = score[better], frame
    return choice


def find_boxes_below(grid: Grid, cameras: Cameras) -> list[Box]:
    """Find for each frame the cells to which its rays are not too flat: it shows only these.

    In a large survey they are few, independent of its size.
    """
    east, north = (np.array([0.0, count * grid.cell_px]) for count in grid.shape[::-1])
    lowest = float(grid.world(*np.meshgrid(east, north))[..., 2].min())
    drop = np.maximum(cameras.center_m[:, 2] - lowest, 0.0)
    reach = drop * np.sqrt(1.0 - LEAST_SINE**2) / LEAST_SINE
    cell_m = grid.cell_px * grid.pixel_size_m
    across, down = (
        (sign * (cameras.center_m[:, axis] - edge) / cell_m, reach / cell_m, count)
        for sign, axis, edge, count in (
            (1.0, 0, grid.west_m, grid.shape[1]),
            (-1.0, 1, grid.north_m, grid.shape[0]),
        )
    )
    ends = [
        np.clip(edge, 0, count).astype(np.int64).tolist()
        for at, far, count in (down, across)
        for edge in (np.floor(at - far) - 1, np.ceil(at + far) + 1)
    ]
    return [Box(*each) for each in zip(*ends, strict=True)]


def compute_corner_weights(grid: Grid, chosen: Bools) -> Floats:
    """Compute the share of a frame among the cells about each corner (R + 1, C + 1)."""
    feather = max(FEATHER_PX // grid.cell_px, 1)
    around = np.pad(chosen.astype(np.float32), feather)
    width = 2 * feather
    share = cv2.boxFilter(around, -1, (width, width), anchor=(0, 0))
    rows, columns = chosen.shape
    share = share[: rows + 1, : columns + 1]
    return np.where(share > LEAST_WEIGHT, share, 0.0).astype(np.float64)


def find_box(corner: Floats) -> Box:
    """Find the cells about the corners that have a weight (R + 1, C + 1), at least one."""
    some = corner > 0.0
    return Box(*_ends(np.any(some, axis=1)), *_ends(np.any(some, axis=0)))


def split_bands(corner: Floats, box: Box, cell_px: int) -> Iterator[Box]:
    """Split the cells about weighted corners into bands of a few rows.

    Bands follow the ragged edges of a frame's area, and the data of one band fit into the
    processor's cache.

    Parameters
    ----------
    corner
        (R + 1, C + 1) weights.
    box
        Cells with weights.
    cell_px
        Side of a cell.
    """
    height = max(BAND_PX // cell_px, 1)
    for first in range(box.top, box.bottom, height):
        some = corner[first : min(first + height, box.bottom) + 1]
        if some.any():
            inside = find_box(some)
            yield inside._replace(top=first + inside.top, bottom=first + inside.bottom)


def _ends(some: Bools) -> tuple[int, int]:
    """Find first and last but one of the cells about corners of which some have a weight."""
    at = np.flatnonzero(some)
    return max(int(at[0]) - 1, 0), min(int(at[-1]) + 1, len(some) - 1)


def interpolate_weights(corner: Floats, box: Box, cell_px: int) -> Singles:
    """Compute weights (H, W) of the pixels of cells, linear between corners (R + 1, C + 1).

    Parameters
    ----------
    corner
        Weights of the corners of all cells.
    box
        Cells.
    cell_px
        Side of a cell.
    """
    around = corner[box.top : box.bottom + 1, box.left : box.right + 1]
    half = cell_px // 2
    return _enlarge(around, cell_px)[half:-half, half:-half]


def _enlarge(places: Floats, times: int) -> Singles:
    """Enlarge (H, W, ...) to (times H, times W, ...) by linear interpolation."""
    rows, columns = places.shape[:2]
    size = columns * times, rows * times
    single = np.ascontiguousarray(places, np.float32)
    return np.asarray(cv2.resize(single, size, interpolation=cv2.INTER_LINEAR), np.float32)


def compute_gain_fields(grid: Grid, choice: Ints, gains: Floats) -> Iterator[tuple[Box, Singles]]:
    """Compute brightness factors (H, W) of some cells: of the blended frames, in shares.

    Together these cells are all that any frame shows, a few rows at a time.

    Parameters
    ----------
    grid
        Cells.
    choice
        (R, C) the frame of each, of at least one; -1 for none.
    gains
        (N,) of the frames.
    """
    around = np.zeros((2, *np.add(grid.shape, 1)))
    for frame in np.unique(choice[choice >= 0]):
        share = compute_corner_weights(grid, choice == frame)
        around += share * np.array([gains[frame], 1.0])[:, None, None]
    for box in split_bands(around[1], find_box(around[1]), grid.cell_px):
        weighted, weight = (interpolate_weights(one, box, grid.cell_px) for one in around)
        field = np.ones_like(weight)
        np.divide(weighted, weight, out=field, where=weight > LEAST_WEIGHT)
        yield box, field


def _sine(rays: Floats) -> Floats:
    """Compute the sine (...) of the angle at which rays (..., 3) from above meet level ground."""
    return np.asarray(-rays[..., 2] / np.linalg.norm(rays, axis=-1), dtype=np.float64)
