"""Reduced photos for display, with their scale to the original, and their brightness.

Measurements never use it: snapping, matching and target detection see the photo's own pixels. The
page, the recording and the rectified picture take the same curve, so that a photo looks alike
everywhere.

No picture is rotated: all are in the orientation of the stored pixels.
"""

from __future__ import annotations

import math
import os
from collections.abc import Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from uavgram.imaging.photos.decoding import REDUCED, halve, read_reduced, shrink
from uavgram.model.result.result import Picture, Region

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
    return _compute_tone(values) if values.size and _needs_stretch(values) else IDENTITY_TONE


def choose_full_range_tone(pixels: Values) -> Tone:
    """Choose the curve that uses the whole range for a picture's values, also if well exposed.

    See `choose_tone`.
    """
    values = _luminance(pixels)
    return _compute_tone(values) if values.size else IDENTITY_TONE


def _needs_stretch(values: Values) -> bool:
    black, median, bright, white = np.percentile(
        values, [BLACK_PERCENTILE, 50.0, BRIGHT_PERCENTILE, WHITE_PERCENTILE]
    )
    return bool(bright < DARK_BELOW or median < DUSK or NOISE < white - black < FLAT)


def _compute_tone(values: Values) -> Tone:
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


Pixels = NDArray[np.uint8]

MAX_WIDTH_PX = 1600
JPEG_QUALITY = 75

# Least width relative to the requested one: a smaller photo is preferred to decoding four times as
# many pixels.
_NARROWER = 0.8


@dataclass(frozen=True, eq=False)
class Preview:
    """Reduced photo in the orientation of the stored pixels.

    Attributes
    ----------
    jpeg
        Encoded picture.
    width_px, height_px
        Its size.
    scale
        Original pixels per preview pixel, along u and v. With (0, 0) the centre of the top-left
        pixel in both: original = (preview + 0.5) * scale - 0.5.
    tone
        Curve by which it is brightened.
    """

    jpeg: bytes
    width_px: int
    height_px: int
    scale: tuple[float, float]
    tone: Tone = IDENTITY_TONE


def read_preview(
    path: str | os.PathLike[str], max_width_px: int = MAX_WIDTH_PX
) -> tuple[Preview, Pixels]:
    """Reduce one photo, and brighten it where it is too dark or flat to be seen.

    Parameters
    ----------
    path
        Any format that OpenCV reads. EXIF rotation is not applied.
    max_width_px
        The preview is at most this wide, and never wider than the photo.

    Returns
    -------
    The preview, and its (height, width, 3) pixels, BGR, before they were brightened and encoded.

    Raises
    ------
    InputError
        The file cannot be read, or is not a photo.
    """
    pixels, reduction = read_reduced(path, lambda width: _reduction(width, max_width_px))
    if reduction == 1:
        return make_preview_of_decoded(pixels, max_width_px)[:2]
    return _make_preview(pixels, reduction, max_width_px)


def make_preview_of_decoded(
    pixels: Pixels, max_width_px: int = MAX_WIDTH_PX
) -> tuple[Preview, Pixels, list[Pixels]]:
    """Reduce a completely decoded photo, to the size that `read_preview` gives.

    Parameters
    ----------
    pixels
        (height, width, 3) BGR.
    max_width_px
        The preview is at most this wide, and never wider than the photo.

    Returns
    -------
    The preview, its pixels, and the photo with the halves that were made.
    """
    halves, reduction = [pixels], _reduction(pixels.shape[1], max_width_px)
    while len(halves) < reduction.bit_length():
        halves.append(halve(halves[-1]))
    return *_make_preview(halves[-1], reduction, max_width_px), halves


def _make_preview(pixels: Pixels, reduction: int, max_width_px: int) -> tuple[Preview, Pixels]:
    """Make preview and pixels of a photo whose pixels are `reduction` wide."""
    height, width = pixels.shape[:2]
    # the last column may cover only a part of a pixel, but counts as `reduction` wide
    covered = np.array([width, height], dtype=np.float64) * reduction
    pixels = shrink(pixels, max_width_px, across_only=True)
    tone = choose_tone(pixels)
    preview = _encode_picture(apply_tone(pixels, tone), (float(covered[0]), float(covered[1])))
    return replace(preview, tone=tone), pixels


