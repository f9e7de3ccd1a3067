"""Mosaic of the ground from previews of the photos, and pictures of the ground to print."""

from __future__ import annotations

from collections.abc import Callable, Collection
from dataclasses import dataclass, replace
from typing import TypeVar

import cv2
import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from uavgram.imaging.photos.decoding import halve, shrink
from uavgram.imaging.photos.preview import IDENTITY_TONE, Pixels, Tone, apply_tone, choose_tone
from uavgram.imaging.top_view.brightness import Light, estimate_gains, select_light
from uavgram.imaging.top_view.mosaic_grid import (
    Cameras,
    Grid,
    Singles,
    Values,
    choose_frames,
    compute_corner_weights,
    compute_gain_fields,
    find_box,
    find_boxes_below,
    interpolate_weights,
    split_bands,
)
from uavgram.model.arrays import Bools, Floats
from uavgram.model.result.result import GroundPicture, Result

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


LEAST_WIDTH_PX = 480
"""Least width: narrower top views get a margin, so that scale bar and arrow fit."""

Bar = Callable[[float], tuple[float, str]]

_INK, _PAPER = (30, 30, 30), 255


def draw_map_sheet(
    rgba: Pixels, pixel_m: float, caption: str, longest_px: int, bar: Bar | None = None
) -> bytes:
    """Draw a north-up picture with scale bar, north arrow and caption below it; return a PNG.

    Parameters
    ----------
    rgba
        (H, W, 4).
    pixel_m
        Edge of a pixel.
    caption
        One line.
    longest_px
        Limit of the longer side, to which the picture is reduced.
    bar
        Function from the available length [m] to the length of the scale bar and its label; by
        default a round number of metres.
    """
    share = min(1.0, longest_px / max(rgba.shape[:2]))
    if share < 1.0:
        size = [max(1, round(side * share)) for side in rgba.shape[1::-1]]
        pixel_m *= rgba.shape[1] / size[0]
        rgba = np.asarray(cv2.resize(rgba, size, interpolation=cv2.INTER_AREA), np.uint8)
    height, width = rgba.shape[:2]
    unit = max(max(width, LEAST_WIDTH_PX) / 100.0, 6.0)
    sheet = np.full((height + round(8 * unit), max(width, LEAST_WIDTH_PX), 3), _PAPER, np.uint8)
    opaque = rgba[..., 3:] > 0
    sheet[:height, :width] = np.where(opaque, rgba[..., :3], _PAPER)
    drawn = Image.fromarray(sheet)
    _foot(ImageDraw.Draw(drawn), height, unit, pixel_m, caption, bar or _metres)
    encoded = cv2.imencode(".png", np.asarray(drawn)[..., ::-1])[1]
    return bytes(encoded.tobytes())


def _foot(
    pen: ImageDraw.ImageDraw, top: int, unit: float, pixel_m: float, caption: str, bar: Bar
) -> None:
    thick = max(1, round(unit / 6))
    font = ImageFont.load_default(1.6 * unit)
    bar_m, words = bar(25 * unit * pixel_m)
    half = f"{float(words.split()[0]) / 2:g}"
    left, right = 3 * unit, 3 * unit + bar_m / pixel_m
    y = top + 3.5 * unit
    pen.rectangle((left, y - thick, right, y + thick), fill=_INK)
    ticks = ((left, "0"), ((left + right) / 2, half), (right, words))
    for x, text in ticks:
        pen.line((x, y - unit, x, y + thick), fill=_INK, width=thick)
        pen.text((x, y - 1.2 * unit), text, fill=_INK, font=font, anchor="ms")
    pen.text((left, top + 6.5 * unit), caption, fill=_INK, font=font, anchor="ls")
    x, y = 96 * unit, top + 5.0 * unit
    pen.line((x, y, x, y - 2.5 * unit), fill=_INK, width=2 * thick)
    tip = [(x, y - 4 * unit), (x - unit, y - 2 * unit), (x + unit, y - 2 * unit)]
    pen.polygon(tip, fill=_INK)
    pen.text((x, y + 2 * unit), "N", fill=_INK, font=font, anchor="ms")


def _metres(wanted_m: float) -> tuple[float, str]:
    """Choose the largest of 1, 2, 5 times a power of ten that fits; return it with its label."""
    power = 10.0 ** np.floor(np.log10(wanted_m))
    bar_m = float(max(f for f in (1, 2, 5) if f * power <= wanted_m * (1 + 1e-9)) * power)
    return bar_m, f"{bar_m:g} m"
