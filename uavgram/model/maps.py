"""Maps and plans: layers, rasters, sheets, profiles and missions."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Annotated, Literal

import numpy as np

from uavgram.model.arrays import Floats, FrozenArrays, freeze
from uavgram.model.flight_log import HeightDatum

ShapeKind = Literal["point", "line", "polygon"]
Attribute = tuple[str, ...] | tuple[float, ...]


@dataclass(frozen=True, kw_only=True, eq=False)
class Layer:
    """Shapes of one kind with the same attributes.

    Attributes
    ----------
    name
        Layer name in files and tables, in plain letters, such as ``measurements``.
    kind
        Kind of every shape.
    vertices_m
        N arrays (v, 3) of east, north, up; v is 1 for a point; a polygon is not closed and runs
        counterclockwise seen from above; v = 0 where a shape has no position.
    attributes
        Name to N values: text or numbers, NaN where there is none. Names end in the unit.
    above_ground_m
        N arrays (v,) of the height of each vertex above the ground; empty where all are on it.
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

    def records(self) -> list[dict[str, str | float | None]]:
        """Return the attributes of each shape, None for numbers that are not finite."""
        columns = (
            [None if isinstance(one, float) and not math.isfinite(one) else one for one in values]
            for values in self.attributes.values()
        )
        return [dict(zip(self.attributes, row, strict=True)) for row in zip(*columns, strict=True)]

    def value_texts(self, words: Callable[[float, float, str], str]) -> tuple[str, ...]:
        """Return the text next to each line or area: its name, and its value; none without values.

        Parameters
        ----------
        words
            Function that formats a value, its standard deviation and its unit.
        """
        of = self.attributes
        value, sigma = ("length_m", "sigma_m") if "length_m" in of else ("value", "sigma")
        if value not in of:
            return ()
        rows = zip(
            of["name"], of[value], of[sigma], of.get("unit", ("m",) * len(self)), strict=True
        )
        return tuple(
            f"{name}: {words(float(str(number)), float(str(spread)), str(unit))}"
            for name, number, spread, unit in rows
        )

    def transform(self, place: Callable[[Floats], Floats]) -> tuple[Floats, ...]:
        """Return the vertices of each shape in other coordinates, see `transform_vertices`."""
        shapes = transform_vertices(self.vertices_m, place)
        return tuple(map(close_ring, shapes)) if self.kind == "polygon" else shapes


def close_ring(ring: Floats) -> Floats:
    """Repeat the first vertex of a ring (v, d) at its end."""
    return np.concatenate([ring, ring[:1]])


@dataclass(frozen=True, kw_only=True)
class LayerStyle:
    """Style of a layer.

    Attributes
    ----------
    title
        Displayed name.
    colour
        ``#rrggbb``.
    globe
        Colour on photos of a globe: ``aabbggrr``, as in KML; a tenth of it fills polygons.
    width_mm
        Of lines and outlines; of a point, its size.
    dashed
        Whether lines are.
    filled
        Opacity inside polygons.
    label
        The column that is written beside each shape; empty: none.
    shown
        Whether it is visible at first.
    by_status
        Colours of shapes by their column ``status``; all others have `colour`.
    cad
        Layer of CAD drawings; empty: its own name in capitals.
    cad_colour
        Its colour there, of AutoCAD's index: visible on black and on white.
    """

    title: str
    colour: str
    globe: str = "ffffffff"
    width_mm: float = 0.3
    dashed: bool = False
    filled: float = 0.0
    label: str = ""
    shown: bool = True
    by_status: dict[str, str] = field(default_factory=dict)
    cad: str = ""
    cad_colour: int = 7

    def colour_of(self, status: str) -> str:
        """Return the colour of a shape."""
        return self.by_status.get(status, self.colour)


Looks = Mapping[str, LayerStyle]
"""Style of each layer by its name; the first is on top."""


def look_of(looks: Looks, layer: str) -> LayerStyle:
    """Return the style of a layer; one without its own has its name as title, and is white."""
    return looks.get(layer, LayerStyle(title=layer.replace("_", " "), colour="#ffffff"))


def transform_vertices(
    shapes: tuple[Floats, ...], place: Callable[[Floats], Floats]
) -> tuple[Floats, ...]:
    """Transform the vertices (v, 3) of all shapes to other coordinates, in one call."""
    counts = [len(vertices) for vertices in shapes]
    if not sum(counts):
        return shapes
    return tuple(np.split(place(np.concatenate(shapes)), np.cumsum(counts)[:-1]))


