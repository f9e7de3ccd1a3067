"""A planned flight as an autopilot flies it: stops in the air, and what not to fly into."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Literal

from uavgram.model.arrays import Floats, freeze

Autopilot = Literal["ardupilot", "px4"]
"""Whose commands a mission is written in: they take photos and turn by different ones."""

HeightFrame = Literal["relative", "terrain"]
"""What heights of stops are above: the place of take-off, or the ground below each stop."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Mission:
    """Where to stop, in the order of flight, and to take one photo at each stop.

    Attributes
    ----------
    name
        Of the plan.
    autopilot
        Whose commands are used.
    home
        Latitude [deg], longitude [deg], height above mean sea level [m] of the place of take-off.
    height_frame
        What `height_m` is above.
    latitude_deg, longitude_deg
        (F,) of the stops, WGS 84.
    height_m
        (F,) of the stops.
    heading_deg
        (F,) of the drone's nose, from true north, clockwise, [0, 360).
    gimbal_pitch_deg
        (F,) of the camera's axis: 0 forward, -90 straight down.
    speed_m_s
        From stop to stop.
    hold_s
        To hover at each stop before the photo, until drone and gimbal are at rest.
    no_go
        Rings (v, 2) of latitude and longitude [deg], not closed.
    """

    name: str
    autopilot: Autopilot
    home: tuple[float, float, float]
    height_frame: HeightFrame
    latitude_deg: Annotated[Floats, "f"]
    longitude_deg: Annotated[Floats, "f"]
    height_m: Annotated[Floats, "f"]
    heading_deg: Annotated[Floats, "f"]
    gimbal_pitch_deg: Annotated[Floats, "f"]
    speed_m_s: float
    hold_s: float
    no_go: tuple[Floats, ...]

    def __post_init__(self) -> None:
        if not (self.speed_m_s > 0 and self.hold_s >= 0):
            raise ValueError("speed_m_s must be positive and hold_s not negative")
        freeze(self)
        for ring in self.no_go:
            ring.setflags(write=False)
