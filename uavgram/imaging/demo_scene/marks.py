"""Targets and sprayed marks with their labels, as small rasters of the ground.

Fine and exact: the mark's middle lies on a corner of four pixels, so a target's centre in a photo
is where the geometry says, to a hundredth of a pixel.
"""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from uavgram.imaging.raster import GroundRaster, Image, lay, soften
from uavgram.model.scenario.road import ScenePoint

RESOLUTION_M = 0.004
HALF_HEIGHT_PX, NEAR_PX, FAR_PX = 72, 72, 384  # FAR: where the label is
TEXT_SCALE, TEXT_THICKNESS, TEXT_GAP_PX = 3.0, 10, 88
RIM_PX = 13

WHITE = (236, 240, 240, 255)
BLACK = (26, 26, 28, 255)
SPRAY = (40, 226, 250, 255)
RED = (52, 44, 206, 255)


def mark_raster(point: ScenePoint) -> GroundRaster:
    """Draw one mark and its label: BGRA, colours multiplied by alpha."""
    left_px = NEAR_PX if point.label_side == "right" else FAR_PX
    image = np.zeros((2 * HALF_HEIGHT_PX, NEAR_PX + FAR_PX, 4), np.uint8)
    # Metres from the mark's middle, at the pixels' centres: right, down.
    v, u = np.indices(image.shape[:2]) + 0.5
    right, down = (u - left_px) * RESOLUTION_M, (v - HALF_HEIGHT_PX) * RESOLUTION_M
    square = np.maximum(np.abs(right), np.abs(down))
    if point.mark == "checker":
        lay(image, WHITE, _mask(square < 0.24))
        lay(image, BLACK, _mask((square < 0.21) & (right * down > 0)))
    elif point.mark == "disc":
        radius = np.hypot(right, down)
        for color, size in ((BLACK, 0.24), (WHITE, 0.2), (RED, 0.13), (WHITE, 0.05)):
            lay(image, color, _mask(radius < size))
    else:
        narrow = np.minimum(np.abs(right), np.abs(down))
        lay(image, BLACK, _mask((narrow < 0.048) & (square < 0.24)), 0.35)
        lay(image, SPRAY, _mask((narrow < 0.028) & (square < 0.22)), 0.95)
    _write(image, point, left_px)
    return GroundRaster(
        image=image,
        x_top_m=point.x_m + HALF_HEIGHT_PX * RESOLUTION_M,
        y_left_m=point.y_m + left_px * RESOLUTION_M,
        resolution_m=RESOLUTION_M,
    )


def _mask(where: NDArray[np.bool_]) -> Image:
    return np.where(where, np.uint8(255), np.uint8(0))


def _write(image: Image, point: ScenePoint, left_px: int) -> None:
    """Spray the label, upright for one who looks along x, with a dark rim to be legible."""
    font = cv2.FONT_HERSHEY_DUPLEX
    (width, height), _ = cv2.getTextSize(point.label, font, TEXT_SCALE, TEXT_THICKNESS)
    at_px = left_px + TEXT_GAP_PX if point.label_side == "right" else left_px - TEXT_GAP_PX - width
    base = (at_px, HALF_HEIGHT_PX + height // 2)
    mask = np.zeros(image.shape[:2], np.uint8)
    cv2.putText(mask, point.label, base, font, TEXT_SCALE, [255], TEXT_THICKNESS, cv2.LINE_AA)
    rim = np.asarray(cv2.dilate(mask, np.ones((RIM_PX, RIM_PX), np.uint8)), np.uint8)
    lay(image, BLACK, soften(rim, 2.5), 0.55)
    lay(image, _text_color(point), mask, 0.95)


def _text_color(point: ScenePoint) -> tuple[int, int, int, int]:
    return SPRAY if point.mark == "cross" else WHITE
