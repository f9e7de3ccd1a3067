"""Top view as a picture to print: scale bar, north arrow and a line of text below it."""

from __future__ import annotations

from collections.abc import Callable

import cv2
import numpy as np
from PIL import Image, ImageDraw, ImageFont

from uavgram.imaging.photos.preview import Pixels

LEAST_WIDTH_PX = 480
"""Least width: narrower top views get a margin, so that scale bar and arrow fit."""

Bar = Callable[[float], tuple[float, str]]

_INK, _PAPER = (30, 30, 30), 255


def map_sheet(
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
