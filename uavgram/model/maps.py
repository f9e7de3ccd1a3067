"""Maps and plans: layers, rasters, sheets, profiles and missions."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Annotated, Literal

import numpy as np

from uavgram.model.arrays import Floats, FrozenArrays, freeze
from uavgram.model.flight.log import HeightDatum

ShapeKind = Literal["point", "line", "polygon"]
Attribute = tuple[str, ...] | tuple[float, ...]


HIDDEN = ("footprints", "ellipses_95")
"""Layers that files hide at first; the ellipses are metres wide by the receiver's bias."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Layer:
    """Shapes of one kind with the same attributes.

    Attributes
    ----------
    name
        Such as ``measurements``; plain letters, as files and tables name it.
    kind
        What every shape is.
    vertices_m
        N arrays (v, 3) of east, north, up; v is 1 for a point; a polygon is not closed and goes
        counterclockwise seen from above; v = 0 where a shape has no place.
    attributes
        Name to N values: text or numbers, NaN where there is none. Names carry the unit.
    above_ground_m
        N arrays (v,) of how high each vertex stands over the ground; left out where all lie on it.
    """

    name: str
    kind: ShapeKind
    vertices_m: tuple[Floats, ...]
    attributes: dict[str, Attribute]
    above_ground_m: tuple[Floats, ...] = ()

    def __post_init__(self) -> None:
        count = len(self.vertices_m)
        for vertices in self.vertices_m:
            if vertices.ndim != 2 or vertices.shape[1] != 3 or not np.isfinite(vertices).all():
                raise ValueError(f"layer {self.name!r}: vertices must be finite, (v, 3)")
            vertices.setflags(write=False)
        for key, values in self.attributes.items():
            if len(values) != count:
                raise ValueError(f"layer {self.name!r}: {len(values)} {key} for {count} shapes")

    def __len__(self) -> int:
        """Return the number of shapes."""
        return len(self.vertices_m)


def placed(shapes: tuple[Floats, ...], place: Callable[[Floats], Floats]) -> tuple[Floats, ...]:
    """Vertices (v, 3) of shapes in other coordinates: all are placed in one call."""
    counts = [len(vertices) for vertices in shapes]
    if not sum(counts):
        return shapes
    return tuple(np.split(place(np.concatenate(shapes)), np.cumsum(counts)[:-1]))


@dataclass(frozen=True, kw_only=True, eq=False)
class Features:
    """A survey as layers, and where it lies.

    Attributes
    ----------
    name
        Of the project.
    layers
        In drawing order: what is drawn last lies on top.
    origin
        Latitude [deg], longitude [deg], height [m] of the local zero; None where nothing ties the
        survey to the earth.
    height_datum
        What the origin's height is above.
    crs
        Projected coordinate system for maps, such as ``EPSG:32756``; None without an origin.
    profiles
        Drawings of the measured profiles.
    """

    name: str
    layers: tuple[Layer, ...]
    origin: tuple[float, float, float] | None
    height_datum: HeightDatum
    crs: str | None
    profiles: tuple[ProfileSheet, ...] = ()

    def layer(self, name: str) -> Layer:
        """Return the layer of that name."""
        return next(layer for layer in self.layers if layer.name == name)


