"""A top view as a picture to print: scale bar, north arrow and a line of text below it."""

from __future__ import annotations

import cv2
import numpy as np

from uavgram.imaging.preview import Pixels

_INK, _PAPER = (30, 30, 30), 255
_FONT = cv2.FONT_HERSHEY_SIMPLEX


def map_sheet(rgba: Pixels, pixel_m: float, caption: str) -> bytes:
    """PNG of a north-up picture (H, W, 4) with a foot that holds scale bar, arrow and caption."""
    height, width = rgba.shape[:2]
    unit = max(width / 100.0, 6.0)
    foot = round(8 * unit)
    sheet = np.full((height + foot, width, 3), _PAPER, np.uint8)
    opaque = rgba[..., 3:] > 0
    sheet[:height] = np.where(opaque, rgba[..., :3], _PAPER)
    thick = max(1, round(unit / 6))
    bar_m = _nice(0.25 * width * pixel_m)
    left, right = round(3 * unit), round(3 * unit + bar_m / pixel_m)
    y = height + round(3.5 * unit)
    cv2.rectangle(sheet, (left, y - thick), (right, y + thick), _INK, cv2.FILLED)
    for x in (left, (left + right) // 2, right):
        cv2.line(sheet, (x, y - round(unit)), (x, y + thick), _INK, thick, cv2.LINE_AA)
    size = unit / 14.0
    texts = (("0", left), (f"{bar_m / 2:g}", (left + right) // 2), (f"{bar_m:g} m", right))
    for text, x in texts:
        half = cv2.getTextSize(text, _FONT, size, thick)[0][0] // 2
        _text(sheet, text, (x - half, y - round(1.4 * unit)), size, thick)
    _text(sheet, caption, (left, height + round(6.5 * unit)), size, thick)
    _arrow(sheet, (width - round(4 * unit), height + round(6 * unit)), unit, thick)
    encoded = cv2.imencode(".png", sheet[..., ::-1])[1]
    return bytes(encoded.tobytes())


def _nice(wanted_m: float) -> float:
    """The largest of 1, 2, 5 times a power of ten that is not longer."""
    power = 10.0 ** np.floor(np.log10(wanted_m))
    return float(max(f for f in (1, 2, 5) if f * power <= wanted_m * (1 + 1e-9)) * power)


def _text(sheet: Pixels, text: str, at: tuple[int, int], size: float, thick: int) -> None:
    cv2.putText(sheet, text, at, _FONT, size, _INK, thick, cv2.LINE_AA)


def _arrow(sheet: Pixels, foot: tuple[int, int], unit: float, thick: int) -> None:
    tip = (foot[0], foot[1] - round(5 * unit))
    cv2.arrowedLine(sheet, foot, tip, _INK, 2 * thick, cv2.LINE_AA, tipLength=0.3)
    _text(sheet, "N", (foot[0] + round(0.8 * unit), foot[1]), unit / 14.0, thick)
