"""What a log says of a flight a second time: velocity, the receiver's own place, stated resets."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated, Literal

from uavgram.model.arrays import Floats, FrozenArrays

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
class VelocitySamples(FrozenArrays):
    """N velocities of the vehicle.

    Attributes
    ----------
    time_boot_s
        (N,) increasing.
    ned_m_s
        (N, 3) north, east, down.
    source
        The message they come from.
    """

    time_boot_s: Annotated[Floats, "n"]
    ned_m_s: Annotated[Floats, "n", 3]
    source: str


@dataclass(frozen=True, kw_only=True, eq=False)
class TurnRateSamples(FrozenArrays):
    """N rates at which the vehicle turns, by its gyroscopes: no reset of an estimator moves them.

    Attributes
    ----------
    time_boot_s
        (N,) increasing.
    body_rad_s
        (N, 3) about the body's axes forward, right, down.
    source
        The message they come from.
    """

    time_boot_s: Annotated[Floats, "n"]
    body_rad_s: Annotated[Floats, "n", 3]
    source: str


@dataclass(frozen=True)
class EstimatorReset:
    """The autopilot's own word that its estimator began anew.

    Attributes
    ----------
    time_boot_s
        When.
    what
        In plain words, such as ``reset of the heading``.
    """

    time_boot_s: float
    what: str


@dataclass(frozen=True, kw_only=True, eq=False)
class FlightEvidence(FrozenArrays):
    """What a track can be held against, on its clock and in its world.

    Attributes
    ----------
    velocity_time_s, velocity_world_m_s
        (V,) strictly increasing UTC, (V, 3); V = 0 where the log states no velocity.
    receiver_time_s, receiver_world_m
        (R,), (R, 3) places by the receiver alone; R = 0 where the log has none beside the track's.
    turn_time_s, turn_body_rad_s
        (T,), (T, 3) rates of the vehicle's turn about its own axes; T = 0 where it states none.
    resets
        (UTC, what) of every stated reset, in the order of time.
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
    """One place where a log contradicts itself.

    Attributes
    ----------
    kind
        Of fault.
    start_s, end_s
        UTC; of a jump the two samples between which it lies.
    change
        East, north, up: of a jump what no movement explains [m], or the turn about these axes
        [rad]; of other faults how wrong the log may be from `start_s` to `end_s`, in the same
        units.
    resets
        What the autopilot itself noted then; empty where it is silent.
    """

    kind: FaultKind
    start_s: float
    end_s: float
    change: tuple[float, float, float]
    resets: tuple[str, ...] = ()

    @property
    def is_jump(self) -> bool:
        """Whether the log is right before and behind it, but for what lies between the two."""
        return self.kind in ("position-jump", "attitude-jump")

    @property
    def is_of_attitude(self) -> bool:
        """Whether it leaves directions in doubt, and not places."""
        return self.kind.startswith(("attitude", "gimbal"))

    @property
    def horizontal(self) -> float:
        """Size of the change in east and north, or of the tilt."""
        return math.hypot(*self.change[:2])

    @property
    def size(self) -> float:
        """Size of the whole change."""
        return math.hypot(*self.change)
