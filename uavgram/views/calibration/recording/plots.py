"""Curves over the photos: residuals, prediction when left out, tilt; and the photos' states."""

from __future__ import annotations

import numpy as np

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
        recorder.curve(path, values, name, colour)
    recorder.states(STATUS, photos.status, _STATES, {state: state for state in _STATES})
