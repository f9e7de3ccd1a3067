"""Curves of the poses over the frames: corrections and standard deviations."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from uavgram.model.arrays import Floats
from uavgram.model.naming import METRIC, Units
from uavgram.model.result.result import Result
from uavgram.views.recording.stream import Recorder
from uavgram.views.style import MEASURED, OBSERVED, REFINED, SEED
from uavgram.views.survey.drawing import largest_sigmas
from uavgram.views.units import column

CORRECTION = "plots/attitude_correction"
ATTITUDE_SIGMA = "plots/attitude_sigma"
POSITION_SIGMA = "plots/position_sigma"


@dataclass(frozen=True, eq=False)
class PoseCurves:
    """Curves over the F frames; NaN if a frame has no such pose.

    Attributes
    ----------
    tilt_deg
        (F,) angle between the optical axes of the adjustment and of the flight log.
    turn_deg
        (F,) rotation of the photo about that axis, not signed.
    seed_attitude_deg, refined_attitude_deg
        (F,) standard deviation about the least certain of the camera's axes.
    seed_position_m, refined_position_m
        (F,) standard deviation along the least certain of east, north and up.
    """

    tilt_deg: Floats
    turn_deg: Floats
    seed_attitude_deg: Floats
    refined_attitude_deg: Floats
    seed_position_m: Floats
    refined_position_m: Floats


def pose_curves(result: Result) -> PoseCurves:
    """Compare the adjusted poses with those of the flight log."""
    seed, refined = result.frames.seed, result.frames.refined
    # adjusted axes in the camera frame of the flight log
    change = np.einsum("nji,njk->nik", seed.world_from_camera, refined.world_from_camera)
    # rotation about the optical axis that is nearest to the change
    turn = np.arctan2(change[:, 1, 0] - change[:, 0, 1], change[:, 0, 0] + change[:, 1, 1])
    seed_position, seed_attitude = largest_sigmas(seed)
    refined_position, refined_attitude = largest_sigmas(refined)
    return PoseCurves(
        tilt_deg=np.degrees(np.arccos(np.clip(change[:, 2, 2], -1.0, 1.0))),
        turn_deg=np.degrees(np.abs(turn)),
        seed_attitude_deg=seed_attitude,
        refined_attitude_deg=refined_attitude,
        seed_position_m=seed_position,
        refined_position_m=refined_position,
    )


def log_pose_plots(recorder: Recorder, curves: PoseCurves, units: Units = METRIC) -> None:
    """Log every curve.

    Parameters
    ----------
    recorder
        The open recording.
    curves
        Curves of the poses.
    units
        Units in which lengths are shown.
    """
    one = column(units)
    for path, values, name, colour in (
        (f"{CORRECTION}/tilt", curves.tilt_deg, "optical axis tilted [°]", REFINED),
        (f"{CORRECTION}/turn", curves.turn_deg, "photo turned [°]", MEASURED),
        (f"{CORRECTION}/log_sigma", curves.seed_attitude_deg, "σ of the flight log [°]", OBSERVED),
        (f"{ATTITUDE_SIGMA}/flight_log", curves.seed_attitude_deg, "flight log [°]", SEED),
        (f"{ATTITUDE_SIGMA}/refined", curves.refined_attitude_deg, "refined [°]", REFINED),
    ):
        recorder.curve(path, values, name, colour)
    for path, values, name, colour in (
        (f"{POSITION_SIGMA}/flight_log", curves.seed_position_m, "flight log", SEED),
        (f"{POSITION_SIGMA}/refined", curves.refined_position_m, "refined", REFINED),
    ):
        recorder.curve(path, one.factor * values, f"{name} [{one.symbol}]", colour)
