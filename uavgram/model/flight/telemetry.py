"""Where each frame was before any adjustment, and what that is known by."""

from __future__ import annotations

from dataclasses import dataclass

from uavgram.model.flight.photo_poses import Flight
from uavgram.model.flight.pose import Poses, TelemetryPrior


@dataclass(frozen=True, kw_only=True, eq=False)
class Telemetry:
    """Seed poses, their prior for the adjustment, and the flight (or the photos' own poses).

    `correlation_s` is the range of the time over which errors of frames go together; None: each is
    on its own.
    """

    poses: Poses
    prior: TelemetryPrior
    track: Flight
    correlation_s: tuple[float, float] | None = None
