"""Photos as files, frames with their times of exposure, and pairs of photos and camera events."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Literal

from uavgram.model.arrays import NAN_IS_NONE, Bools, Floats, FrozenArrays, Ints

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
