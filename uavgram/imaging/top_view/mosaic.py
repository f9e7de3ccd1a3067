"""Mosaic of the ground from previews of the photos, and pictures of the ground to print."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from dataclasses import dataclass, replace
from typing import NamedTuple, TypeVar

import cv2
import numpy as np
from numpy.typing import NDArray

from uavgram.geometry.ground.row_projection import RowPoses, project_rows
from uavgram.imaging.photos.decoding import halve, shrink
from uavgram.imaging.photos.preview import IDENTITY_TONE, Pixels, Tone, apply_tone, choose_tone
from uavgram.imaging.top_view.brightness import Light, estimate_gains, select_light
from uavgram.model.arrays import Bools, Floats, Ints
from uavgram.model.result.result import GroundPicture, Result

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
    """Return the range of the cells (first, last + 1) that touch a corner with a weight."""
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


Shade = TypeVar("Shade", np.uint8, np.float32)

MAX_SIZE_PX = 1536
# Margin of the mosaic beyond the outermost points, as a share of the scene's size or of the
# cameras' height.
MARGIN = 0.35
# Largest product of frames and cells for the choice of each cell's frame: about a second of
# projections.
CHOICE_BUDGET = 4_000_000
CELL_PX = 16
# Number of places along the longer side, or a few more, at which photos' brightness is compared.
NODES = 64
# Width above which a photo is halved for this comparison; less than twice this width remains.
LIGHT_PX = 200
# Step of the pixels that decide whether the ground is too dark to be seen.
TONE_STEP_PX = 4


@dataclass(frozen=True, eq=False)
class GroundTexture:
    """Top view of the ground plane, north up.

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
    tone
        Curve by which it was brightened.
    """

    rgb: Pixels
    covered: Bools
    west_m: float
    north_m: float
    pixel_size_m: float
    tone: Tone = IDENTITY_TONE


class Mosaic:
    """Mosaic of photos on the adjusted ground plane, each spot from the frame most above it.

    Photos are equalised in brightness, each by one factor, so that seams do not show.

    The frame of each spot follows from the poses alone, so the photos may come one by one, in any
    order, and need not stay in memory: only sums are stored, whose size is that of the mosaic.
    """

    def __init__(
        self,
        result: Result,
        photographed: Collection[str],
        preview_scale: float,
        max_size_px: int = MAX_SIZE_PX,
    ) -> None:
        """Choose the frame of each spot.

        Parameters
        ----------
        result
            Refined poses and lens, plane and points.
        photographed
            Names of the frames that will be added; others are left out.
        preview_scale
            Original pixels per pixel of the previews: a finer mosaic would add no detail.
        max_size_px
            Longer side of the mosaic.
        """
        names, wanted = result.frames.frame_id, frozenset(photographed)
        rows = [i for i in np.flatnonzero(result.has_refined) if names[i] in wanted]
        poses = result.frames.refined
        self._cameras = Cameras(
            poses.center_world_m[rows], poses.world_from_camera[rows], result.frames.sweep[rows]
        )
        self._index = {names[i]: k for k, i in enumerate(rows)}
        self._size_px = np.array([result.camera.width_px, result.camera.height_px], dtype=float)
        if rows:
            self._grid = _lay_grid(result, self._cameras, preview_scale, max_size_px)
            self._choice = choose_frames(self._grid, self._cameras)
            height, width = (count * self._grid.cell_px for count in self._grid.shape)
            # weighted sums of blue, green and red of each pixel, and the sum of the weights
            self._sums = np.zeros((height, width, 3), dtype=np.float32)
            self._weight = np.zeros((height, width), dtype=np.float32)
            self._nodes = _nodes(self._grid)
            self._light: dict[int, Light] = {}

    def add(self, frame_id: str, pixels: Pixels) -> None:
        """Blend in the (height, width, 3) BGR pixels of one preview; each frame may come once."""
        frame = self._index.get(frame_id)
        if frame is None or not (self._choice == frame).any():
            return
        grid = self._grid
        corner = compute_corner_weights(grid, self._choice == frame)
        halves = [pixels]
        sampled = _Sampled(halves, self._reduction(frame, pixels.shape[1]), self._size_px)
        everywhere = find_box(corner)
        places = grid.places_about(self._cameras, frame, everywhere)
        for box in split_bands(corner, everywhere, grid.cell_px):
            u, v = grid.pixels_at(self._cameras, places, box)
            weight = interpolate_weights(corner, box, grid.cell_px)
            hidden = np.isnan(u)
            if hidden.any():
                u[hidden] = v[hidden] = weight[hidden] = 0.0
            at = box.pixels(grid.cell_px)
            cv2.accumulate(_times(sampled.at(u, v), weight, np.float32), self._sums[at])
            self._weight[at] += weight
        self._light[frame] = self._light_of(frame, halves)

    def _light_of(self, frame: int, halves: list[Pixels]) -> Light:
        """Sample a preview's brightness at the nodes that it shows."""
        pixel = self._grid.pixels_in(self._cameras, frame, self._nodes)
        at = np.flatnonzero(np.isfinite(pixel[:, 0]))
        # A node represents its surroundings, of any size; halving is fast.
        reduction = 1 << int(np.log2(max(halves[0].shape[1] / LIGHT_PX, 1.0)))
        sampled = _Sampled(halves, reduction, self._size_px)
        return select_light(at, sampled.at(*pixel[at].T[..., None])[:, 0])

    def _reduction(self, frame: int, width_px: int) -> int:
        """Compute how many pixels of a preview of this width make one of the mosaic; at least 1."""
        finest = self._grid.finest_pixel(self._cameras, frame, self._size_px[0] / width_px)
        return max(int(self._grid.pixel_size_m / max(finest, 1e-9)), 1)

    def texture(self) -> GroundTexture | None:
        """Compose the photos added so far; None where they show none of the scene."""
        if not self._index:
            return None
        covered = self._weight > 0
        if not covered.any():
            return None
        grid = self._grid
        gains = estimate_gains(self._light, len(self._cameras.center_m))
        plain = np.zeros(self._sums.shape, np.uint8)
        for box, gain in compute_gain_fields(grid, self._choice, gains):
            at = box.pixels(grid.cell_px)
            weight = np.maximum(self._weight[at], np.finfo(np.float32).tiny)
            plain[at] = _times(self._sums[at], np.divide(gain, weight), np.uint8)
        some = np.s_[::TONE_STEP_PX, ::TONE_STEP_PX]
        tone = choose_tone(plain[some][covered[some]][:, None])
        rgb = np.asarray(cv2.cvtColor(apply_tone(plain, tone), cv2.COLOR_BGR2RGB), np.uint8)
        return GroundTexture(rgb, covered, grid.west_m, grid.north_m, grid.pixel_size_m, tone)


