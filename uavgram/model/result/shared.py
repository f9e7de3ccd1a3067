"""Unknowns shared by all frames, and comparison of the camera before and after the survey."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Annotated

import numpy as np

from uavgram.model.arrays import NAN_IS_NONE, Bools, Floats, FrozenArrays
from uavgram.model.camera.calibration import Calibration
from uavgram.model.naming import Column

POSE_NAMES = ("east", "north", "up", "turn about right", "turn about down", "turn about forward")
"""Unknowns of a pose: centre in the world, and small rotations about the camera's axes."""


@dataclass(frozen=True, kw_only=True, eq=False)
class OrientationCorrelation(FrozenArrays):
    """Correlations of the adjusted poses with the shared unknowns, to four decimals.

    Those within one pose follow from its covariance. NaN where something is known exactly.

    Attributes
    ----------
    parameters
        (P,) names of the shared unknowns: the lens model's parameters, height and slopes of the
        ground plane, and the readout time where that is an unknown.
    shared
        (P, P) among these.
    frame_id
        (F,) adjusted photos.
    with_pose
        (F, 6, P) of each pose with them.
    """

    parameters: tuple[str, ...]
    shared: Annotated[Floats, "p", "p", NAN_IS_NONE]
    frame_id: Annotated[tuple[str, ...], "n"]
    with_pose: Annotated[Floats, "n", 6, "p", NAN_IS_NONE]


MAX_SIGMA_RATIO = 0.9
"""Largest ratio of posterior to prior sigma of a parameter that the survey determines."""


@dataclass(frozen=True, kw_only=True, eq=False)
class CameraUpdate(FrozenArrays):
    """The camera before and after the survey, parameter by parameter.

    Attributes
    ----------
    names
        (P,) of the parameters.
    prior_value, prior_sigma
        (P,) the calibration.
    value, sigma
        (P,) with the survey's own observations.
    ratio
        (P,) sigma over prior sigma: 1 where nothing was learnt; NaN where the calibration holds the
        parameter fixed.
    shift
        (P,) of the value, in prior sigmas; NaN likewise.
    learnt
        (P,) whether the survey determines the parameter: its ratio is below `MAX_SIGMA_RATIO`.
    """

    names: Annotated[tuple[str, ...], "n"]
    prior_value: Annotated[Floats, "n"]
    prior_sigma: Annotated[Floats, "n"]
    value: Annotated[Floats, "n"]
    sigma: Annotated[Floats, "n"]
    ratio: Annotated[Floats, "n", NAN_IS_NONE]
    shift: Annotated[Floats, "n", NAN_IS_NONE]
    learnt: Annotated[Bools, "n"]


def compare_cameras(prior: Calibration, refined: Estimate) -> CameraUpdate:
    """Compare a calibration with its estimate from the survey.

    Parameters
    ----------
    prior
        The calibration before the survey.
    refined
        Its parameters in the adjustment, (P,).
    """
    sigma = np.sqrt(np.maximum(prior.covariance.diagonal(), 0.0))  # not negative by rounding
    free = np.where(sigma > 0, sigma, np.nan)
    ratio = refined.sigma / free
    return CameraUpdate(
        names=prior.parameter_names,
        prior_value=prior.parameters,
        prior_sigma=sigma,
        value=refined.value,
        sigma=refined.sigma,
        ratio=ratio,
        shift=(refined.value - prior.parameters) / free,
        learnt=ratio < MAX_SIGMA_RATIO,  # False for NaN
    )


@dataclass(frozen=True, kw_only=True, eq=False)
class Estimate(FrozenArrays):
    """A shared unknown: value and standard deviation, both (n,)."""

    value: Annotated[Floats, "n"]
    sigma: Annotated[Floats, "n"]


@dataclass(frozen=True, kw_only=True, eq=False)
class SharedResult:
    """Unknowns shared by all frames, after the adjustment.

    Attributes
    ----------
    boresight_deg, lever_arm_m, position_bias_m, heading_bias_deg, clock_offset_s
        Of the telemetry; None without a log. Biases are log minus truth; the position bias is
        (east, north, up); the boresight a rotation vector in the camera frame.
    clock_drift_ppm
        Of the camera's clock against the flight's, about the middle of the exposures; None without
        a log.
    readout_s
        Time in which a photo is read from its first row to the last; None where it is no unknown.
    tape_scale
        By the name of each tape that was used, which may be empty: +0.01 where it is 1 % too long,
        and so reads short. Empty where tapes are exact, or none was used.
    intrinsics
        In the order of the lens model's parameters.
    """

    boresight_deg: Estimate | None
    lever_arm_m: Estimate | None
    position_bias_m: Estimate | None
    heading_bias_deg: Estimate | None
    clock_offset_s: Estimate | None
    clock_drift_ppm: Estimate | None = None
    readout_s: Estimate | None = None
    intrinsics: Estimate
    tape_scale: Mapping[str, Estimate] = field(default_factory=dict)


@dataclass(frozen=True, kw_only=True, eq=False)
class AreaPlane(FrozenArrays):
    """Plane of one area of the ground, after the adjustment.

    Attributes
    ----------
    name
        Of the area.
    height_m, slope_deg
        At the pivot; [d up / d east, d up / d north] as angles.
    pivot_m
        (2,) east and north of the point about which the slopes turn.
    """

    name: str
    height_m: Estimate
    slope_deg: Annotated[Estimate, Column(axes=("east", "north"))]
    pivot_m: Annotated[Floats, 2]

    @property
    def surface(self) -> Floats:
        """(3,) height at the pivot [m] and slopes to the east and to the north [m/m]."""
        return np.concatenate([self.height_m.value, np.tan(np.deg2rad(self.slope_deg.value))])

    def height_at(self, east_north_m: Floats) -> Floats:
        """Return the (...) heights [m] of the plane at (..., 2) world positions [m]."""
        surface = self.surface
        return np.asarray(surface[0] + (east_north_m - self.pivot_m) @ surface[1:])
