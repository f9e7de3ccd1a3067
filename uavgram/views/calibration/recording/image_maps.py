"""Maps over the image: coverage, residuals of all photos, and accuracy of a direction."""

from __future__ import annotations

import numpy as np
import rerun as rr

from uavgram.model.arrays import Floats
from uavgram.model.board import CalibrationResult
from uavgram.views.calibration.drawing_rules import (
    mean_residual_factor,
    pixels_text,
    uncertainty_shares,
)
from uavgram.views.recording.stream import CENTRE_PX, Recorder
from uavgram.views.style import BAD, OBSERVED, QUIET, REFINED, scale_colours

COVERAGE, RESIDUALS, UNCERTAINTY = "maps/coverage", "maps/residuals", "maps/uncertainty"

_EMPTY = np.array([120.0, 40, 40])
_FEW, _MANY = np.array([28.0, 52, 78]), np.array([70.0, 150, 225])
UNLIKELY = 0.001


def log_image_maps(recorder: Recorder, result: CalibrationResult) -> None:
    """Log the three maps, in original pixels."""
    _coverage(recorder, result)
    _residuals(recorder, result)
    _uncertainty(recorder, result)


def _coverage(recorder: Recorder, result: CalibrationResult) -> None:
    count = result.maps.corners
    strength = np.log1p(count) / np.log1p(max(int(count.max()), 1))
    colour = _FEW + strength[..., None] * (_MANY - _FEW)
    colour[count == 0] = _EMPTY
    _cells(recorder, COVERAGE, result, colour)
    recorder.dots(f"{COVERAGE}/corners", result.corners.pixel_px + CENTRE_PX, OBSERVED, 1.2)
    _numbers(recorder, COVERAGE, result, [str(n) for n in count.ravel().tolist()])


def _residuals(recorder: Recorder, result: CalibrationResult) -> None:
    corners, maps = result.corners, result.maps
    factor = mean_residual_factor(result)
    used = np.array([status != "removed" for status in corners.status])
    start = corners.pixel_px[used]
    _strips(recorder, "corners", start, start + factor * corners.residual_px[used], QUIET, 0.7)
    start, shift = maps.cell_px.reshape(-1, 2), maps.residual_px.reshape(-1, 2)
    known = np.isfinite(shift[:, 0])
    odd = known & (maps.residual_probability.ravel() < UNLIKELY)
    for name, mask, colour in (("mean", known & ~odd, REFINED), ("mean_improbable", odd, BAD)):
        _strips(recorder, name, start[mask], (start + factor * shift)[mask], colour, 2.6)
        recorder.dots(f"{RESIDUALS}/{name}_start", start[mask] + CENTRE_PX, colour, 2.2)


def _strips(
    recorder: Recorder,
    name: str,
    start: Floats,
    end: Floats,
    colour: tuple[int, int, int],
    width: float,
) -> None:
    strips = np.stack([start, end], axis=1) + CENTRE_PX
    recorder.lines(f"{RESIDUALS}/{name}", strips, colour, width)


def _uncertainty(recorder: Recorder, result: CalibrationResult) -> None:
    values = result.maps.uncertainty_px
    share, _, _ = uncertainty_shares(values)
    colour = scale_colours(1 - share.ravel()).reshape(*values.shape, 3).astype(np.float64)
    _cells(recorder, UNCERTAINTY, result, 0.72 * colour)  # darker: white numbers are legible
    _numbers(recorder, UNCERTAINTY, result, [pixels_text(v) for v in values.ravel().tolist()])


def _cells(recorder: Recorder, path: str, result: CalibrationResult, colour: Floats) -> None:
    """Log a picture of one pixel per cell, scaled to the size of the image."""
    rows, columns = colour.shape[:2]
    camera = result.calibration
    recorder.static(
        f"{path}/cells",
        rr.Image(
            np.round(colour).astype(np.uint8), color_model="RGB", draw_order=-10.0,
            magnification_filter="nearest",
        ),
        rr.Transform3D(scale=[camera.width_px / columns, camera.height_px / rows, 1.0]),
    )  # fmt: skip


def _numbers(recorder: Recorder, path: str, result: CalibrationResult, texts: list[str]) -> None:
    recorder.texts(f"{path}/numbers", result.maps.cell_px.reshape(-1, 2) + CENTRE_PX, texts)
