"""Exterior orientation: camera poses with their covariances."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Annotated

from uavgram.model.arrays import Floats, FrozenArrays, Ints, rows_of


@dataclass(frozen=True, kw_only=True, eq=False)
class Poses(FrozenArrays):
    """N camera poses.

    Attributes
    ----------
    frame_id
        (N,) names.
    center_world_m
        (N, 3) projection centres.
    world_from_camera
        (N, 3, 3) rotations.
    covariance
        (N, 6, 6) of (δcentre in world [m], δθ in camera [rad]), true R = R @ exp(δθ).
    """

    frame_id: Annotated[tuple[str, ...], "n"]
    center_world_m: Annotated[Floats, "n", 3]
    world_from_camera: Annotated[Floats, "n", 3, 3]
    covariance: Annotated[Floats, "n", 6, 6]

    def take(self, index: Ints) -> Poses:
        """Some of the poses, in the order of `index`."""
        return replace(self, **rows_of(self, index))


@dataclass(frozen=True, kw_only=True, eq=False)
class TelemetryPrior(FrozenArrays):
    """What the flight log says of N poses, without what is a shared unknown of the adjustment.

    A camera stands at ``p(t) - bias + Rb l`` and looks along ``Rz Rm(t) C exp(boresight)`` with
    t = `time_s` - clock correction - drift (`time_s` - `middle_s`); see
    geometry/motion/telemetry_pose.py.

    Attributes
    ----------
    frame_index
        (N,) into the survey's frames.
    time_s
        (N,) UTC instants at zero clock correction.
    middle_s
        Of all exposures of the flight: where a drift leaves the clock correction alone.
    gimbal_from_camera
        (3, 3) camera axes in the mount's frame (of the gimbal, or of the body).
    covariance
        (N, 6, 6) independent from frame to frame: (δcentre world m, δθ camera rad).
    clock_sigma_s, clock_drift_sigma
        Prior sigmas of the clock correction, and of the clock's drift (dimensionless; 1e-6 is
        1 ppm).
    boresight_sigma_rad, heading_bias_sigma_rad
        Prior sigmas of those shared unknowns.
    lever_arm_m, lever_arm_sigma_m
        (3,) autopilot to camera, body FRD; prior sigma of each axis.
    position_bias_sigma_m
        (3,) east, north, up.
    heading_bias_rad
        Where the heading bias is looked for: the mean of its prior, which the seeds share.
    """

    frame_index: Annotated[Ints, "n"]
    time_s: Annotated[Floats, "n"]
    middle_s: float
    gimbal_from_camera: Annotated[Floats, 3, 3]
    covariance: Annotated[Floats, "n", 6, 6]
    clock_sigma_s: float
    clock_drift_sigma: float
    boresight_sigma_rad: float
    heading_bias_sigma_rad: float
    lever_arm_m: Annotated[Floats, 3]
    lever_arm_sigma_m: float
    position_bias_sigma_m: Annotated[Floats, 3]
    heading_bias_rad: float = 0.0


@dataclass(frozen=True, kw_only=True, eq=False)
class CandidatePoses(FrozenArrays):
    """Poses that one frame may have, best first: where an adjustment may start.

    Attributes
    ----------
    frame_id
        Its name.
    center_world_m, world_from_camera
        (S, 3), (S, 3, 3).
    misfit
        (S,) how badly each fits what it was made from; 0 is exact.
    """

    frame_id: str
    center_world_m: Annotated[Floats, "n", 3]
    world_from_camera: Annotated[Floats, "n", 3, 3]
    misfit: Annotated[Floats, "n"]
