"""Photos, frames with their times of exposure, and their poses with covariances and priors."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from typing import Annotated, Literal

import numpy as np

from uavgram.model.arrays import NAN_IS_NONE, Bools, Floats, FrozenArrays, Ints, rows_of
from uavgram.model.flight_log import HeightDatum, Track

TimeSource = Literal["exif", "filename", "none"]


@dataclass(frozen=True, kw_only=True, eq=False)
class Photos(FrozenArrays):
    """F photo files, in the order of their names.

    Attributes
    ----------
    frame_id
        (F,) file names, unique in the project.
    path
        (F,) paths.
    width_px, height_px
        (F,) size of the stored, unrotated image.
    file_time_s
        (F,) the camera clock's reading as UTC seconds since the Unix epoch (corrected for a stated
        zone, otherwise read as if it were UTC); NaN where the file has none.
    file_time_resolution_s
        (F,) resolution of that reading: 1.0 for plain EXIF, 0.001 with three sub-second digits.
    time_source
        Source of the readings, one for all photos.
    """

    frame_id: Annotated[tuple[str, ...], "n"]
    path: Annotated[tuple[str, ...], "n"]
    width_px: Annotated[Floats, "n"]
    height_px: Annotated[Floats, "n"]
    file_time_s: Annotated[Floats, "n", NAN_IS_NONE]
    file_time_resolution_s: Annotated[Floats, "n", NAN_IS_NONE]
    time_source: TimeSource


@dataclass(frozen=True, kw_only=True, eq=False)
class Frames(FrozenArrays):
    """F frames and their times of exposure.

    Attributes
    ----------
    frame_id
        (F,) names, those of the photos.
    time_utc_s
        (F,) UTC seconds since the Unix epoch; NaN where unknown.
    sigma_time_s
        (F,) of each frame's own timing error (resolution, jitter), without the error common to all
        frames; NaN where the time is.
    matched
        (F,) whether the time is within the flight log.
    reason
        (F,) why a frame is unmatched; empty where it is matched.
    clock_offset_s
        Assumed camera clock minus UTC (a file time t was really t - offset).
    clock_offset_sigma_s
        Its prior standard deviation, common to all frames.
    clock_drift_sigma
        Prior standard deviation of the camera clock's drift against the flight's (dimensionless;
        1e-6 is 1 ppm); 0 where the times are those of the flight's own clock.
    """

    frame_id: Annotated[tuple[str, ...], "n"]
    time_utc_s: Annotated[Floats, "n", NAN_IS_NONE]
    sigma_time_s: Annotated[Floats, "n", NAN_IS_NONE]
    matched: Annotated[Bools, "n"]
    reason: Annotated[tuple[str, ...], "n"]
    clock_offset_s: float
    clock_offset_sigma_s: float
    clock_drift_sigma: float = 0.0


PairStatus = Literal["certain", "hidden", "crowded", "none"]


@dataclass(frozen=True, kw_only=True, eq=False)
class Pairing(FrozenArrays):
    """Pairing of F photos with E camera events of one boot.

    Attributes
    ----------
    frame_id
        (F,) the photos.
    event_index
        (F,) row of the boot's camera events, -1 where the photo has none.
    residual_s
        (F,) photo time by the fitted clock - event time; NaN without an event.
    status
        (F,) of `Alignment.status`: only a ``certain`` photo takes its event's time.
    reason
        (F,) why a photo has no certain event; empty where it has.
    unused_event
        (U,) rows of the boot's camera events without a photo.
    unused_reason
        (U,) their position among the photos.
    drift, drift_sigma
        Of the camera's clock against the autopilot's.
    """

    frame_id: Annotated[tuple[str, ...], "n"]
    event_index: Annotated[Ints, "n"]
    residual_s: Annotated[Floats, "n", NAN_IS_NONE]
    status: Annotated[tuple[PairStatus, ...], "n"]
    reason: Annotated[tuple[str, ...], "n"]
    unused_event: Annotated[Ints, "u"]
    unused_reason: Annotated[tuple[str, ...], "u"]
    drift: float
    drift_sigma: float


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
        """Return selected poses, in the order of `index`."""
        return replace(self, **rows_of(self, index))


@dataclass(frozen=True, kw_only=True, eq=False)
class TelemetryPrior(FrozenArrays):
    """Prior of N poses from the flight log, without the shared unknowns of the adjustment.

    A camera is at ``p(t) - bias + Rb l`` and has the rotation ``Rz Rm(t) C exp(boresight)`` with t
    = `time_s` - clock correction - drift (`time_s` - `middle_s`); see
    geometry/motion/camera_motion.py.

    Attributes
    ----------
    frame_index
        (N,) into the survey's frames.
    time_s
        (N,) UTC at zero clock correction.
    middle_s
        Middle of all exposures of the flight: the time at which a drift does not change the clock
        correction.
    gimbal_from_camera
        (3, 3) camera axes in the mount's frame (of the gimbal, or of the body).
    covariance
        (N, 6, 6) independent from frame to frame: (δcentre world m, δθ camera rad).
    clock_sigma_s, clock_drift_sigma
        Prior sigmas of the clock correction, and of the clock's drift (dimensionless; 1e-6 is 1
        ppm).
    boresight_sigma_rad, heading_bias_sigma_rad
        Prior sigmas of those shared unknowns.
    lever_arm_m, lever_arm_sigma_m
        (3,) autopilot to camera, body FRD; prior sigma of each axis.
    position_bias_sigma_m
        (3,) east, north, up.
    heading_bias_rad
        Prior mean of the heading bias, which the seeds share.
    mount_is_assumed
        Whether the viewing direction is assumed, as neither log, photos nor project state it.
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
    mount_is_assumed: bool = False


