"""Observations by people and programs: picks, lengths, points, known quantities, targets."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from enum import Enum
from typing import Annotated, Any, Literal

import numpy as np

from uavgram.model.arrays import NAN_IS_NONE, Bools, Floats, FrozenArrays, Ints, freeze
from uavgram.model.message import Message
from uavgram.model.naming import Column


def _none() -> Floats:
    return np.zeros(0)


Source = Literal["hand", "match", "target"]
"""Origin of a pick.

A person; the program, which matched a person's pick in another photo; or the program, which
found a target."""


def select_rows(table: Any, rows: Sequence[int]) -> dict[str, Any]:  # noqa: ANN401  (any data class)
    """Return selected rows of a table's columns (arrays or tuples), without empty columns."""
    columns = {one.name: getattr(table, one.name) for one in fields(table)}
    return {
        name: tuple(column[i] for i in rows if column)
        if isinstance(column, tuple)
        else column[rows]
        for name, column in columns.items()
    }


def append_rows(first: Any, second: Any) -> dict[str, Any]:  # noqa: ANN401  (any data class)
    """Return the columns of a table, each followed by that of another table of its class."""
    columns = {
        one.name: (getattr(first, one.name), getattr(second, one.name)) for one in fields(first)
    }
    return {
        name: a + b if isinstance(a, tuple) else np.concatenate([a, b])
        for name, (a, b) in columns.items()
    }


