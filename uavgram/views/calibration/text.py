"""A calibration as text for a terminal: parameters, fit, messages sorted by level."""

from __future__ import annotations

import numpy as np

from uavgram.model.camera.calibration_result import CalibrationAccount, CalibrationResult
from uavgram.views.calibration.camera_text import parameter_cells
from uavgram.views.calibration.drawing import SQRT2, pixels_text
from uavgram.views.calibration.verdict import calibration_facts, judge_calibration
from uavgram.views.terminal import aligned, message_lines

MOST_PHOTOS = 8


def calibration_lines(account: CalibrationAccount) -> list[str]:
    """Format the result of `uavgram calibrate`."""
    result = account.result
    camera, verdict = result.calibration, judge_calibration(account)
    facts = calibration_facts(account)
    width = max(len(question) for question, _ in facts)
    return [
        f"{camera.name}: {camera.model} lens, {camera.width_px} x {camera.height_px} px",
        "",
        aligned(parameter_cells(camera), right=(1, 2, 3)),
        "",
        verdict.sentence,
        verdict.counts,
        "",
        *(f"{question:<{width}}  {answer}" for question, answer in facts),
        "",
        *_photo_lines(result),
        "",
        *message_lines(account.messages),
    ]


def _photo_lines(result: CalibrationResult) -> list[str]:
    """List the photos that fit worst, the worst first; the report has them all."""
    photos = result.photos
    order = np.argsort(-photos.rms_px, kind="stable")
    cells: list[tuple[str, ...]] = [("photo", "corners", "residual", "left out", "tilt", "status")]
    cells += [
        (
            photos.file[k],
            str(int(np.sum(result.corners.photo == k))),
            f"{pixels_text(photos.rms_px[k] / SQRT2)} px",
            f"{pixels_text(photos.held_out_px[k])} px",
            f"{photos.tilt_deg[k]:.0f}°",
            photos.status[k],
        )
        for k in order[:MOST_PHOTOS].tolist()
    ]
    more = len(order) - MOST_PHOTOS
    note = [f"and {more} photos that fit better"] if more > 0 else []
    return [*aligned(cells, right=(1, 2, 3, 4)).splitlines(), *note]