@dataclass(frozen=True, kw_only=True, eq=False)
class CandidatePoses(FrozenArrays):
    """Possible poses of one frame, best first, as starting values of an adjustment.

    Attributes
    ----------
    frame_id
        Its name.
    center_world_m, world_from_camera
        (S, 3), (S, 3, 3).
    misfit
        (S,) misfit of each to the data from which it was made; 0 is exact.
    """

    frame_id: str
    center_world_m: Annotated[Floats, "n", 3]
    world_from_camera: Annotated[Floats, "n", 3, 3]
    misfit: Annotated[Floats, "n"]


PoseChoice = Literal["seed", "refined"]


@dataclass(frozen=True, kw_only=True, eq=False)
class GeoTags(FrozenArrays):
    """Poses of N photos in the form that other programs read.

    Attributes
    ----------
    frame_id, path
        (N,) name and path of the photo.
    pose
        (N,) pose from which the row was made.
    latitude_deg, longitude_deg, height_m
        (N,) WGS 84 of the projection centre, height above `datum`.
    datum
        Datum of the heights.
    gimbal_ypr_rad, nadir_ypr_rad
        (N, 3) yaw, pitch, roll in both conventions of geometry/motion/camera_motion.py, yaw in [0,
        2 pi).
    sigma_horizontal_m, sigma_vertical_m
        (N,) semi-major axis of the horizontal standard ellipse, and sigma of the height.
    """

    frame_id: Annotated[tuple[str, ...], "n"]
    path: tuple[str, ...]
    pose: tuple[PoseChoice, ...]
    latitude_deg: Annotated[Floats, "n"]
    longitude_deg: Annotated[Floats, "n"]
    height_m: Annotated[Floats, "n"]
    datum: HeightDatum
    gimbal_ypr_rad: Annotated[Floats, "n", 3]
    nadir_ypr_rad: Annotated[Floats, "n", 3]
    sigma_horizontal_m: Annotated[Floats, "n"]
    sigma_vertical_m: Annotated[Floats, "n"]


_UNSTATED: Floats = np.empty(0)


def make_unstated_column() -> Floats:
    """Return the placeholder for a column of NaN that the source of the poses does not provide."""
    return _UNSTATED