SAME_PLACE_PX = 0.01
"""Largest distance between a pick and the stored origin of its matches [px]."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Picks:
    """P picked pixels.

    Attributes
    ----------
    image
        (P,) file name of the photo.
    label
        (P,) name of the physical point.
    pixel_px
        (P, 2) in the original, distorted, unrotated image; (0, 0) = centre of the top-left pixel.
    sigma_px
        (P,) of each coordinate; NaN where the file gives none.
    height_m
        (P,) known height of the point above the ground plane; NaN where the file gives none.
    height_sigma_m
        (P,) its standard deviation; NaN where the file gives none.
    is_free
        (P,) whether the file declares the height unknown.
    area
        (P,) name of the area whose plane contains the point, empty where the file gives none.
    source
        (P,) origin of the pick; if omitted, a person made all.
    score
        (P,) agreement of a match or a target with its template, 0 to 1; NaN where the file gives
        none.
    from_image, from_px
        (P,), (P, 2) of a match: photo and pixel of the pick from which it was found; empty and NaN
        for others.
    line
        (P,) line of the file; empty where they come from no file.
    """

    image: Annotated[tuple[str, ...], "n"]
    label: tuple[str, ...]
    pixel_px: Annotated[Floats, "n", 2, Column(keys=("u_px", "v_px"))]
    sigma_px: Annotated[Floats, "n", NAN_IS_NONE]
    height_m: Annotated[Floats, "n", NAN_IS_NONE]
    height_sigma_m: Annotated[Floats, "n", NAN_IS_NONE] = field(default_factory=_none)
    is_free: Annotated[Bools, "n"] = field(default_factory=lambda: np.zeros(0, np.bool_))
    area: Annotated[tuple[str, ...], "n"] = ()
    source: Annotated[tuple[Source, ...], "n"] = ()
    score: Annotated[Floats, "n", NAN_IS_NONE] = field(default_factory=_none)
    from_image: Annotated[tuple[str, ...], "n"] = ()
    from_px: Annotated[Floats, "n", 2, NAN_IS_NONE, Column(keys=("from_u_px", "from_v_px"))] = (
        field(default_factory=_none)
    )
    line: tuple[int, ...] = ()

    def __post_init__(self) -> None:
        n = len(self.image)
        omitted = {
            **dict.fromkeys(("height_sigma_m", "score"), np.full(n, np.nan)),
            **dict.fromkeys(("area", "from_image"), ("",) * n),
            "is_free": np.zeros(n, np.bool_),
            "source": ("hand",) * n,
            "from_px": np.full((n, 2), np.nan),
        }
        for name, column in omitted.items():
            if not len(getattr(self, name)):
                object.__setattr__(self, name, column)
        freeze(self)
        if len(self.line) not in {0, n}:
            raise ValueError(f"line: {len(self.line)} entries, expected {n}")

    def take(self, rows: Sequence[int]) -> Picks:
        """Return selected picks, by index."""
        return Picks(**select_rows(self, rows))

    def where(self, mask: Bools) -> Picks:
        """Return the picks of a (P,) mask."""
        return self.take(np.flatnonzero(mask).tolist())

    def of_source(self, source: Source) -> Bools:
        """Return a (P,) mask of the picks of one origin."""
        return np.array([one == source for one in self.source], dtype=np.bool_)

    @property
    def is_copy(self) -> Bools:
        """(P,) mask of rows that repeat an earlier one exactly and are counted once."""
        seen: set[tuple[object, ...]] = set()
        copy = np.zeros(len(self.image), dtype=np.bool_)
        for i, place in enumerate(map(tuple, self.pixel_px.tolist())):
            row = self.image[i], self.label[i], self.source[i], place
            copy[i] = row in seen
            seen.add(row)
        return copy

    @property
    def clicks(self) -> dict[tuple[str, str], list[int]]:
        """Rows of each photo and label that are neither matches nor copies: one or more clicks."""
        rows: dict[tuple[str, str], list[int]] = {}
        for i in np.flatnonzero(~(self.of_source("match") | self.is_copy)).tolist():
            rows.setdefault((self.image[i], self.label[i]), []).append(i)
        return rows

    def line_of(self, pick: int) -> int | None:
        """Return the line of a pick in its file; None where there is no file."""
        return self.line[pick] if self.line else None


Along = Literal["slope", "horizontal"]
"""Quantity that was taped: the straight 3-D distance, or the horizontal distance."""


@dataclass(frozen=True, kw_only=True, eq=False)
class KnownLines(FrozenArrays):
    """L taped lengths between two labels.

    Attributes
    ----------
    name, start, end
        (L,) of the line, and the labels of its ends.
    length_m, sigma_m
        (L,) reading of the tape and its standard deviation.
    adjust
        (L,) True: an observation; False: withheld as a check.
    tape
        (L,) name of the tape, empty where the file gives none: the one tape.
    along
        (L,) measured quantity; or an empty tuple: the straight 3-D distance of all.
    """

    name: Annotated[tuple[str, ...], "n"]
    start: tuple[str, ...]
    end: tuple[str, ...]
    length_m: Annotated[Floats, "n"]
    sigma_m: Annotated[Floats, "n"]
    adjust: Annotated[Bools, "n"]
    tape: Annotated[tuple[str, ...], "n"] = ()
    along: tuple[Along, ...] = ()

    def take(self, rows: Sequence[int]) -> KnownLines:
        """Return selected lines, by index."""
        return KnownLines(**select_rows(self, rows))

    def append(self, others: KnownLines) -> KnownLines:
        """Append other lines."""
        along = tuple(one.along_of(i) for one in (self, others) for i in range(len(one.name)))
        return KnownLines(**append_rows(self, others) | {"along": along})

    def __post_init__(self) -> None:
        n = len(self.name)
        if not self.tape:
            object.__setattr__(self, "tape", ("",) * n)
        super().__post_init__()
        if len(self.along) not in {0, n}:
            raise ValueError(f"along: {len(self.along)} entries, expected {n}")

    def along_of(self, line: int) -> Along:
        """Return the quantity that was taped for a length."""
        return self.along[line] if self.along else "slope"


@dataclass(frozen=True, kw_only=True, eq=False)
class KnownPoints(FrozenArrays):
    """C points with known coordinates, geodetic or local, as in the file.

    Attributes
    ----------
    label
        (C,) names.
    kind
        ``geodetic``: (latitude_deg, longitude_deg, height_m); ``local``: (east_m, north_m, up_m) in
        the world's axes.
    coordinates
        (C, 3) in the form of `kind`.
    sigma_m
        (C, 3) east, north, up.
    """

    label: Annotated[tuple[str, ...], "n"]
    kind: Literal["geodetic", "local"]
    coordinates: Annotated[Floats, "n", 3]
    sigma_m: Annotated[Floats, "n", 3]


@dataclass(frozen=True, kw_only=True, eq=False)
class KnownWorldPoints(FrozenArrays):
    """Points with known coordinates in the local world: (C,) labels, (C, 3) metres and sigmas."""

    label: Annotated[tuple[str, ...], "n"]
    world_m: Annotated[Floats, "n", 3]
    sigma_m: Annotated[Floats, "n", 3]


MeasurementKind = Literal[
    "distance",
    "polyline",
    "area",
    "angle",
    "line_distance",
    "coordinate",
    "skid_speed",
    "speed",
    "height",
    "horizontal_distance",
    "vertical_distance",
    "slope",
    "plane_distance",
    "volume",
    "profile",
]


@dataclass(frozen=True)
class MeasurementForm:
    """Properties of a kind of measurement, beside its formula.

    Attributes
    ----------
    words
        Name for people.
    points
        Smallest and largest number of points; None: any number.
    unit
        Unit of its values.
    parameters, optional
        Names of its required and optional parameters.
    is_signed
        Whether it is a length whose value, if near zero, is no measure of its accuracy.
    may_return
        Whether a point may occur twice, though not twice in a row.
    """

    words: str
    points: tuple[int, int | None]
    unit: str = "m"
    parameters: tuple[str, ...] = ()
    optional: tuple[str, ...] = ()
    is_signed: bool = False
    may_return: bool = False


MEASUREMENT_FORMS: dict[MeasurementKind, MeasurementForm] = {
    "distance": MeasurementForm("distance", (2, 2)),
    "polyline": MeasurementForm("length along", (2, None), may_return=True),
    "area": MeasurementForm("area", (3, None), "m2"),
    "angle": MeasurementForm("angle", (3, 3), "deg"),
    "line_distance": MeasurementForm("distance from line", (3, 3)),
    "coordinate": MeasurementForm("coordinate", (1, 1), is_signed=True),
    "skid_speed": MeasurementForm(
        "speed from skid", (2, None), "m/s", parameters=("mu", "mu_sigma"), may_return=True
    ),
    "speed": MeasurementForm("speed", (2, 2), "m/s"),
    "height": MeasurementForm("height", (1, 2), is_signed=True),
    "horizontal_distance": MeasurementForm("level distance", (2, 2)),
    "vertical_distance": MeasurementForm("difference in height", (2, 2), is_signed=True),
    "slope": MeasurementForm("slope", (2, 2), "deg"),
    "plane_distance": MeasurementForm("distance from plane", (4, 4), is_signed=True),
    "volume": MeasurementForm("volume", (3, None), "m3", optional=("top", "level", "plane")),
    "profile": MeasurementForm("profile: its length", (2, None)),
}
"""Properties of each kind of measurement."""


@dataclass(frozen=True, kw_only=True)
class MeasurementRequest:
    """Requested measurement.

    Attributes
    ----------
    name, kind
        Its name and kind.
    points
        Labels in order.
    parameters
        Numbers that the kind needs or may have, such as mu and mu_sigma of a skid speed.
    """

    name: str
    kind: MeasurementKind
    points: tuple[str, ...]
    parameters: tuple[tuple[str, float], ...] = ()

    @property
    def parameters_text(self) -> str:
        """The parameters in the form of measure.csv."""
        return ";".join(f"{name}={value!r}" for name, value in self.parameters)


class RejectedPlate(Enum):
    """Reason why a recognised plate is not measured, in the words of its message."""

    NO = ""
    COVERED = "something lies across it, such as the edge of a shadow, dirt, or a wheel"
    DOUBTFUL = "what was seen there does not look enough like it: too small, or half hidden"
    TWICE = "its number is there twice in this photo, so nothing says which one is meant"
    FAINT = "it is too small or too faint there to be measured"


@dataclass(frozen=True, kw_only=True, eq=False)
class SeenPlate(FrozenArrays):
    """Coded plate in one photo.

    Attributes
    ----------
    plate
        Its id.
    corner_px, sigma_px
        (4, 2), (4,) of its black square, from the first corner on, in the order of its rows of
        cells; the standard deviation of each coordinate. NaN where a corner was not found.
    center_px, center_sigma_px
        (2,) intersection of its diagonals, and its standard deviation.
    score
        Correlation of a plate's picture with the photo.
    shadows
        Number of shadow edges across it.
    left_out
        Why it is not to be used.
    """

    plate: int
    corner_px: Annotated[Floats, 4, 2, NAN_IS_NONE]
    sigma_px: Annotated[Floats, 4, NAN_IS_NONE]
    center_px: Annotated[Floats, 2, NAN_IS_NONE]
    center_sigma_px: float
    score: float
    shadows: int = 0
    left_out: RejectedPlate = RejectedPlate.NO

    @property
    def side_px(self) -> float:
        """Length of its shortest side [px]; NaN where a corner was not found."""
        sides = np.roll(self.corner_px, -1, axis=0) - self.corner_px
        return float(np.linalg.norm(sides, axis=1).min())


@dataclass(frozen=True, kw_only=True, eq=False)
class ImportedPicks(FrozenArrays):
    """P picks in this program's convention.

    Attributes
    ----------
    image, label
        (P,) file name of the photo, and name of the point.
    pixel_px
        (P, 2) u right, v down of the original, unrotated file; (0, 0) is the centre of the top-left
        pixel.
    known
        Coordinates of its points in the file, with the sigma that was stated for them.
    messages
        Rows that were left out, and assumptions.
    """

    image: Annotated[tuple[str, ...], "n"]
    label: tuple[str, ...]
    pixel_px: Annotated[Floats, "n", 2]
    known: KnownPoints | None
    messages: tuple[Message, ...]


ON_LINE = "on_line"
"""Kind of the known quantity that a line of known position gives."""

STRAIGHTNESS_M = 0.005
"""Default sigma of the distance of picked points from a line [m]."""


@dataclass(frozen=True, kw_only=True, eq=False)
class ControlLines(FrozenArrays):
    """L lines with known coordinates, geodetic or local, as in the file.

    Attributes
    ----------
    name, points
        (L,) name, and labels of the points picked on it.
    kind
        ``geodetic``: (latitude_deg, longitude_deg, height_m); ``local``: (east_m, north_m, up_m) in
        the world's axes.
    coordinates
        (L, 2, 3) of start and end, in the form of `kind`; NaN for unknown heights.
    sigma_m
        (L, 2, 3) of each: east, north, up; NaN where the height is unknown.
    straightness_m
        (L,) sigma of the distance of a picked point from the line.
    adjust
        (L,) True: an observation; False: withheld as a check.
    """

    name: Annotated[tuple[str, ...], "n"]
    points: Annotated[tuple[tuple[str, ...], ...], "n"]
    kind: Literal["geodetic", "local"]
    coordinates: Annotated[Floats, "n", 2, 3, NAN_IS_NONE]
    sigma_m: Annotated[Floats, "n", 2, 3, NAN_IS_NONE]
    straightness_m: Annotated[Floats, "n"]
    adjust: Annotated[Bools, "n"]


@dataclass(frozen=True, kw_only=True, eq=False)
class LinePosition(FrozenArrays):
    """Position of one line in the world.

    Attributes
    ----------
    ends_m
        (2, 3) start and end; without known heights their third coordinates are 0 without meaning.
    sigma_m
        (2, 3) of them.
    straightness_m
        As in `ControlLines`.
    has_height
        Whether the heights are known.
    """

    ends_m: Annotated[Floats, 2, 3]
    sigma_m: Annotated[Floats, 2, 3]
    straightness_m: float
    has_height: bool

    @property
    def across_m(self) -> float:
        """Sigma of the line's middle, perpendicular to the line in plan."""
        ahead = self.ends_m[1, :2] - self.ends_m[0, :2]
        square = np.array([-ahead[1], ahead[0]]) / np.linalg.norm(ahead)
        ends = np.linalg.norm(self.sigma_m[:, :2] * square, axis=1)
        return float(np.hypot(np.linalg.norm(ends) / 2.0, self.straightness_m))


