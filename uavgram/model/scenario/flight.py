"""How a simulated flight is flown: two strips as in the demo, or another pattern."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import datetime
from typing import Literal

from uavgram.model.scenario.checks import require, require_sizes

MANY = 10
"""Exposures of strips, whose gaps then fit camera events in one way only."""

Pattern = Literal["strips", "strip", "grid", "orbit", "single", "poses"]


def _is_instant(text: str) -> bool:
    """Whether a text is a date and a time with its zone."""
    try:
        return datetime.fromisoformat(text).tzinfo is not None
    except ValueError:
        return False


@dataclass(frozen=True, kw_only=True)
class Station:
    """A place to photograph from, hovering.

    Attributes
    ----------
    x_m, y_m
        Scene axes.
    height_m
        Above home.
    heading_deg
        Where the vehicle's nose points, and the image's top with it: from the scene's x axis,
        counterclockwise.
    pitch_deg
        Of the optical axis, -90 straight down.
    """

    x_m: float
    y_m: float
    height_m: float
    heading_deg: float = 0.0
    pitch_deg: float = -90.0


@dataclass(frozen=True, kw_only=True)
class FlightPlan:
    """Photos from the air, by default of two strips along the road, there and back, nose first.

    Attributes
    ----------
    pattern
        ``strips``: two along the scene's x axis, one on each side; ``strip``: one over it;
        ``grid``: `grid_strips` along it and as many across; ``orbit``: `frames` photos on a circle
        that look at its middle; ``single``: one photo of the scene's middle; ``poses``: those of
        `poses`.
    start_utc
        ISO 8601 with its zone: when the recording starts, 8 s before take-off.
    boot_s
        Autopilot's time since boot at that moment.
    height_m
        Above home.
    strip_offset_m, strip_half_length_m
        The strips lie that far beside the scene's axis, and twice as far apart; photos are spread
        over twice that length.
    photos_per_strip
        Exposures on each strip.
    grid_strips
        Of a grid, in each direction.
    frames, radius_m
        Of an orbit.
    poses
        Places of the photos, where the pattern is ``poses``.
    trigger_jitter_m
        Half range of each exposure's place along the strip (uniform).
    wobble_m, tilt_wobble_deg, gimbal_wobble_deg
        Sigmas of the true motion about the plan: position, body roll and pitch, gimbal.
    gimbal_pitch_deg
        Of the optical axis, -90 straight down.
    """

    pattern: Pattern = "strips"
    start_utc: str = "2026-05-09T13:05:00Z"
    boot_s: float = 84.5
    height_m: float = 31.6
    speed_m_s: float = 4.5
    strip_offset_m: float = 4.0
    strip_half_length_m: float = 20.0
    photos_per_strip: int = 7
    grid_strips: int = 3
    frames: int = 8
    radius_m: float = 20.0
    poses: tuple[Station, ...] = ()
    trigger_jitter_m: float = 0.5
    wobble_m: float = 0.15
    tilt_wobble_deg: float = 0.6
    gimbal_pitch_deg: float = -80.0
    gimbal_wobble_deg: float = 0.4

    def __post_init__(self) -> None:
        for name in ("height_m", "speed_m_s", "strip_half_length_m", "radius_m"):
            require(getattr(self, name) > 0, f"{name} must be greater than 0")
        require(self.photos_per_strip >= 2, "photos_per_strip must be at least 2")
        require(1 <= self.grid_strips <= 50, "grid_strips must lie between 1 and 50")
        require(2 <= self.frames <= 500, "frames must lie between 2 and 500")
        require(-90 <= self.gimbal_pitch_deg < -30, "gimbal_pitch_deg must lie in [-90, -30)")
        require_sizes(self, "wobble_m", "tilt_wobble_deg", "gimbal_wobble_deg", "trigger_jitter_m")
        require(_is_instant(self.start_utc), f"start_utc must be such as {FlightPlan.start_utc}")
        stated = self.pattern == "poses"
        require(
            bool(self.poses) == stated, "poses must be given where pattern is poses, only there"
        )

    @property
    def is_hovering(self) -> bool:
        """Whether photos are taken at rest, one every few seconds."""
        return self.pattern in {"orbit", "single", "poses"}

    @property
    def tells_clock(self) -> bool:
        """Whether its exposures are so many and uneven that the log tells the camera's clock."""
        return self.photo_count >= MANY and not self.is_hovering

    @property
    def photo_count(self) -> int:
        """Exposures of the flight."""
        return {
            "strips": 2 * self.photos_per_strip,
            "strip": self.photos_per_strip,
            "grid": 2 * self.grid_strips * self.photos_per_strip,
            "orbit": self.frames,
            "single": 1,
            "poses": len(self.poses),
        }[self.pattern]
