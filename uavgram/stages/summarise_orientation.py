"""Summarise: how the poses hang together with camera and ground plane."""

from __future__ import annotations

import numpy as np

from uavgram.estimation.survey.adjustment import Adjustment
from uavgram.model.result.orientation import OrientationCorrelation

PLANE_NAMES = ("plane height", "slope east", "slope north")
DECIMALS = 4


def summarise_orientation(adjustment: Adjustment) -> OrientationCorrelation:
    """Correlations of each adjusted pose with the lens, the first area's plane, and the readout."""
    survey = adjustment.survey
    joint = adjustment.sight_covariance(np.arange(adjustment.problem.layout.frames))
    sigma = np.sqrt(np.diagonal(joint, axis1=1, axis2=2))
    with np.errstate(divide="ignore", invalid="ignore"):
        known = joint / (sigma[:, :, None] * sigma[:, None, :])
    correlation = np.where(np.isfinite(known), known, np.nan).round(DECIMALS) + 0.0
    readout = ("readout time",) * adjustment.problem.layout.readout
    return OrientationCorrelation(
        parameters=(*survey.calibration.parameter_names, *PLANE_NAMES, *readout),
        shared=correlation[0, 6:, 6:],
        frame_id=survey.frame_id,
        with_pose=correlation[:, :6, 6:],
    )
