"""Flight log: neutral tables for each boot, redundant measurements for checks, and a summary."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Annotated, Literal

import numpy as np

from uavgram.model.arrays import NAN_IS_NONE, Bools, Floats, FrozenArrays, Ints
from uavgram.model.message import Message

FaultKind = Literal[
    "position-jump",
    "attitude-jump",
    "position-frozen",
    "attitude-frozen",
    "position-gap",
    "attitude-gap",
    "gimbal-gap",
    "receiver-apart",
]


@dataclass(frozen=True, kw_only=True, eq=False)
class Samples(FrozenArrays):
    """N samples of a quantity in a log.

    Attributes
    ----------
    time_boot_s
        (N,) increasing.
    source
        Log message of these samples.
    """

    time_boot_s: Annotated[Floats, "n"]
    source: str


@dataclass(frozen=True, kw_only=True, eq=False)
class VelocitySamples(Samples):
    """N velocities of the vehicle.

    Attributes
    ----------
    time_boot_s
        (N,) increasing.
    ned_m_s
        (N, 3) north, east, down.
    source
        Log message of these samples.
    """

    ned_m_s: Annotated[Floats, "n", 3]


@dataclass(frozen=True, kw_only=True, eq=False)
class TurnRateSamples(Samples):
    """N angular rates of the vehicle from its gyroscopes, unaffected by resets of an estimator.

    Attributes
    ----------
    time_boot_s
        (N,) increasing.
    body_rad_s
        (N, 3) about the body's axes forward, right, down.
    source
        Log message of these samples.
    """

    body_rad_s: Annotated[Floats, "n", 3]


@dataclass(frozen=True)
class EstimatorReset:
    """Reset of its estimator, as reported by the autopilot.

    Attributes
    ----------
    time_boot_s
        Time of the reset.
    what
        In plain words, such as ``reset of the heading``.
    """

    time_boot_s: float
    what: str


@dataclass(frozen=True, kw_only=True, eq=False)
class FlightEvidence(FrozenArrays):
    """Redundant measurements to check a track, in its clock and its world.

    Attributes
    ----------
    velocity_time_s, velocity_world_m_s
        (V,) strictly increasing UTC, (V, 3); V = 0 where the log has no velocity.
    receiver_time_s, receiver_world_m
        (R,), (R, 3) positions by the receiver alone; R = 0 where the log has only the track's
        positions.
    turn_time_s, turn_body_rad_s
        (T,), (T, 3) angular rates of the vehicle about its own axes; T = 0 where the log has none.
    resets
        (UTC, what) of every reported reset, in the order of time.
    """

    velocity_time_s: Annotated[Floats, "v"]
    velocity_world_m_s: Annotated[Floats, "v", 3]
    receiver_time_s: Annotated[Floats, "r"]
    receiver_world_m: Annotated[Floats, "r", 3]
    turn_time_s: Annotated[Floats, "t"]
    turn_body_rad_s: Annotated[Floats, "t", 3]
    resets: tuple[tuple[float, str], ...]


@dataclass(frozen=True, kw_only=True)
class LogFault:
    """One contradiction within a log.

    Attributes
    ----------
    kind
        Kind of fault.
    start_s, end_s
        UTC; for a jump, the two samples before and after it.
    change
        East, north, up: for a jump the displacement that no movement explains [m], or the rotation
        about these axes [rad]; for other faults the possible error of the log from `start_s` to
        `end_s`, in the same units.
    resets
        Resets reported by the autopilot at that time; empty where there are none.
    """

    kind: FaultKind
    start_s: float
    end_s: float
    change: tuple[float, float, float]
    resets: tuple[str, ...] = ()

    @property
    def is_jump(self) -> bool:
        """Return whether the log is right on either side of it, but for the difference."""
        return self.kind in ("position-jump", "attitude-jump")

    @property
    def is_of_attitude(self) -> bool:
        """Return whether it makes directions uncertain, instead of positions."""
        return self.kind.startswith(("attitude", "gimbal"))

    @property
    def horizontal(self) -> float:
        """Size of the change in east and north, or of the tilt."""
        return math.hypot(*self.change[:2])

    @property
    def size(self) -> float:
        """Size of the whole change."""
        return math.hypot(*self.change)


HeightDatum = Literal["msl", "ellipsoid"]
LogKind = Literal["dataflash", "tlog", "ulog"]


@dataclass(frozen=True, kw_only=True, eq=False)
class PositionSamples(Samples):
    """N positions of the vehicle.

    Attributes
    ----------
    time_boot_s
        (N,) increasing, seconds since this boot.
    latitude_deg, longitude_deg
        (N,) WGS 84.
    height_m
        (N,) above `datum`.
    height_home_m
        (N,) above home in the log; NaN where it has none.
    datum
        Datum of `height_m`.
    source
        Log message of these samples, such as ``POS`` or ``GLOBAL_POSITION_INT``.
    """

    latitude_deg: Annotated[Floats, "n"]
    longitude_deg: Annotated[Floats, "n"]
    height_m: Annotated[Floats, "n"]
    height_home_m: Annotated[Floats, "n", NAN_IS_NONE]
    datum: HeightDatum


@dataclass(frozen=True, kw_only=True, eq=False)
class AttitudeSamples(Samples):
    """N attitudes of the vehicle.

    Attributes
    ----------
    time_boot_s
        (N,) increasing.
    ned_from_body_xyzw
        (N, 4) unit quaternions, body FRD to local NED.
    source
        Log message of these samples.
    """

    ned_from_body_xyzw: Annotated[Floats, "n", 4]


@dataclass(frozen=True, kw_only=True, eq=False)
class GimbalSamples(Samples):
    """N attitudes of the gimbal: roll and pitch earth-referenced, yaw relative to `yaw_frame`.

    Attributes
    ----------
    time_boot_s
        (N,) increasing.
    roll_rad, pitch_rad, yaw_rad
        (N,) Z-Y-X angles; x of the gimbal's frame is the optical axis, image up its -z.
    yaw_frame
        ``earth``: from north; ``vehicle``: from the vehicle's heading, whose yaw (only) is to be
        added.
    source
        Log message of these samples.
    """

    roll_rad: Annotated[Floats, "n"]
    pitch_rad: Annotated[Floats, "n"]
    yaw_rad: Annotated[Floats, "n"]
    yaw_frame: Literal["earth", "vehicle"]


@dataclass(frozen=True, kw_only=True, eq=False)
class EstimatorSigmas(Samples):
    """N standard deviations reported by the estimator; NaN where it reports none.

    Attributes
    ----------
    time_boot_s
        (N,) increasing.
    horizontal_m, vertical_m
        (N,) of position, one axis.
    tilt_rad, yaw_rad
        (N,) of attitude.
    is_fixed
        (N,) whether the receiver had a fixed RTK solution. Empty: never.
    source
        Log messages of these samples.
    """

    horizontal_m: Annotated[Floats, "n", NAN_IS_NONE]
    vertical_m: Annotated[Floats, "n", NAN_IS_NONE]
    tilt_rad: Annotated[Floats, "n", NAN_IS_NONE]
    yaw_rad: Annotated[Floats, "n", NAN_IS_NONE]
    is_fixed: Annotated[Bools, "n"] = field(default_factory=lambda: np.zeros(0, np.bool_))

    def __post_init__(self) -> None:
        if not len(self.is_fixed):
            object.__setattr__(self, "is_fixed", np.zeros(len(self.time_boot_s), np.bool_))
        super().__post_init__()


@dataclass(frozen=True, kw_only=True, eq=False)
class ReceptionSamples(Samples):
    """N reports of satellite reception by the receiver; NaN where it reports none.

    Attributes
    ----------
    time_boot_s
        (N,) increasing.
    satellites
        (N,) number of satellites in use.
    hdop
        (N,) horizontal dilution of precision, the factor from range to position errors: below 1 is
        good.
    source
        Log message of these samples.
    """

    satellites: Annotated[Floats, "n", NAN_IS_NONE]
    hdop: Annotated[Floats, "n", NAN_IS_NONE]


@dataclass(frozen=True, kw_only=True, eq=False)
class CameraEvents(Samples):
    """N exposures recorded in the log.

    Attributes
    ----------
    time_boot_s
        (N,) of the exposure (feedback where there is one, else the command).
    image_number
        (N,) the autopilot's own count; -1 where it has none.
    confirmed
        (N,) 1.0 where the camera's feedback confirms it, 0.0 where only the trigger is known.
    source
        Log messages of these samples, such as ``CAM`` or ``TRIG+CAM``.
    instant
        Meaning of the times of confirmed events: ``feedback``, stamped by a wire from the camera
        (the exposure itself); ``command``, the order of the autopilot, earlier by the shutter lag.
    repeated
        Image numbers that occur more than once in the log, each once and sorted.
    lost
        Image numbers that are missing between the first and the last, sorted: shots that the
        autopilot counted but this log does not contain.
    """

    image_number: Annotated[Ints, "n"]
    confirmed: Annotated[Floats, "n"]
    instant: Literal["feedback", "command"] = "command"
    repeated: tuple[int, ...] = ()
    lost: tuple[int, ...] = ()


@dataclass(frozen=True, kw_only=True, eq=False)
class ClockSamples(Samples):
    """N pairs of boot time and UTC.

    Attributes
    ----------
    time_boot_s, utc_s
        (N,) seconds since boot; seconds since the Unix epoch.
    source
        ``gps`` (DataFlash GPS week and milliseconds), ``system_time``, or ``receive`` (the ground
        station's clock: late by an unknown, varying delay).
    """

    utc_s: Annotated[Floats, "n"]
    source: Literal["gps", "system_time", "receive"]


@dataclass(frozen=True, kw_only=True, eq=False)
class HomeSamples(Samples):
    """N home positions, each valid from its time on.

    Attributes
    ----------
    time_boot_s, latitude_deg, longitude_deg, height_m
        (N,); height above `datum`.
    datum
        Datum of `height_m`.
    source
        Log message of these samples.
    """

    latitude_deg: Annotated[Floats, "n"]
    longitude_deg: Annotated[Floats, "n"]
    height_m: Annotated[Floats, "n"]
    datum: HeightDatum


@dataclass(frozen=True, kw_only=True, eq=False)
class Boot:
    """One power-up of one autopilot: all of its tables share one boot clock.

    A table that is not in the log is empty in `clocks` and `resets`, and None elsewhere. `receiver`
    has the receiver's positions where `positions` come from another source.
    """

    positions: PositionSamples | None
    attitudes: AttitudeSamples | None
    gimbal: GimbalSamples | None
    sigmas: EstimatorSigmas | None
    events: CameraEvents | None
    home: HomeSamples | None
    clocks: tuple[ClockSamples, ...]
    velocities: VelocitySamples | None = None
    turn_rates: TurnRateSamples | None = None
    receiver: PositionSamples | None = None
    reception: ReceptionSamples | None = None
    resets: tuple[EstimatorReset, ...] = ()


@dataclass(frozen=True, kw_only=True)
class MessageCount:
    """Number of messages of one type in a log; first and last time since boot [s]."""

    name: str
    count: int
    first_s: float
    last_s: float


@dataclass(frozen=True, kw_only=True, eq=False)
class FlightLog:
    """Contents of a flight log.

    Attributes
    ----------
    path, kind
        The file; ``dataflash``, ``tlog`` or ``ulog``.
    vehicle, firmware
        As stated in the log; empty where it does not.
    boots
        At least one, once its messages are read.
    messages
        Numbers of messages in the file by type, sorted by name.
    undulation_m
        Geoid height above the ellipsoid from the log itself; NaN where it has none.
    notes
        Irregularities of the file (bad bytes skipped, a truncated tail...), in plain words.
    """

    path: str
    kind: LogKind
    vehicle: str
    firmware: str
    boots: tuple[Boot, ...] = ()
    messages: tuple[MessageCount, ...]
    undulation_m: float = float("nan")
    notes: tuple[str, ...]


@dataclass(frozen=True, kw_only=True, eq=False)
class BootClock:
    """Linear relation of one boot's clock to UTC: ``utc = offset_s + rate * time_boot``.

    Attributes
    ----------
    offset_s, rate
        Parameters of the line; rate is 1 + drift.
    sigma_s
        Standard deviation of a converted time, common to the boot.
    source
        Clock samples from which it was made.
    drift_sigma
        Standard deviation of the rate, about the middle of the samples; NaN where not stated.
    scatter_s
        Robust standard deviation of one sample about the line; NaN where not stated.
    """

    offset_s: float
    rate: float
    sigma_s: float
    source: str
    drift_sigma: float = float("nan")
    scatter_s: float = float("nan")


@dataclass(frozen=True, kw_only=True, eq=False)
class Track(FrozenArrays):
    """Flight in the local ENU world and in UTC, ready for interpolation.

    Attributes
    ----------
    position_time_s
        (N,) strictly increasing UTC seconds since the Unix epoch.
    position_world_m
        (N, 3) of the autopilot's reference point.
    attitude_time_s
        (M,) strictly increasing.
    world_from_body_xyzw
        (M, 4) unit quaternions, body FRD to ENU.
    gimbal_time_s
        (L,) strictly increasing; L = 0 where the camera is fixed to the body.
    world_from_gimbal_xyzw
        (L, 4) unit quaternions, gimbal (x optical axis, -z image up) to ENU.
    sigma_time_s
        (S,) strictly increasing; S >= 1.
    sigma_position_m
        (S, 2) horizontal and vertical standard deviations of one position.
    sigma_attitude_rad
        (S, 2) of roll and pitch, and of yaw.
    source
        Log messages from which it is made.
    """

    position_time_s: Annotated[Floats, "n"]
    position_world_m: Annotated[Floats, "n", 3]
    attitude_time_s: Annotated[Floats, "m"]
    world_from_body_xyzw: Annotated[Floats, "m", 4]
    gimbal_time_s: Annotated[Floats, "k"]
    world_from_gimbal_xyzw: Annotated[Floats, "k", 4]
    sigma_time_s: Annotated[Floats, "s"]
    sigma_position_m: Annotated[Floats, "s", 2]
    sigma_attitude_rad: Annotated[Floats, "s", 2]
    source: str


@dataclass(frozen=True, kw_only=True, eq=False)
class BootSummary(FrozenArrays):
    """Summary of one boot with its checks.

    Attributes
    ----------
    boot
        Its tables.
    clock
        Its relation to UTC; None where the log has none.
    span_utc
        First and last position, for people; empty without a clock.
    track_m
        (N, 2) positions, metres east and north of the first.
    path_m
        Length of the path over ground.
    clock_time_s, clock_residual_s
        (C,) boot times of the clock samples, and their deviations from the line (positive: ahead).
    event_track_m
        (E, 2) positions of the camera events on the track; NaN outside of it.
    home_moves_m
        Largest distance of home from its first position.
    messages
        Irregularities of the clock, the track, the events.
    """

    boot: Boot
    clock: BootClock | None
    span_utc: tuple[str, str]
    track_m: Annotated[Floats, "n", 2]
    path_m: float
    clock_time_s: Annotated[Floats, "c"]
    clock_residual_s: Annotated[Floats, "c"]
    event_track_m: Annotated[Floats, "e", 2, NAN_IS_NONE]
    home_moves_m: float
    messages: tuple[Message, ...]


@dataclass(frozen=True, kw_only=True, eq=False)
class LogSummary:
    """A flight log and the summaries of its boots."""

    log: FlightLog
    boots: tuple[BootSummary, ...]


@dataclass(frozen=True, kw_only=True, eq=False)
class SimulatedLog(FrozenArrays):
    """Recording of the autopilot, with its errors.

    Attributes
    ----------
    boot_utc_s
        UTC of boot, seconds since the Unix epoch; all times below are seconds since boot.
    home_geodetic
        (3,) latitude, longitude [deg], height above mean sea level [m].
    undulation_m
        Geoid above ellipsoid.
    position_time_s, position_geodetic, velocity_ned_m_s
        (N,), (N, 3) as home, (N, 3).
    attitude_time_s, attitude_rpy_rad
        (M,), (M, 3) roll, pitch, yaw, body FRD to NED.
    gimbal_time_s, gimbal_rpy_rad
        (L,), (L, 3) roll and pitch from the earth, yaw from the vehicle's heading.
    gps_time_s, gps_geodetic, gps_accuracy_m
        (G,), (G, 3), (G, 2) horizontal and vertical, as stated by the receiver.
    event_time_s, event_geodetic, event_rpy_rad
        (E,), (E, 3), (E, 3) exposures; attitude of the vehicle.
    """

    boot_utc_s: float
    home_geodetic: Annotated[Floats, 3]
    undulation_m: float
    position_time_s: Annotated[Floats, "n"]
    position_geodetic: Annotated[Floats, "n", 3]
    velocity_ned_m_s: Annotated[Floats, "n", 3]
    attitude_time_s: Annotated[Floats, "m"]
    attitude_rpy_rad: Annotated[Floats, "m", 3]
    gimbal_time_s: Annotated[Floats, "k"]
    gimbal_rpy_rad: Annotated[Floats, "k", 3]
    gps_time_s: Annotated[Floats, "g"]
    gps_geodetic: Annotated[Floats, "g", 3]
    gps_accuracy_m: Annotated[Floats, "g", 2]
    event_time_s: Annotated[Floats, "e"]
    event_geodetic: Annotated[Floats, "e", 3]
    event_rpy_rad: Annotated[Floats, "e", 3]