NO_CONTROL_LINES = ControlLines(
    name=(),
    points=(),
    kind="local",
    coordinates=np.empty((0, 2, 3)),
    sigma_m=np.empty((0, 2, 3)),
    straightness_m=np.empty(0),
    adjust=np.empty(0, dtype=np.bool_),
)


NOT_KNOWN = {
    "coordinate": "give points with known coordinates in control.csv (`control` in the project)",
    "speed": "a speed says nothing of where the points are",
    "skid_speed": "a speed says nothing of where the points are",
    "profile": "it has no single value: give the heights or distances of its points",
    ON_LINE: "give lines of known position in control_lines.csv (`control_lines` in the project)",
}
"""Kinds of measurement that cannot be given as known, with the reason or the alternative."""


@dataclass(frozen=True, kw_only=True, eq=False)
class KnownThings(FrozenArrays):
    """N known quantities of the scene, as stated in a project.

    Attributes
    ----------
    name, kind
        (N,) name and kind of each.
    points
        (N,) labels of each, in order.
    value
        (N,) in the unit of the measurement of that kind (metres, square metres, degrees); NaN for
        conditions, which have none.
    sigma
        (N,) standard deviation in the same unit; for conditions in degrees or metres.
    adjust
        (N,) True: an observation; False: withheld as a check.
    parameters
        (N,) numbers that a kind needs beside its points.
    position
        (N,) position of the line for points on a line of known position; None for others. Empty if
        there is no such line.
    """

    name: Annotated[tuple[str, ...], "n"]
    kind: Annotated[tuple[str, ...], "n"]
    points: Annotated[tuple[tuple[str, ...], ...], "n"]
    value: Annotated[Floats, "n", NAN_IS_NONE]
    sigma: Annotated[Floats, "n"]
    adjust: Annotated[Bools, "n"]
    parameters: Annotated[tuple[tuple[tuple[str, float], ...], ...], "n"]
    position: tuple[LinePosition | None, ...] = ()

    def get_seen_thing(self, index: int, place: Mapping[str, int]) -> KnownThing | None:
        """Return one of them if all its points are present (on a line of known position: any).

        Parameters
        ----------
        index
            Row of the known quantity.
        place
            Row of every label that is present.
        """
        points = self.points[index]
        seen = tuple(place[label] for label in points if label in place)
        is_line = bool(self.position) and self.position[index] is not None
        return self.thing(index, seen) if len(seen) == len(points) or (is_line and seen) else None

    def thing(self, index: int, label: tuple[int, ...]) -> KnownThing:
        """Return one of them, with its points as rows of a survey's labels."""
        return KnownThing(
            index=index,
            name=self.name[index],
            kind=self.kind[index],
            label=label,
            value=float(self.value[index]),
            sigma=float(self.sigma[index]),
            parameters=self.parameters[index],
            position=self.position[index] if self.position else None,
        )