def _lay_grid(result: Result, cameras: Cameras, preview_scale: float, max_size_px: int) -> Grid:
    """Lay cells over the scene: as fine as the previews, coarse enough for a fast choice."""
    low, high = _extent(result, cameras)
    coarsest = float((high - low).max()) / max_size_px
    grid = Grid(result, float(low[0]), float(high[1]), coarsest, CELL_PX, (0, 0))
    finest = min(
        grid.finest_pixel(cameras, frame, preview_scale) for frame in range(len(cameras.center_m))
    )
    pixel_size = max(coarsest, finest)
    size = (high - low) / pixel_size
    grid, cell = replace(grid, pixel_size_m=pixel_size), CELL_PX // 2
    looks = np.inf
    while looks > CHOICE_BUDGET:
        cell *= 2
        columns, lines = np.maximum(np.ceil(size / cell), 1).astype(int)
        grid = replace(grid, cell_px=cell, shape=(int(lines), int(columns)))
        looks = sum(
            (b.bottom - b.top) * (b.right - b.left) for b in find_boxes_below(grid, cameras)
        )
    return grid


def _nodes(grid: Grid) -> Floats:
    """Create places (n, 3) all over the ground."""
    step = max(max(grid.shape) * grid.cell_px // NODES, 1)
    row, column = (np.arange(0.5, count * grid.cell_px, step) for count in grid.shape)
    return grid.world(*np.meshgrid(column, row)).reshape(-1, 3)


def _extent(result: Result, cameras: Cameras) -> tuple[Floats, Floats]:
    """Compute the south-west and north-east corner of the scene.

    It is the extent of the points with a margin, or of the cameras with their height.
    """
    points = result.points.position_world_m[:, :2]
    below = result.plane.height_at(cameras.center_m[:, :2])
    height = float(np.median(cameras.center_m[:, 2] - below))
    if len(points):
        low, high = points.min(axis=0), points.max(axis=0)
        margin = max(MARGIN * float((high - low).max()), MARGIN * height, 1.0)
    else:
        low = cameras.center_m[:, :2].min(axis=0)
        high = cameras.center_m[:, :2].max(axis=0)
        margin = max(height, 1.0)
    return low - margin, high + margin


def _times(picture: Pixels | Singles, factor: Singles, like: type[Shade]) -> NDArray[Shade]:
    """Multiply a picture (H, W, 3) by factors (H, W) into another number type, with rounding."""
    kind = cv2.CV_8U if like is np.uint8 else cv2.CV_32F
    made = cv2.multiply(picture, cv2.cvtColor(factor, cv2.COLOR_GRAY2BGR), dtype=kind)
    return np.asarray(made, dtype=like)


class _Sampled:
    """Preview, reduced as far as the mosaic is coarser, which avoids aliasing."""

    def __init__(self, halves: list[Pixels], reduction: int, size_px: Floats) -> None:
        """Select or make the level for a reduction, from a list of a preview and its halves.

        Parameters
        ----------
        halves
            (height, width, 3) BGR; missing halves are appended.
        reduction
            Number of pixels that become one.
        size_px
            (2,) width and height of the photo.
        """
        height, width = halves[0].shape[:2]
        self._step = size_px / [width, height] * reduction
        level = 0
        while reduction % 2 == 0:
            level, reduction = level + 1, reduction // 2
            if level == len(halves):
                halves.append(halve(halves[-1]))
        pixels = halves[level]
        height, width = pixels.shape[:2]
        if reduction > 1:  # whole blocks only, for which OpenCV is ten times faster
            rows, columns = max(height // reduction, 1), max(width // reduction, 1)
            blocks = pixels[: rows * reduction, : columns * reduction]
            pixels = np.asarray(
                cv2.resize(blocks, (columns, rows), interpolation=cv2.INTER_AREA), dtype=np.uint8
            )
        self._pixels = pixels

    def at(self, u: Values, v: Values) -> Pixels:
        """Sample (n, m, 3) BGR at u and v (n, m) in original pixels."""
        if not u.size:  # no part of the photo, as of one that shows the sky
            return np.zeros((*u.shape, 3), dtype=np.uint8)
        column, row = (
            ((at + 0.5) / step - 0.5).astype(np.float32, copy=False)
            for at, step in zip((u, v), self._step.tolist(), strict=True)
        )
        shown = cv2.remap(
            self._pixels, column, row, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE
        )
        return np.asarray(shown, dtype=np.uint8)


MOST_PX = 1200
"""Largest longer side: 170 pixels an inch across a page of that width."""
QUALITY = 82


def cut_ground(texture: GroundTexture, low_m: Floats, high_m: Floats) -> GroundPicture | None:
    """Cut a part of the ground as a picture; None where no photo shows any of it.

    Parameters
    ----------
    texture
        Whole photographed ground.
    low_m, high_m
        (2,) its south-western and north-eastern corner, in the world.
    """
    size = texture.pixel_size_m
    rows, columns = texture.covered.shape
    corner = np.array([texture.west_m, texture.north_m])
    first = np.floor((np.array([low_m[0], -high_m[1]]) - corner * [1, -1]) / size).astype(int)
    last = np.ceil((np.array([high_m[0], -low_m[1]]) - corner * [1, -1]) / size).astype(int)
    left, top = np.clip(first, 0, [columns, rows])
    right, bottom = np.clip(last, 0, [columns, rows])
    covered = texture.covered[top:bottom, left:right]
    if not covered.any():
        return None
    white = np.where(covered, np.uint8(0), np.uint8(255))  # where no photo shows the ground
    shown = cv2.bitwise_or(
        texture.rgb[top:bottom, left:right], cv2.cvtColor(white, cv2.COLOR_GRAY2RGB)
    )
    small = shrink(np.asarray(shown, np.uint8), MOST_PX)
    quality = [int(cv2.IMWRITE_JPEG_QUALITY), QUALITY]
    encoded = cv2.imencode(".jpg", cv2.cvtColor(small, cv2.COLOR_RGB2BGR), quality)[1]
    return GroundPicture(
        jpeg=bytes(encoded.tobytes()),
        west_m=float(texture.west_m + left * size),
        north_m=float(texture.north_m - top * size),
        width_m=float((right - left) * size),
        height_m=float((bottom - top) * size),
        brightened=not texture.tone.is_identity,
    )