def make_preview(pixels: Pixels, max_width_px: int = MAX_WIDTH_PX) -> Preview:
    """Reduce a decoded photo: (height, width) grey, or (height, width, 3) BGR."""
    height, width = pixels.shape[:2]
    return _encode_picture(
        shrink(pixels, max_width_px, across_only=True), (float(width), float(height))
    )


def _encode_picture(pixels: Pixels, covered_px: tuple[float, float]) -> Preview:
    """Encode a picture that covers the given number of original pixels."""
    height, width = pixels.shape[:2]
    encoded_preview = cv2.imencode(".jpg", pixels, [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY])[1]
    return Preview(
        jpeg=encoded_preview.tobytes(),
        width_px=width,
        height_px=height,
        scale=(covered_px[0] / width, covered_px[1] / height),
    )


def jpeg_preview_scale(width_px: int, max_width_px: int = MAX_WIDTH_PX) -> float:
    """Compute the original pixels per preview pixel of a JPEG of this width, before it is read."""
    reduction = _reduction(width_px, max_width_px)
    return max(float(reduction), width_px / max_width_px)


def decode_preview(preview: Preview) -> Pixels:
    """Decode a preview to (height, width, 3) RGB."""
    return np.ascontiguousarray(_decode_own(preview.jpeg)[:, :, ::-1])


def shrink_jpeg(jpeg: bytes, width_px: int) -> bytes:
    """Reduce a JPEG made by this module to at most this width."""
    return make_preview(_decode_own(jpeg), width_px).jpeg


def _decode_own(jpeg: bytes) -> Pixels:
    pixels = cv2.imdecode(np.frombuffer(jpeg, np.uint8), cv2.IMREAD_COLOR)
    if pixels is None:  # previews are encoded by this module
        raise ValueError("a preview holds no JPEG")
    return np.asarray(pixels, np.uint8)


def _reduction(width_px: int, max_width_px: int) -> int:
    """Choose the strongest reduction that leaves (nearly) enough pixels."""
    return max((r for r in REDUCED if width_px / r >= _NARROWER * max_width_px), default=1)


QUALITY = 85
LONGEST_PX = {"overview": 1400, "measurement": 900, "point": 360}
"""Longer side of a picture: a larger part is reduced to it."""


def cut_parts(
    halves: Sequence[Pixels], tone: Tone, regions: Sequence[Region]
) -> tuple[Picture, ...]:
    """Cut parts out of a photo; pixels are those of the photo, or means over several of them.

    Parameters
    ----------
    halves
        (height, width, 3) BGR of the whole photo; then, where they exist already, its halves.
    tone
        Curve that brightens all of them, where the photo is too dark or flat to be seen.
    regions
        Parts of it.
    """
    # Parts of a photo often overlap: halve the photo once for all of them.
    levels = list(halves[:2])
    stretch = None if tone.is_identity else (tone.black, tone.white, tone.gamma)
    shown: dict[tuple[int, ...], tuple[bytes, int]] = {}  # some measurements have the same points
    pictures = []
    for region in regions:
        longest = LONGEST_PX[region.subject]
        place = region.left_px, region.top_px, region.width_px, region.height_px, longest
        if place not in shown:
            level = int(_is_halved(region, longest))
            if level == len(levels):
                levels.append(halve(levels[0]))
            part = shrink(_part(levels[level], region, 1 << level), longest)
            quality = [cv2.IMWRITE_JPEG_QUALITY, QUALITY]
            encoded = cv2.imencode(".jpg", apply_tone(part, tone), quality)[1]
            shown[place] = encoded.tobytes(), part.shape[1]
        jpeg, width = shown[place]
        pictures.append(Picture(region=region, jpeg=jpeg, shown_px=width, stretch=stretch))
    return tuple(pictures)


def _is_halved(region: Region, longest_px: int) -> bool:
    """Return whether a part is shown at half its size or less, with edges on 2 x 2 pixel blocks."""
    size = region.width_px, region.height_px
    return max(size) >= 2 * longest_px and not any(
        edge % 2 for edge in (region.left_px, region.top_px, *size)
    )


def _part(pixels: Pixels, region: Region, step: int) -> Pixels:
    """Cut a part of a photo whose pixels are `step` wide."""
    left, top = region.left_px // step, region.top_px // step
    height, width = region.height_px // step, region.width_px // step
    return pixels[top : top + height, left : left + width]
