"""How a survey's cameras moved while their photos were read, and whether that is felt."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from uavgram.geometry.motion.camera_motion import camera_motion
from uavgram.model.arrays import Floats
from uavgram.model.camera.tags import UNKNOWN_READOUT, Readout
from uavgram.model.flight.log import Track
from uavgram.model.survey.survey import RollingShutter, Survey

FELT_PX = 0.05
"""By which rows at the edge must move in some photo, lest the readout time be left out: a tenth of
a good pick's noise."""

NONE = Readout(value_s=0.0, sigma_s=0.0)
"""All rows at once."""

LEAST_SIGMA_S = 1e-6
"""Of a readout time that is stated as exact: an unknown needs a sigma, no camera is as steady."""


def with_readout(survey: Survey, shared: Floats) -> Survey:
    """The survey with what it needs to find the readout time, or with nothing of it.

    That time is left out where the photos come without a track, where the camera is known to take
    all rows at once, and where it moved so little that no pick would feel it.

    Parameters
    ----------
    survey
        Its calibration says what is known of the readout.
    shared
        (12,) unknowns of the telemetry at which the camera's motion is looked up.
    """
    readout = survey.calibration.readout or UNKNOWN_READOUT
    telemetry, track = survey.telemetry, survey.track
    if telemetry is None or not isinstance(track, Track) or readout == NONE:
        return replace(survey, rolling=None)
    motion = np.zeros((len(survey.frame_id), 6))
    names = [survey.frame_id[k] for k in telemetry.frame_index]
    motion[telemetry.frame_index] = camera_motion(track, telemetry, names, shared)
    longest_s = abs(readout.value_s) + readout.sigma_s
    if edge_shift_px(survey, longest_s * motion) < FELT_PX:
        return replace(survey, rolling=None)
    known = replace(readout, sigma_s=max(readout.sigma_s, LEAST_SIGMA_S))
    return replace(survey, rolling=RollingShutter(readout=known, motion=motion))


def edge_shift_px(survey: Survey, sweep: Floats) -> float:
    """About how far such sweeps (F, 6) move pixels at the upper and lower edge, at the most."""
    if survey.seeds is None or not len(sweep):
        return 0.0
    away = np.abs(survey.seeds.center_world_m[:, 2] - survey.ground.height_m)
    turn = np.linalg.norm(sweep[:, 3:], axis=1)
    turn += np.linalg.norm(sweep[:, :3], axis=1) / np.maximum(away, 1.0)
    return float(survey.calibration.parameters[0] * turn.max() / 2)
