"""Drawing rules that the report and the recording of a calibration share."""

from __future__ import annotations

import numpy as np

from uavgram.model.arrays import Floats, Ints
from uavgram.model.board import CalibrationResult
from uavgram.views.style import scale_colours
from uavgram.views.survey.outlines import nice_factor

RESIDUAL_SHARE = 0.04
"""Share of the photo's width that the larger exaggerated residuals fill."""

SQRT2 = 2.0**0.5
"""Ratio of the rms length of residuals to the rms of one coordinate."""

CELL_SHARE = 0.5
"""Share of a cell of the maps that the longest exaggerated mean residual fills."""


def rows_by_photo(result: CalibrationResult) -> dict[str, Ints]:
    """Return the rows of the corners of each used photo, by its name."""
    photo = result.corners.photo
    return {file: np.flatnonzero(photo == k) for k, file in enumerate(result.photos.file)}


def residual_factor(result: CalibrationResult) -> int:
    """Return the exaggeration of residuals on the photos, a number of the 1-2-5 series."""
    return nice_factor(_large(result.corners.residual_px), _wanted(result, RESIDUAL_SHARE))


def mean_residual_factor(result: CalibrationResult) -> int:
    """Return the exaggeration of the mean residuals in the cells of the maps."""
    maps = result.maps
    mean = maps.residual_px[np.isfinite(maps.residual_px[..., 0])]
    cell = CELL_SHARE / maps.cell_px.shape[1]
    longest = float(np.linalg.norm(mean, axis=-1).max()) if len(mean) else 0.0
    return nice_factor(longest, _wanted(result, cell))


def _large(residual_px: Floats) -> float:
    size = np.linalg.norm(residual_px, axis=1)
    return float(np.quantile(size, 0.9)) if len(size) else 0.0


def _wanted(result: CalibrationResult, share: float) -> float:
    return share * result.calibration.width_px


def tilt_directions(result: CalibrationResult) -> Floats:
    """Compute the (M, 2) tilt of the board in each photo [degrees], as a vector in the image.

    It points to where the board goes away from the camera: right and down are positive.
    """
    normal = result.photos.poses.world_from_camera[:, 2]  # the board's z in the camera's frame
    side = normal[:, :2] * np.sign(normal[:, 2:])
    length = np.linalg.norm(side, axis=1, keepdims=True)
    unit = np.divide(side, length, out=np.zeros_like(side), where=length > 0)
    # A plane with the normal n falls away along -n: depth = (d - n_xy . p) / n_z.
    return np.asarray(-unit * result.photos.tilt_deg[:, None])


def uncertainty_shares(values: Floats) -> tuple[Floats, float, float]:
    """Scale values by their logarithms to 0 to 1; return the shares and the two ends.

    NaN becomes 1, the worst.
    """
    known = values[np.isfinite(values) & (values > 0)]
    low, high = (float(known.min()), float(known.max())) if len(known) else (0.1, 1.0)
    high = max(high, 2.0 * low)
    share = (np.log(np.clip(np.nan_to_num(values, nan=high), low, high)) - np.log(low)) / (
        np.log(high) - np.log(low)
    )
    return share, low, high


def hex_colours(share: Floats) -> list[str]:
    """Return the colours of the scale as ``#rrggbb``, for a flat array."""
    return [f"#{r:02x}{g:02x}{b:02x}" for r, g, b in scale_colours(share).tolist()]


def is_dark(colour: str) -> bool:
    """Return whether white letters are more legible on a colour (ITU-R BT.601 luma)."""
    red, green, blue = (int(colour[k : k + 2], 16) for k in (1, 3, 5))
    return 0.299 * red + 0.587 * green + 0.114 * blue < 140


def pixels_text(value: float) -> str:
    """Format pixels with two significant digits: ``0.18``, ``2.4``, ``25``; en dash for NaN."""
    if not np.isfinite(value):
        return "–"
    if value >= 9.95:
        return f"{value:.0f}"
    return f"{value:.1f}" if value >= 0.995 else f"{value:.2f}"
