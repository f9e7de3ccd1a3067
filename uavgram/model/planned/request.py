"""What a person asks of a plan: the schema of the section `plan:` of a scenario, with its units."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from uavgram.model.limits import require
from uavgram.model.survey.observations import MeasurementKind

Corners = tuple[tuple[float, float], ...]
"""Of a polygon: x, y in the scene's axes [m]."""

FlightPattern = Literal["single", "strip", "grid", "orbit"]
Laid = Literal["lines", "plates"]
"""What is laid out to be known: lines for a tape, or coded plates."""

MOST_CHOICES = 30
"""Heights, pitches, numbers of photos or patterns to choose from: each is flown with each other."""


@dataclass(frozen=True, kw_only=True)
class WantedMeasurement:
    """Something that shall be measured, and how well.

    Attributes
    ----------
    name, kind
        As in measure.csv.
    points
        Labels of the scenario, or places (x, y) in the scene's axes [m].
    sigma_m
        Standard deviation that is good enough, in the unit of the kind; None: as good as may be.
    parameters
        Numbers that the kind needs, as in measure.csv.
    """

    name: str
    kind: MeasurementKind = "distance"
    points: tuple[str | tuple[float, float], ...]
    sigma_m: float | None = None
    parameters: tuple[tuple[str, float], ...] = ()

    def __post_init__(self) -> None:
        require(self.sigma_m is None or self.sigma_m > 0, "sigma_m must be greater than 0")


@dataclass(frozen=True, kw_only=True)
class PlanRequest:
    """What shall be planned.

    Attributes
    ----------
    area
        What shall be measured: corners (x, y) in the scene's axes [m], or a GeoJSON or KML file
        with a polygon.
    no_go
        Where neither a tape nor the drone may pass: polygons as `area`, or a file.
    longest_tape_m, shortest_line_m
        Between which lengths a reference line lies.
    lay
        What is laid out: reference lines, coded plates of the scenario's size, or the better one.
    lines
        How many reference lines, or plates; None: as few as reach what is wanted.
    most_lines
        The most that the program may choose.
    wanted
        What shall be measured; nothing: lengths anywhere in the area.
    patterns
        Flights to choose from.
    heights_m, pitches_deg, frames
        Heights above the ground, gimbal pitches (-90 straight down) and numbers of photos to choose
        from; nothing: the program's own.
    max_height_m, min_height_m
        Above the ground.
    battery_min
        Time that one battery flies, all in.
    speed_m_s, seconds_per_photo
        From photo to photo; hovering at each.
    deviation_m, deviation_deg
        Standard deviations of how the drone departs from the plan: what lies close to a photo's
        edge may be missing in it.
    roughness_m
        By how much the ground departs from a plane, a standard deviation.
    robust
        Whether the layout must bear the loss of any one line.
    """

    area: str | Corners
    no_go: str | tuple[Corners, ...] = ()
    longest_tape_m: float = 15.0
    shortest_line_m: float = 3.0
    lay: Literal["lines", "plates", "either"] = "lines"
    lines: int | None = None
    most_lines: int = 8
    wanted: tuple[WantedMeasurement, ...] = ()
    patterns: tuple[FlightPattern, ...] = ("single", "strip")
    heights_m: tuple[float, ...] = ()
    pitches_deg: tuple[float, ...] = ()
    frames: tuple[int, ...] = ()
    max_height_m: float = 120.0
    min_height_m: float = 10.0
    battery_min: float = 20.0
    speed_m_s: float = 4.0
    seconds_per_photo: float = 4.0
    deviation_m: float = 2.0
    deviation_deg: float = 1.8
    roughness_m: float = 0.05
    robust: bool = False

    def __post_init__(self) -> None:
        positive = ("max_height_m", "min_height_m", "battery_min", "speed_m_s")
        for name in (*positive, "shortest_line_m", "longest_tape_m"):
            require(getattr(self, name) > 0, f"{name} must be greater than 0")
        for name in ("deviation_m", "deviation_deg", "roughness_m", "seconds_per_photo"):
            require(getattr(self, name) >= 0, f"{name} must not be negative")
        longest, shortest = self.longest_tape_m, self.shortest_line_m
        require(
            longest >= shortest,
            f"longest_tape_m ({longest:g}) must not be less than shortest_line_m ({shortest:g}): "
            f"add `shortest_line_m: {longest / 2:g}` for a tape as short as that",
        )
        require(self.lines is None or 0 <= self.lines <= 30, "lines must lie between 0 and 30")
        require(1 <= self.most_lines <= 30, "most_lines must lie between 1 and 30")
        for name in ("patterns", "heights_m", "pitches_deg", "frames"):
            count = len(getattr(self, name))
            require(count <= MOST_CHOICES, f"{name} may name at most {MOST_CHOICES} (got {count})")
        require(bool(self.patterns), "patterns must name at least one")
        require(
            all(-90 <= pitch <= -20 for pitch in self.pitches_deg),
            "pitches_deg must lie between -90 (straight down) and -20",
        )
        require(all(1 <= n <= 100 for n in self.frames), "frames must lie between 1 and 100")
        require(all(h > 0 for h in self.heights_m), "heights_m must be greater than 0")
        names = [wanted.name for wanted in self.wanted]
        twice = sorted({name for name in names if names.count(name) > 1})
        require(not twice, f"wanted: names given twice: {', '.join(twice)}")
