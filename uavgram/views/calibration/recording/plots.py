"""Curves over the photos: residuals, prediction when left out, tilt; and the photos' states."""

from __future__ import annotations

import numpy as np
import rerun as rr

from uavgram.model.arrays import Floats
from uavgram.model.camera.calibration_result import CalibrationResult
from uavgram.views.calibration.drawing import SQRT2
from uavgram.views.recording.stream import Recorder
from uavgram.views.style import BAD, GOOD, OBSERVED, QUIET, REFINED, SEED, Rgb

RESIDUAL, TILT, STATUS = "plots/residual", "plots/tilt", "photo_status"
_STATES: dict[str, Rgb] = {"used": GOOD, "suspect": BAD, "removed": QUIET}


def log_photo_plots(recorder: Recorder, result: CalibrationResult) -> None:
    """Log every curve and the states."""
    photos = result.photos
    noise = np.full(len(photos.file), result.quality.sigma_px)
    for path, values, name, colour in (
        (f"{RESIDUAL}/adjusted", photos.rms_px / SQRT2, "residual [px]", REFINED),
        (f"{RESIDUAL}/left_out", photos.held_out_px, "when left out [px]", SEED),
        (f"{RESIDUAL}/sigma_of_corners", noise, "σ of a corner [px]", OBSERVED),
        (f"{TILT}/tilt", photos.tilt_deg, "tilt [°]", REFINED),
    ):
        _curve(recorder, path, values, name, colour)
    recorder.static(
        STATUS,
        rr.StateConfiguration(
            values=list(_STATES), labels=list(_STATES), colors=list(_STATES.values())
        ),
    )
    states = np.array(photos.status, dtype=str)
    recorder.rows(
        STATUS, np.arange(len(states)), lambda some: [rr.StateChange.columns(state=states[some])]
    )


def _curve(recorder: Recorder, path: str, values: Floats, name: str, colour: Rgb) -> None:
    known = np.flatnonzero(np.isfinite(values))
    if len(known):
        recorder.static(path, rr.SeriesLines(colors=colour, names=name, widths=2.0))
        recorder.rows(path, known, lambda some: [rr.Scalars.columns(scalars=values[some])])
