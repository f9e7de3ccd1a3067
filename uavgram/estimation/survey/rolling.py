"""Motion of the cameras during the readout of their photos, and whether it has an effect."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from uavgram.geometry.motion.camera_motion import camera_motion
from uavgram.model.arrays import Floats
from uavgram.model.camera import UNKNOWN_READOUT, Readout
from uavgram.model.flight_log import Track
from uavgram.model.survey import RollingShutter, Survey

MIN_SHIFT_PX = 0.05
"""Smallest shift of rows at the edge of any photo for which the readout time is kept [px]: a tenth
of a good pick's noise."""

GLOBAL_SHUTTER = Readout(value_s=0.0, sigma_s=0.0)
"""Readout of all rows at once."""

MIN_SIGMA_S = 1e-6
"""Smallest sigma of a readout time that is stated as exact [s]: an unknown needs a sigma, and no
camera is as steady."""


def add_readout(survey: Survey, shared: Floats) -> Survey:
    """Return the survey with the data for the readout time, or without them where it has no effect.

    The readout time is left out if the photos come without a track, if the camera is known to take
    all rows at once, or if it moved so little that no pick would be affected.

    Parameters
    ----------
    survey
        Survey, whose calibration holds the prior of the readout.
    shared
        (12,) unknowns of the telemetry at which the camera's motion is evaluated.
    """
    readout = survey.calibration.readout or UNKNOWN_READOUT
    telemetry, track = survey.telemetry, survey.track
    if telemetry is None or not isinstance(track, Track) or readout == GLOBAL_SHUTTER:
        return replace(survey, rolling=None)
    motion = np.zeros((len(survey.frame_id), 6))
    names = [survey.frame_id[k] for k in telemetry.frame_index]
    motion[telemetry.frame_index] = camera_motion(track, telemetry, names, shared)
    longest_s = abs(readout.value_s) + readout.sigma_s
    if estimate_edge_shift_px(survey, longest_s * motion) < MIN_SHIFT_PX:
        return replace(survey, rolling=None)
    known = replace(readout, sigma_s=max(readout.sigma_s, MIN_SIGMA_S))
    return replace(survey, rolling=RollingShutter(readout=known, motion=motion))


def estimate_edge_shift_px(survey: Survey, sweep: Floats) -> float:
    """Estimate the largest shift of pixels at the upper and lower edge by sweeps (F, 6) [px]."""
    if survey.seeds is None or not len(sweep):
        return 0.0
    away = np.abs(survey.seeds.center_world_m[:, 2] - survey.ground.height_m)
    turn = np.linalg.norm(sweep[:, 3:], axis=1)
    # A shift of the camera moves the image like a turn by shift / distance.
    turn += np.linalg.norm(sweep[:, :3], axis=1) / np.maximum(away, 1.0)
    return float(survey.calibration.parameters[0] * turn.max() / 2)
