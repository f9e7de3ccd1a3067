"""Mosaic of the ground from previews of the photos, and pictures of the ground to print."""

from __future__ import annotations

from collections.abc import Callable, Collection
from dataclasses import dataclass

import cv2
import numpy as np
from PIL import Image, ImageDraw, ImageFont

from uavgram.geometry.ground.top_view import View
from uavgram.imaging.photos.decoding import shrink
from uavgram.imaging.photos.preview import IDENTITY_TONE, Pixels, Tone, apply_tone, choose_tone
from uavgram.imaging.top_view.brightness import (
    Photo,
    create_photo,
    estimate_exposure_gains,
    lay_nodes,
)
from uavgram.imaging.top_view.warp import render_windows
from uavgram.model.arrays import Bools, Floats
from uavgram.model.maps import GroundRaster
from uavgram.model.result.result import GroundPicture, Result

MAX_SIZE_PX = 1536
MARGIN = 0.35
"""Margin beyond the outermost points, as a share of the scene's size or of the cameras' height."""

BLENDED_NODES = 3
"""Nodes beyond its own ones at which a photo may still be blended in."""

MOST_BYTES = 500_000_000
"""Limit of the memory of the photos that are kept; where they exceed it, the most useful ones."""

WINDOW_PX = 256
TONE_STEP_PX = 4
"""Step of the pixels that decide whether the ground is too dark to be seen."""


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

    The photos may come one by one, in any order. Only those that are the most above some place are
    kept, reduced to the pixels of the mosaic: together a few times its size.
    """

    def __init__(
        self,
        result: Result,
        photographed: Collection[str],
        preview_scale: float,
        max_size_px: int = MAX_SIZE_PX,
    ) -> None:
        """Choose the frames.

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
        self._view = View(result, np.array(rows, dtype=np.int64))
        self._index = {names[i]: k for k, i in enumerate(rows)}
        self._photos: dict[int, Photo] = {}
        self._reach: dict[int, Floats] = {}
        if rows:
            self._pixel_m = self._view.heights_m / float(result.shared.intrinsics.value[0])
            self._raster = _lay_raster(self._view, self._pixel_m * preview_scale, max_size_px)
            size = result.camera.width_px * result.camera.height_px
            pixels = size * (self._pixel_m / self._raster.pixel_m) ** 2
            self._reach = _choose_frames(self._view, self._raster, 4 * pixels)

    def add(self, frame_id: str, pixels: Pixels) -> None:
        """Take in the (height, width, 3) BGR pixels of one preview; each frame may come once."""
        frame = self._index.get(frame_id)
        if frame is None or frame not in self._reach:
            return
        camera = self._view.result.camera
        reduction = self._raster.pixel_m / float(self._pixel_m[frame])
        covered = float(camera.width_px), float(camera.height_px)
        self._photos[frame] = create_photo(pixels, covered, reduction)

    def texture(self) -> GroundTexture | None:
        """Compose the photos added so far, once; None where they show none of the scene."""
        if not self._photos:
            return None
        raster = self._raster
        gains = estimate_exposure_gains(self._view, raster, self._photos.__getitem__, self._photos)
        photos = {}
        while self._photos:  # one by one: never two copies of all in memory
            k, photo = self._photos.popitem()
            photos[k] = photo.lighten(gains[k])
        reach = np.full((len(self._index), 4), np.nan)
        for k in photos:
            reach[k] = self._reach[k]
        rgba = np.zeros((raster.height, raster.width, 4), np.uint8)
        for (column, row, width, height), made in render_windows(
            self._view, raster, reach, photos.__getitem__, WINDOW_PX
        ):
            rgba[row : row + height, column : column + width] = made()
        covered = rgba[..., 3] > 0
        if not covered.any():
            return None
        rgb = np.ascontiguousarray(rgba[..., :3])
        some = np.s_[::TONE_STEP_PX, ::TONE_STEP_PX]
        tone = choose_tone(rgb[some][covered[some]][:, None, ::-1])
        place = raster.west_m, raster.north_m, raster.pixel_m
        return GroundTexture(apply_tone(rgb, tone), covered, *place, tone)


def _choose_frames(view: View, raster: GroundRaster, size_bytes: Floats) -> dict[int, Floats]:
    """Choose the photos that are the most above some node, as many as memory allows.

    Returns the part of the raster about each: first column and row, last column and row.

    Parameters
    ----------
    view
        Photos.
    raster
        Ground to be shown.
    size_bytes
        (N,) memory for each photo.
    """
    coarse, world = lay_nodes(view, raster)
    best, choice = np.full(len(world), np.inf), np.full(len(world), -1)
    for frame in range(len(view.rows)):
        node, _, off_nadir = view.find_shown(frame, world)
        nearer = off_nadir < best[node]
        best[node[nearer]], choice[node[nearer]] = off_nadir[nearer], frame
    frames, places = np.unique(choice[choice >= 0], return_counts=True)
    frames = frames[np.argsort(-places, kind="stable")]
    reach = {}
    for frame in frames[np.cumsum(size_bytes[frames]) <= MOST_BYTES].tolist():
        row, column = np.divmod(np.flatnonzero(choice == frame), coarse.width)
        first = np.array([column.min(), row.min()]) - BLENDED_NODES
        last = np.array([column.max(), row.max()]) + BLENDED_NODES + 1
        reach[frame] = np.concatenate([first, last]) * (coarse.pixel_m / raster.pixel_m)
    return reach


def _lay_raster(view: View, pixel_m: Floats, max_size_px: int) -> GroundRaster:
    """Lay the raster over the points with a margin, or over the cameras; as fine as the photos.

    Parameters
    ----------
    view
        Photos.
    pixel_m
        (N,) size of their previews' pixels on the ground below.
    max_size_px
        Longer side of the raster.
    """
    points = view.result.points.position_world_m[:, :2]
    height = float(np.median(view.heights_m))
    if len(points):
        low, high = points.min(axis=0), points.max(axis=0)
        margin = max(MARGIN * float((high - low).max()), MARGIN * height, 1.0)
    else:
        center = view.result.frames.refined.center_world_m[view.rows, :2]
        low, high = center.min(axis=0), center.max(axis=0)
        margin = max(height, 1.0)
    low, high = low - margin, high + margin
    pixel = max(float((high - low).max()) / max_size_px, float(pixel_m.min()))
    width, lines = np.maximum(np.ceil((high - low) / pixel - 1e-9), 1).astype(int)
    return GroundRaster(
        west_m=float(low[0]),
        north_m=float(high[1]),
        pixel_m=pixel,
        width=int(width),
        height=int(lines),
        crs=None,
    )


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