@dataclass(frozen=True, kw_only=True)
class KnownThing:
    """One known quantity of a survey.

    Attributes
    ----------
    index
        Row among the project's; it keeps that number when others are left out.
    name, kind, value, sigma, parameters
        As in `KnownThings`; the value of a condition is NaN.
    position
        Position of the line for points on a line of known position. Its own sigmas hold for a
        `sigma` of `LinePosition.across_m`, and scale with that.
    label
        Its points, as rows of the survey's labels.
    """

    index: int
    name: str
    kind: str
    label: tuple[int, ...]
    value: float
    sigma: float
    parameters: tuple[tuple[str, float], ...] = ()
    position: LinePosition | None = None

    def relabel(self, new_label: Ints) -> KnownThing | None:
        """Return it with the labels' new rows (-1: gone); None where too few labels are left."""
        new = tuple(k for k in new_label[list(self.label)].tolist() if k >= 0)
        whole = len(new) == len(self.label) or (self.position is not None and bool(new))
        return replace(self, label=new) if whole else None


NO_KNOWN = KnownThings(
    name=(),
    kind=(),
    points=(),
    value=np.empty(0),
    sigma=np.empty(0),
    adjust=np.empty(0, dtype=np.bool_),
    parameters=(),
)

MIN_TURN_RAD = 0.1
"""Smallest angle between lines that are not parallel [rad]; parallel ones fix one direction."""


def do_lines_fix_plan(things: Iterable[KnownThing]) -> bool:
    """Return whether lines of known position fix a plane figure of ground points on the map.

    East, north and heading are three unknowns: this takes three points on lines, not all parallel.
    """
    on_lines = [(one.position, len(one.label)) for one in things if one.position is not None]
    if sum(count for _, count in on_lines) < 3:
        return False
    ahead = np.array([line.ends_m[1, :2] - line.ends_m[0, :2] for line, _ in on_lines])
    turn = np.arctan2(ahead[:, 1], ahead[:, 0])
    return bool((np.abs(np.sin(turn - turn[0])) > MIN_TURN_RAD).any())
