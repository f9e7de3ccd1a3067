"""A plan: what to fly, what to lay out, and what will then be known how well."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Annotated, Literal

from uavgram.model.arrays import Floats, FrozenArrays
from uavgram.model.camera.calibration import Calibration
from uavgram.model.message import Message
from uavgram.model.planned.parts import (
    AccuracyGrid,
    PlannedFrames,
    PlannedLines,
    PlannedMeasurements,
    PlannedPlates,
    PlannedPoints,
)
from uavgram.model.planned.request import FlightPattern

ChosenBy = Literal["mean", "shares"]
"""What a layout makes smallest: the mean of lengths' sigmas, or the mean of all sigmas as shares of
what is wanted of them. Where nobody states that, lengths are shares of their mean sigma, and values
of other units of their own, with the first few lines."""


@dataclass(frozen=True, kw_only=True)
class PlannedSite:
    """Where the world's origin lies: WGS 84, height above mean sea level, geoid above ellipsoid.

    `ground_height_m` is that of the ground at the middle of the area, above the origin.
    """

    latitude_deg: float
    longitude_deg: float
    height_msl_m: float
    undulation_m: float = 0.0
    ground_height_m: float = 0.0


@dataclass(frozen=True, kw_only=True)
class FlightFacts:
    """The flight in numbers.

    Attributes
    ----------
    pattern
        How the photos lie.
    height_m
        Above the ground at the middle of the area.
    gimbal_pitch_deg
        -90 looks straight down.
    speed_m_s, seconds_per_photo
        From photo to photo; hovering at each.
    path_m, duration_s, battery_s
        Way from photo to photo; time from take-off to landing; what the battery gives.
    max_height_m
        Above the ground, that must not be passed.
    ground_sample_m
        What a pixel in the middle of a photo is on the ground.
    """

    pattern: FlightPattern
    height_m: float
    gimbal_pitch_deg: float
    speed_m_s: float
    seconds_per_photo: float
    path_m: float
    duration_s: float
    battery_s: float
    max_height_m: float
    ground_sample_m: float


@dataclass(frozen=True, kw_only=True)
class Assumptions:
    """What the prediction rests on: standard deviations.

    Attributes
    ----------
    telemetry
        Class of the log: ``consumer``, ``rtk``, ``ppk``, ``none``.
    pick_sigma_px, tape_sigma_m, tape_scale_sigma, roughness_m
        Of picks, tape readings, what all readings of the tape have in common, the ground about its
        plane.
    deviation_m, deviation_deg
        How the drone departs from the plan.
    """

    telemetry: str
    pick_sigma_px: float
    tape_sigma_m: float
    tape_scale_sigma: float
    roughness_m: float
    deviation_m: float
    deviation_deg: float


@dataclass(frozen=True, kw_only=True)
class Gain:
    """What another choice would bring.

    Attributes
    ----------
    what
        In words: ``one more line``.
    mean_sigma
        `FlightPlanned.mean_sigma` then.
    worst_without
        The same if the line is lost that matters most then; None of choices that are not about
        that, or where nothing holds the survey then.
    """

    what: str
    mean_sigma: float
    worst_without: float | None = None


@dataclass(frozen=True, kw_only=True, eq=False)
class FlightPlanned(FrozenArrays):
    """A plan, completely.

    Attributes
    ----------
    name
        Of the scenario.
    site
        Of the world's axes (east, north, up).
    camera
        With its covariance.
    drone
        Its name, empty where it is not known.
    area_world_m
        (V, 3) corners on the ground, counterclockwise from above, not closed.
    no_go_world_m
        Polygons (v, 3) likewise.
    flight, assumptions
        The flight in numbers; what the prediction rests on.
    frames, lines, plates, points, measurements, grid
        See each.
    mean_sigma
        Plain mean of the predicted standard deviations of the lengths that are wanted (of the map's
        where nothing else is; of all values where none is a length).
    chosen_by
        What the layout makes smallest, which is `mean_sigma` only where it is ``mean``.
    gains
        What one more line or photo would bring, and a layout that bears a loss would cost.
    messages
        What to know before flying.
    """

    name: str
    site: PlannedSite
    camera: Calibration
    drone: str = ""
    area_world_m: Annotated[Floats, "v", 3]
    no_go_world_m: tuple[Floats, ...] = ()
    flight: FlightFacts
    assumptions: Assumptions
    frames: PlannedFrames
    lines: PlannedLines
    plates: PlannedPlates = field(default_factory=PlannedPlates)
    points: PlannedPoints
    measurements: PlannedMeasurements
    grid: AccuracyGrid
    mean_sigma: float
    chosen_by: ChosenBy = "mean"
    gains: tuple[Gain, ...] = ()
    messages: tuple[Message, ...] = ()

    @property
    def laid(self) -> PlannedLines | PlannedPlates:
        """What is laid out to be known: plates, or lines where there are none."""
        return self.plates if self.plates.name else self.lines