@dataclass(frozen=True, kw_only=True, eq=False)
class Features:
    """Survey as layers, with its position on the earth.

    Attributes
    ----------
    name
        Name of the project.
    layers
        Layers in drawing order: the last one is on top.
    origin
        Latitude [deg], longitude [deg], height [m] of the local origin; None where the survey is
        not georeferenced.
    height_datum
        Datum of the origin's height.
    crs
        Projected coordinate system for maps, such as ``EPSG:32756``; None without an origin.
    profiles
        Drawings of the measured profiles.
    ellipsoid_shift_m
        Height above the WGS 84 ellipsoid minus that above the datum; None if it is not known.
    """

    name: str
    layers: tuple[Layer, ...]
    origin: tuple[float, float, float] | None
    height_datum: HeightDatum
    crs: str | None
    profiles: tuple[ProfileSheet, ...] = ()
    ellipsoid_shift_m: float | None = None

    def layer(self, name: str) -> Layer:
        """Return the layer of that name."""
        return next(layer for layer in self.layers if layer.name == name)


@dataclass(frozen=True, kw_only=True)
class GroundRaster:
    """Raster geometry: north up, square pixels; row 0 is the northernmost.

    Attributes
    ----------
    west_m, north_m
        Outer corner of pixel [0, 0], in `crs`, or in local metres where that is None.
    pixel_m
        Side of a pixel.
    width, height
        Size in pixels.
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
        """Return (len(rows), len(columns), 2) east and north of (fractional) pixel centres."""
        east = self.west_m + (np.asarray(columns, np.float64) + 0.5) * self.pixel_m
        north = self.north_m - (np.asarray(rows, np.float64) + 0.5) * self.pixel_m
        return np.stack(np.meshgrid(east, north), axis=-1)

    def coarser(self, factor: int) -> GroundRaster:
        """Return a raster of the same ground with `factor` times larger pixels, rounded up."""
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
    """Profile along a line, with its points in order, and axes with round numbers.

    Attributes
    ----------
    name
        Name of the profile.
    label
        (N,) names of the points.
    station_m, height_m, ground_m
        (N,) distance along the line from its first point; heights of point and ground above the
        first point.
    station_sigma_m, height_sigma_m, ground_sigma_m
        (N,) their standard deviations.
    station_ticks_m, height_ticks_m
        Round numbers; first and last are the ends of the axes.
    exaggeration
        Scale of heights over scale of lengths in the drawing.
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
        """Point at which stations and heights are zero."""
        return self.label[0]


Paper = Literal["a4", "letter"]
"""Paper format."""

PAPER_MM: dict[Paper, tuple[float, float]] = {"a4": (210.0, 297.0), "letter": (215.9, 279.4)}
"""Width and height of the paper in portrait format [mm]."""


@dataclass(frozen=True, kw_only=True)
class PlanSheet:
    """One sheet and the ground that it shows, in local metres.

    Attributes
    ----------
    number
        Counted from 1, row by row from the north-west.
    column, row
        Position among the sheets; row 0 is the northernmost.
    west_m, south_m, east_m, north_m
        Edges of the ground that it shows.
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
    """Layout of a plan on paper. Paper coordinates are millimetres from its lower left corner.

    Attributes
    ----------
    scale
        Metres on the ground per metre on paper.
    paper_mm
        Width and height of the paper in its orientation.
    frame_mm
        Left, bottom, width and height of the frame that shows the ground.
    overlap_mm
        Overlap of neighbouring sheets.
    columns, rows
        Number of sheets in each direction.
    sheets
        All sheets.
    """

    scale: int
    paper_mm: tuple[float, float]
    frame_mm: tuple[float, float, float, float]
    overlap_mm: float
    columns: int
    rows: int
    sheets: tuple[PlanSheet, ...]

    def on_paper(self, sheet: PlanSheet, world_m: Floats) -> Floats:
        """Return (..., 2) millimetres on a sheet of (..., 2 or 3) world points."""
        corner = np.array([sheet.west_m, sheet.south_m])
        return np.asarray(
            np.array(self.frame_mm[:2]) + (world_m[..., :2] - corner) * 1000.0 / self.scale
        )


@dataclass(frozen=True)
class PlanPaper:
    """Requested plan: paper, and scale (None: the largest that fits on one sheet)."""

    paper: Paper
    scale: int | None = None


PLAN_PDF = "plan.pdf"


Autopilot = Literal["ardupilot", "px4"]
"""Autopilot whose mission commands are used; the commands to take photos and to turn differ."""

HeightFrame = Literal["relative", "terrain"]
"""Reference of the heights of stops: the place of take-off, or the ground below each stop."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Mission:
    """Stops in the order of flight; one photo is taken at each stop.

    Attributes
    ----------
    name
        Name of the plan.
    autopilot
        Autopilot whose commands are used.
    home
        Latitude [deg], longitude [deg], height above mean sea level [m] of the place of take-off.
    height_frame
        Reference of `height_m`.
    latitude_deg, longitude_deg
        (F,) of the stops, WGS 84.
    height_m
        (F,) of the stops.
    heading_deg
        (F,) of the drone's nose, from true north, clockwise, [0, 360).
    gimbal_pitch_deg
        (F,) of the camera axis: 0 forward, -90 straight down.
    speed_m_s
        Speed from stop to stop.
    hold_s
        Hover time at each stop before the photo, until drone and gimbal have settled.
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