@dataclass(frozen=True, kw_only=True, eq=False)
class PhotoPoses(FrozenArrays):
    """Positions and perhaps attitudes of N photos, as stated by their source.

    Attributes
    ----------
    frame_id
        (N,) names of photos, each once, in the order of the names.
    latitude_deg, longitude_deg
        (N,) WGS 84, of the camera; NaN where only another source has it.
    height_m
        (N,) above `datum`; NaN where the position is.
    height_home_m
        (N,) above the take-off point; NaN where unknown.
    datum
        Datum of `height_m`.
    datum_guess
        Why this datum was assumed; empty where the source states it.
    time_utc_s
        (N,) UTC seconds since the Unix epoch, where the source itself states the exposure (not the
        camera's clock); NaN elsewhere.
    ypr_rad
        (N, 3) yaw (from north), pitch, roll, Z-Y-X, of the gimbal: x the optical axis, -z image up,
        so pitch -90 degrees is straight down; NaN where unknown.
    vehicle_ypr_rad
        (N, 3) of the vehicle, body FRD; NaN where unknown.
    sigma_horizontal_m, sigma_vertical_m, sigma_attitude_rad
        (N,) standard deviations of each axis; NaN where the source states none.
    source
        Name of the source, in words.
    """

    frame_id: Annotated[tuple[str, ...], "n"]
    latitude_deg: Annotated[Floats, "n", NAN_IS_NONE]
    longitude_deg: Annotated[Floats, "n", NAN_IS_NONE]
    height_m: Annotated[Floats, "n", NAN_IS_NONE]
    height_home_m: Annotated[Floats, "n", NAN_IS_NONE] = field(default_factory=make_unstated_column)
    datum: HeightDatum
    datum_guess: str = ""
    time_utc_s: Annotated[Floats, "n", NAN_IS_NONE] = field(default_factory=make_unstated_column)
    ypr_rad: Annotated[Floats, "n", 3, NAN_IS_NONE] = field(default_factory=make_unstated_column)
    vehicle_ypr_rad: Annotated[Floats, "n", 3, NAN_IS_NONE] = field(
        default_factory=make_unstated_column
    )
    sigma_horizontal_m: Annotated[Floats, "n", NAN_IS_NONE] = field(
        default_factory=make_unstated_column
    )
    sigma_vertical_m: Annotated[Floats, "n", NAN_IS_NONE] = field(
        default_factory=make_unstated_column
    )
    sigma_attitude_rad: Annotated[Floats, "n", NAN_IS_NONE] = field(
        default_factory=make_unstated_column
    )
    source: str

    def __post_init__(self) -> None:
        n = len(self.frame_id)
        for name, value in vars(self).copy().items():
            if value is _UNSTATED:
                shape = (n, 3) if name.endswith("ypr_rad") else (n,)
                object.__setattr__(self, name, np.full(shape, np.nan))
        super().__post_init__()

    def rows(self, index: Ints) -> PhotoPoses:
        """Return the photos at `index` (M,), in that order."""
        return replace(self, **rows_of(self, index))


@dataclass(frozen=True, kw_only=True, eq=False)
class PhotoExposures(FrozenArrays):
    """Photo poses in the local world: exposures that do not depend on a clock.

    Attributes
    ----------
    frame_id
        (N,) names.
    position_world_m
        (N, 3) of the reference point of the source.
    world_from_body
        (N, 3, 3) the vehicle, in whose axes the lever arm is given.
    world_from_gimbal
        (N, 3, 3) the gimbal: x optical axis, -z image up.
    sigma_position_m
        (N, 2) horizontal and vertical.
    sigma_attitude_rad
        (N, 2) of roll and pitch, and of yaw.
    by_mount
        (N,) True where nothing but `mount` states the attitude.
    source
        Name of the source.
    """

    frame_id: Annotated[tuple[str, ...], "n"]
    position_world_m: Annotated[Floats, "n", 3]
    world_from_body: Annotated[Floats, "n", 3, 3]
    world_from_gimbal: Annotated[Floats, "n", 3, 3]
    sigma_position_m: Annotated[Floats, "n", 2]
    sigma_attitude_rad: Annotated[Floats, "n", 2]
    by_mount: Annotated[Bools, "n"]
    source: str

    def rows_of(self, names: Iterable[str]) -> Ints:
        """Return the (n,) row of each name."""
        row = {name: k for k, name in enumerate(self.frame_id)}
        return np.array([row[name] for name in names], dtype=np.int64)


Flight = Track | PhotoExposures
"""Source in which an exposure is looked up: by its time, or by its photo."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Telemetry:
    """Seed poses, their prior for the adjustment, and the flight (or the photos' own poses).

    `correlation_s` is the range of the time over which errors of frames are correlated; None: they
    are independent.
    """

    poses: Poses
    prior: TelemetryPrior
    track: Flight
    correlation_s: tuple[float, float] | None = None
