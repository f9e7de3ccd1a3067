"""Brightness of a displayed picture: one monotone curve, for display only.

Measurements never use it: snapping, matching and target detection see the photo's own pixels. The
page, the recording and the rectified picture take the same curve, so that a photo looks alike
everywhere.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from uavgram.imaging.photos.reduction import shrink

Values = NDArray[np.uint8]


WHITE = 255.0

DARK_BELOW = 110.0
"""Value of the brightest hundredth below which a picture is hard to see on a dark page."""

NOISE, FLAT = 24.0, 40.0
"""Least and largest range of values of a flat picture, such as haze, that is stretched.

A range below `NOISE` has no content: bare asphalt, and noise.
"""

DUSK = 40.0
"""Median below which a picture counts as dusk, even with bright lamps in it."""

BLACK_PERCENTILE, WHITE_PERCENTILE, BRIGHT_PERCENTILE = 0.5, 99.5, 99.0

MAX_GAIN = 5.0
"""Largest gain of the contrast; beyond it only noise and JPEG blocks are brightened."""

MIDDLE, LEAST_GAMMA, MOST_GAMMA = 0.4, 0.1, 10.0
"""Value to which the median is lifted where it is below half of it; and limits of gamma."""

SMALL_PX = 256
"""Longer side of the reduced picture from which the curve is derived."""


@dataclass(frozen=True)
class Tone:
    """Monotone curve from the photo's values to the screen's.

    Attributes
    ----------
    black, white
        Values of the photo that become 0 and 255; values outside are clipped. They may be below 0
        and above 255: then the contrast is less than the photo's.
    gamma
        More than 1 lifts the middle.
    """

    black: float = 0.0
    white: float = WHITE
    gamma: float = 1.0

    def __post_init__(self) -> None:
        if not (self.white - self.black >= 1.0 and LEAST_GAMMA <= self.gamma <= MOST_GAMMA):
            raise ValueError(f"no curve of brightness: {self}")

    @property
    def is_identity(self) -> bool:
        """Return whether the photo is shown unchanged."""
        return self == IDENTITY_TONE


IDENTITY_TONE = Tone()


def choose_tone(pixels: Values) -> Tone:
    """Choose the curve for a picture: unchanged, unless the picture is dark or flat.

    Parameters
    ----------
    pixels
        (height, width) grey, (height, width, 3) or (n, 1, 3) BGR; a reduced picture suffices.
    """
    values = _luminance(pixels)
    return _stretched(values) if values.size and _needs_stretch(values) else IDENTITY_TONE


def choose_full_range_tone(pixels: Values) -> Tone:
    """Choose the curve that uses the whole range for a picture's values, also if well exposed.

    See `choose_tone`.
    """
    values = _luminance(pixels)
    return _stretched(values) if values.size else IDENTITY_TONE


def _needs_stretch(values: Values) -> bool:
    black, median, bright, white = np.percentile(
        values, [BLACK_PERCENTILE, 50.0, BRIGHT_PERCENTILE, WHITE_PERCENTILE]
    )
    return bool(bright < DARK_BELOW or median < DUSK or NOISE < white - black < FLAT)


def _stretched(values: Values) -> Tone:
    black, median, white = np.percentile(values, [BLACK_PERCENTILE, 50.0, WHITE_PERCENTILE])
    least = WHITE / MAX_GAIN
    if white - black < least:  # widen about the middle, but not below black
        middle = max((black + white) / 2.0, least / 2.0)
        black, white = middle - least / 2.0, middle + least / 2.0
    share = float((median - black) / (white - black))
    gamma = 1.0
    if 0.0 < share < MIDDLE / 2.0:
        gamma = min(math.log(share) / math.log(MIDDLE), MOST_GAMMA)
    return Tone(round(float(black), 1), round(float(white), 1), round(gamma, 2))


def _luminance(pixels: Values) -> Values:
    """Compute a reduced grey picture, so that the curve does not depend on the picture's size."""
    if pixels.ndim == 3 and pixels.size:  # before the reduction: one channel instead of three
        pixels = np.asarray(cv2.cvtColor(pixels, cv2.COLOR_BGR2GRAY), np.uint8)
    return shrink(pixels, SMALL_PX) if min(pixels.shape[:2]) > 1 else pixels


def compute_tone_curve(tone: Tone) -> Values:
    """Compute the new value of each of (256,) values: never decreasing."""
    share = np.clip((np.arange(256.0) - tone.black) / (tone.white - tone.black), 0.0, 1.0)
    return np.round(WHITE * share ** (1.0 / tone.gamma)).astype(np.uint8)


def apply_tone(pixels: Values, tone: Tone) -> Values:
    """Apply a curve to pixels; the same array is returned where it changes nothing."""
    if tone.is_identity:
        return pixels
    return np.asarray(cv2.LUT(pixels, compute_tone_curve(tone)), dtype=np.uint8)