@dataclass(frozen=True, kw_only=True)
class GroundRaster:
    """North up, square pixels; row 0 is the northernmost.

    Attributes
    ----------
    west_m, north_m
        Outer corner of pixel [0, 0], in `crs`, or in local metres where that is None.
    pixel_m
        Edge of a pixel.
    width, height
        In pixels.
    crs
        Projected coordinate system; None: local east and north.
    """

    west_m: float
    north_m: float
    pixel_m: float
    width: int
    height: int
    crs: str | None

    def centers(self, columns: Floats, rows: Floats) -> Floats:
        """(len(rows), len(columns), 2) east and north of pixel centres; fractions are allowed."""
        east = self.west_m + (np.asarray(columns, np.float64) + 0.5) * self.pixel_m
        north = self.north_m - (np.asarray(rows, np.float64) + 0.5) * self.pixel_m
        return np.stack(np.meshgrid(east, north), axis=-1)

    def coarser(self, factor: int) -> GroundRaster:
        """The same ground with pixels `factor` times as large, the last ones reaching over."""
        return GroundRaster(
            west_m=self.west_m,
            north_m=self.north_m,
            pixel_m=self.pixel_m * factor,
            width=-(-self.width // factor),
            height=-(-self.height // factor),
            crs=self.crs,
        )


@dataclass(frozen=True, kw_only=True, eq=False)
class ProfileSheet(FrozenArrays):
    """Points along a line in their order, and axes with round numbers.

    Attributes
    ----------
    name
        Of the profile.
    label
        (N,) names of the points.
    station_m, height_m, ground_m
        (N,) along the line from its first point; heights of point and ground over the first point.
    station_sigma_m, height_sigma_m, ground_sigma_m
        (N,) their standard deviations.
    station_ticks_m, height_ticks_m
        Round numbers; first and last are the ends of the axes.
    exaggeration
        Heights are drawn so many times larger than lengths.
    """

    name: str
    label: Annotated[tuple[str, ...], "n"]
    station_m: Annotated[Floats, "n"]
    height_m: Annotated[Floats, "n"]
    ground_m: Annotated[Floats, "n"]
    station_sigma_m: Annotated[Floats, "n"]
    height_sigma_m: Annotated[Floats, "n"]
    ground_sigma_m: Annotated[Floats, "n"]
    station_ticks_m: Annotated[Floats, "s"]
    height_ticks_m: Annotated[Floats, "h"]
    exaggeration: int

    @property
    def origin(self) -> str:
        """The point from which stations and heights count."""
        return self.label[0]


Paper = Literal["a4", "letter"]
"""What is printed on."""

PAPER_MM: dict[Paper, tuple[float, float]] = {"a4": (210.0, 297.0), "letter": (215.9, 279.4)}
"""Width and height, upright."""


@dataclass(frozen=True, kw_only=True)
class PlanSheet:
    """One sheet: the ground that it shows, in local metres.

    Attributes
    ----------
    number
        From 1, row by row from the north-west.
    column, row
        Its place among the sheets; row 0 is the northernmost.
    west_m, south_m, east_m, north_m
        Edges of what it shows.
    """

    number: int
    column: int
    row: int
    west_m: float
    south_m: float
    east_m: float
    north_m: float


@dataclass(frozen=True, kw_only=True)
class Plan:
    """How a plan lies on paper. Paper is measured in millimetres from its lower left corner.

    Attributes
    ----------
    scale
        Metres on the ground for each metre on paper.
    paper_mm
        Width and height of the paper as it is turned.
    frame_mm
        Left, bottom, width and height of the frame that shows the ground.
    overlap_mm
        That neighbouring sheets have in common.
    columns, rows
        Of sheets.
    sheets
        All of them.
    """

    scale: int
    paper_mm: tuple[float, float]
    frame_mm: tuple[float, float, float, float]
    overlap_mm: float
    columns: int
    rows: int
    sheets: tuple[PlanSheet, ...]

    def on_paper(self, sheet: PlanSheet, world_m: Floats) -> Floats:
        """(..., 2) millimetres on a sheet of (..., 2 or 3) places in the world."""
        corner = np.array([sheet.west_m, sheet.south_m])
        return np.asarray(
            np.array(self.frame_mm[:2]) + (world_m[..., :2] - corner) * 1000.0 / self.scale
        )


@dataclass(frozen=True)
class PlanWish:
    """A plan that is asked for: its paper, and its scale (None: the largest that one sheet has)."""

    paper: Paper
    scale: int | None = None


PLAN_PDF = "plan.pdf"


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
