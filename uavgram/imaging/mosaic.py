"""The ground as the photos show it: a top view put together from previews."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import cv2
import numpy as np

from uavgram.geometry.projection import project
from uavgram.imaging.preview import Pixels, Preview, decode_preview
from uavgram.model.arrays import Bools, Floats, Ints
from uavgram.model.result import Result

MAX_SIZE_PX = 1536
# The mosaic reaches beyond the outermost points by this share of the scene's size, or of the
# cameras' height.
MARGIN = 0.35
# Rays flatter than this above the ground (20 degrees) smear one photo pixel over many metres.
LEAST_SINE = 0.342
# Frames times cells when choosing the frame of each cell: about a second of projections.
CHOICE_BUDGET = 4_000_000
CELL_PX = 16
# Neighbouring frames fade into each other over this many cells to each side of a seam.
FEATHER_CELLS = 2
# Sums of a box filter are not exactly zero where they should be.
LEAST_WEIGHT = 1e-4


@dataclass(frozen=True, eq=False)
class GroundTexture:
    """A top view of the ground plane, north up.

    Attributes
    ----------
    rgb
        (H, W, 3) row 0 is the northernmost.
    covered
        (H, W) whether any photo shows it.
    west_m, north_m
        World coordinates of the outer corner of pixel [0, 0].
    pixel_size_m
        Edge of a pixel.
    """

    rgb: Pixels
    covered: Bools
    west_m: float
    north_m: float
    pixel_size_m: float


@dataclass(frozen=True, eq=False)
class _Cameras:
    """N posed frames: ids, (N, 3) centres and (N, 3, 3) rotations in the world."""

    frame_id: tuple[str, ...]
    center_world_m: Floats
    world_from_camera: Floats


def ground_texture(
    result: Result, previews: Mapping[str, Preview], max_size_px: int = MAX_SIZE_PX
) -> GroundTexture | None:
    """Warp the photos onto the adjusted ground plane, each spot from the frame most above it.

    Parameters
    ----------
    result
        Refined poses and lens, plane and points.
    previews
        By frame name; frames without one are left out.
    max_size_px
        Longer side of the mosaic.

    Returns
    -------
    None where no refined frame has a preview, or none looks down at the scene.
    """
    rows = [
        i
        for i, name in enumerate(result.frames.frame_id)
        if result.has_refined[i] and name in previews
    ]
    if not rows:
        return None
    cameras = _Cameras(
        tuple(result.frames.frame_id[i] for i in rows),
        result.frames.refined.center_world_m[rows],
        result.frames.refined.world_from_camera[rows],
    )
    low, high = _extent(result, cameras)
    pixel_size = max(
        float((high - low).max()) / max_size_px, _finest_pixel(result, cameras, previews)
    )
    size = (high - low) / pixel_size
    cell = CELL_PX
    while float(size.prod()) / cell**2 * len(rows) > CHOICE_BUDGET:
        cell *= 2
    columns, lines = np.maximum(np.ceil(size / cell), 1).astype(int)
    grid = _Grid(
        result, float(low[0]), float(high[1]), pixel_size, cell, (int(lines), int(columns))
    )
    return _mosaic(grid, cameras, previews)


def plane_height(result: Result, east_north_m: Floats) -> Floats:
    """(...) heights of the adjusted plane under (..., 2) world positions."""
    slope = np.tan(np.radians(result.shared.plane_slope_deg.value))
    offset = (east_north_m - result.shared.plane_pivot_m) @ slope
    return np.asarray(result.shared.plane_height_m.value[0] + offset, dtype=np.float64)


def _extent(result: Result, cameras: _Cameras) -> tuple[Floats, Floats]:
    """South-west and north-east corner: points with a margin, or the cameras with their height."""
    points = result.points.position_world_m[:, :2]
    below = plane_height(result, cameras.center_world_m[:, :2])
    height = float(np.median(cameras.center_world_m[:, 2] - below))
    if len(points):
        low, high = points.min(axis=0), points.max(axis=0)
        margin = max(MARGIN * float((high - low).max()), MARGIN * height, 1.0)
    else:
        low = cameras.center_world_m[:, :2].min(axis=0)
        high = cameras.center_world_m[:, :2].max(axis=0)
        margin = max(height, 1.0)
    return low - margin, high + margin


def _finest_pixel(result: Result, cameras: _Cameras, previews: Mapping[str, Preview]) -> float:
    """What a preview pixel measures on the ground below: a finer mosaic shows nothing more."""
    below = plane_height(result, cameras.center_world_m[:, :2])
    height = float(np.abs(cameras.center_world_m[:, 2] - below).min())
    scale = min(previews[name].scale[0] for name in cameras.frame_id)
    return height * scale / float(result.shared.intrinsics.value[0])


@dataclass(frozen=True, eq=False)
class _Grid:
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
        return np.concatenate([spots, plane_height(self.result, spots)[..., None]], axis=-1)

    def pixels_in(self, cameras: _Cameras, frame: int, world_m: Floats) -> Floats:
        """(..., 2) original pixels of a frame; NaN outside the photo and where rays are flat."""
        camera = self.result.camera
        rays = world_m - cameras.center_world_m[frame]
        pixel = project(
            camera.model,
            self.result.shared.intrinsics.value,
            rays @ cameras.world_from_camera[frame],
        )
        size = np.array([camera.width_px, camera.height_px]) - 1
        inside = ((pixel >= 0) & (pixel <= size)).all(axis=-1) & (_sine(rays) > LEAST_SINE)
        return np.where(inside[..., None], pixel, np.nan)


def _sine(rays: Floats) -> Floats:
    """(...) sine of the angle at which (..., 3) rays from above meet level ground."""
    return np.asarray(-rays[..., 2] / np.linalg.norm(rays, axis=-1), dtype=np.float64)


def _mosaic(
    grid: _Grid, cameras: _Cameras, previews: Mapping[str, Preview]
) -> GroundTexture | None:
    """Blend the frames, each with its own weight, which is one away from seams."""
    choice = _choose(grid, cameras)
    cell, (rows, columns) = grid.cell_px, grid.shape
    sums = np.zeros((rows, cell, columns, cell, 4), dtype=np.float32)  # weighted RGB, weight
    within = np.arange(cell) + 0.5
    for frame in np.unique(choice[choice >= 0]):
        corner = _corner_weights(choice == frame)
        i, j = np.nonzero(_touched(corner))
        row = np.repeat(i[:, None] * cell + within, cell, axis=1)
        column = np.tile(j[:, None] * cell + within, cell)
        pixel = grid.pixels_in(cameras, int(frame), grid.world(column, row))
        picture = _sample(previews[cameras.frame_id[frame]], pixel)
        weight = _weights_within(corner, i, j, within / cell).reshape(pixel.shape[:-1])
        weight[np.isnan(pixel[..., 0])] = 0.0
        shares = np.concatenate([weight[..., None] * picture, weight[..., None]], axis=-1)
        sums[i, :, j] += shares.reshape(-1, cell, cell, 4)
    total = sums.reshape(rows * cell, columns * cell, 4)
    covered = total[..., 3] > 0
    if not covered.any():
        return None
    rgb = total[..., :3] / np.maximum(total[..., 3:], np.finfo(np.float32).tiny)
    return GroundTexture(
        np.round(rgb).astype(np.uint8), covered, grid.west_m, grid.north_m, grid.pixel_size_m
    )


def _corner_weights(chosen: Bools) -> Floats:
    """(R + 1, C + 1) share of a frame among the cells about each corner of the (R, C) cells."""
    around = np.pad(chosen.astype(np.float32), FEATHER_CELLS)
    width = 2 * FEATHER_CELLS
    share = cv2.boxFilter(around, -1, (width, width), anchor=(0, 0))
    rows, columns = chosen.shape
    return np.asarray(share[: rows + 1, : columns + 1], dtype=np.float64)


def _touched(corner: Floats) -> Bools:
    """(R, C) cells with a weight at any corner."""
    some = corner > LEAST_WEIGHT
    return some[:-1, :-1] | some[1:, :-1] | some[:-1, 1:] | some[1:, 1:]


def _weights_within(corner: Floats, i: Ints, j: Ints, share: Floats) -> Floats:
    """(n, cell, cell) weights inside of n cells, linear between their corners."""
    down, right = share[:, None], share[None, :]
    inside = (
        corner[i, j][:, None, None] * (1 - down) * (1 - right)
        + corner[i + 1, j][:, None, None] * down * (1 - right)
        + corner[i, j + 1][:, None, None] * (1 - down) * right
        + corner[i + 1, j + 1][:, None, None] * down * right
    )
    return np.asarray(inside, dtype=np.float64)


def _choose(grid: _Grid, cameras: _Cameras) -> Ints:
    """(R, C) the frame that sees all of a cell, and it most steeply; -1 for none."""
    edges = [np.arange(n + 1.0) * grid.cell_px for n in grid.shape]
    row, column = np.meshgrid(*edges, indexing="ij")
    world = grid.world(column, row)
    middle = (world[:-1, :-1] + world[1:, 1:]) / 2
    best = np.zeros(grid.shape)
    choice = np.full(grid.shape, -1, dtype=np.int64)
    for frame in range(len(cameras.frame_id)):
        corner = np.isfinite(grid.pixels_in(cameras, frame, world)[..., 0])
        seen = corner[:-1, :-1] & corner[1:, :-1] & corner[:-1, 1:] & corner[1:, 1:]
        sine = _sine(middle - cameras.center_world_m[frame])
        better = seen & (sine > best)
        best[better], choice[better] = sine[better], frame
    return choice


def _sample(preview: Preview, pixel: Floats) -> Pixels:
    """(n, m, 3) RGB of a preview at (n, m, 2) original pixels; anything where those are NaN."""
    at = (np.nan_to_num(pixel) + 0.5) / preview.scale - 0.5
    return np.asarray(
        cv2.remap(
            decode_preview(preview),
            at[..., 0].astype(np.float32),
            at[..., 1].astype(np.float32),
            cv2.INTER_LINEAR,
            borderMode=cv2.BORDER_REPLICATE,
        ),
        dtype=np.uint8,
    )
