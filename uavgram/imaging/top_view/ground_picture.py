"""Pictures of the ground to print: a part of it, and a sheet with scale bar and caption."""

from __future__ import annotations

from collections.abc import Callable

import cv2
import numpy as np
from PIL import Image, ImageDraw, ImageFont

from uavgram.imaging.photos.preview import Pixels
from uavgram.imaging.photos.reduction import shrink
from uavgram.imaging.top_view.mosaic import GroundTexture
from uavgram.model.arrays import Floats
from uavgram.model.result.pictures import GroundPicture

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
