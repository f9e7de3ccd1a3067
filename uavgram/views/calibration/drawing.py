"""What the report and the recording of a calibration draw alike."""

from __future__ import annotations

import numpy as np

from uavgram.model.arrays import Floats, Ints
from uavgram.model.camera.calibration_result import CalibrationResult
from uavgram.views.style import scale_colours
from uavgram.views.survey.drawing import nice_factor

RESIDUAL_SHARE = 0.04
"""Of the photo's width that the larger exaggerated residuals may fill."""

SQRT2 = 2.0**0.5
"""From the rms length of residuals to that of one coordinate."""

CELL_SHARE = 0.5
"""Of a cell of the maps that the longest exaggerated mean residual may fill."""


def rows_by_photo(result: CalibrationResult) -> dict[str, Ints]:
    """Rows of the corners of each photo that could be used, by its name."""
    photo = result.corners.photo
    return {file: np.flatnonzero(photo == k) for k, file in enumerate(result.photos.file)}


def residual_factor(result: CalibrationResult) -> int:
    """By how much residuals are exaggerated on the photos: of the 1-2-5 series."""
    return nice_factor(_large(result.corners.residual_px), _wanted(result, RESIDUAL_SHARE))


def mean_residual_factor(result: CalibrationResult) -> int:
    """By how much the mean residuals of the maps' cells are exaggerated."""
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
    """(M, 2) tilt of the board in each photo [degrees], as a vector in the image.

    It points to where the board goes away from the camera: right and down are positive.
    """
    normal = result.photos.poses.world_from_camera[:, 2]  # the board's z in the camera's frame
    side = normal[:, :2] * np.sign(normal[:, 2:])
    length = np.linalg.norm(side, axis=1, keepdims=True)
    unit = np.divide(side, length, out=np.zeros_like(side), where=length > 0)
    # A plane with the normal n falls away along -n: depth = (d - n_xy . p) / n_z.
    return np.asarray(-unit * result.photos.tilt_deg[:, None])


def uncertainty_shares(values: Floats) -> tuple[Floats, float, float]:
    """Where on a colour scale values lie, by their logarithms, from 0 to 1; its two ends.

    NaN becomes 1: what is not known at all is worst.
    """
    known = values[np.isfinite(values) & (values > 0)]
    low, high = (float(known.min()), float(known.max())) if len(known) else (0.1, 1.0)
    high = max(high, 2.0 * low)
    share = (np.log(np.clip(np.nan_to_num(values, nan=high), low, high)) - np.log(low)) / (
        np.log(high) - np.log(low)
    )
    return share, low, high


def hex_colours(share: Floats) -> list[str]:
    """``#rrggbb`` of the colour scale, for a flat array."""
    return [f"#{r:02x}{g:02x}{b:02x}" for r, g, b in scale_colours(share).tolist()]


def is_dark(colour: str) -> bool:
    """Whether white letters are read best on it (ITU-R BT.601 luma)."""
    red, green, blue = (int(colour[k : k + 2], 16) for k in (1, 3, 5))
    return 0.299 * red + 0.587 * green + 0.114 * blue < 140


def pixels_text(value: float) -> str:
    """``0.18``, ``2.4``, ``25``: two significant digits, an en dash for NaN."""
    if not np.isfinite(value):
        return "–"
    if value >= 9.95:
        return f"{value:.0f}"
    return f"{value:.1f}" if value >= 0.995 else f"{value:.2f}"
