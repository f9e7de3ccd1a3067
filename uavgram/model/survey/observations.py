"""Observations of people and of the program: picks, lengths, points, targets, imports."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, fields
from enum import Enum
from typing import Annotated, Any, Literal

import numpy as np

from uavgram.model.arrays import NAN_IS_NONE, Bools, Floats, FrozenArrays, freeze
from uavgram.model.message import Message


def _none() -> Floats:
    return np.zeros(0)


Source = Literal["hand", "match", "target"]
"""Who made a pick: a person; the program, which found in another photo what a person had picked; or
the program, which found a target."""


def taken(table: Any, rows: Sequence[int]) -> dict[str, Any]:  # noqa: ANN401  (any data class)
    """Some rows of a table's columns, arrays or tuples, without those that have none."""
    columns = {one.name: getattr(table, one.name) for one in fields(table)}
    return {
        name: tuple(column[i] for i in rows if column)
        if isinstance(column, tuple)
        else column[rows]
        for name, column in columns.items()
    }


SAME_PLACE_PX = 0.01
"""A match is of a pick that lies no further than that from where the match was found from."""


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
        (P,) whether the file says that the height is to be found.
    area
        (P,) name of the area whose plane the point lies on, empty where the file gives none; or
        nothing at all where none is given anywhere.
    source
        (P,) who made it; or nothing at all: a person made all.
    score
        (P,) how well a match or a target agrees with what was sought, 0 to 1; NaN where the file
        gives none.
    from_image, from_px
        (P,), (P, 2) of a match: photo and place of the pick that it was found from; empty and NaN
        of others, or no photo at all.
    line
        (P,) line of the file; nothing where they come from no file.
    """

    image: Annotated[tuple[str, ...], "n"]
    label: tuple[str, ...]
    pixel_px: Annotated[Floats, "n", 2]
    sigma_px: Annotated[Floats, "n", NAN_IS_NONE]
    height_m: Annotated[Floats, "n", NAN_IS_NONE]
    height_sigma_m: Annotated[Floats, "n", NAN_IS_NONE] = field(default_factory=_none)
    is_free: Annotated[Bools, "n"] = field(default_factory=lambda: np.zeros(0, np.bool_))
    area: tuple[str, ...] = ()
    source: tuple[Source, ...] = ()
    score: Annotated[Floats, "n", NAN_IS_NONE] = field(default_factory=_none)
    from_image: tuple[str, ...] = ()
    from_px: Annotated[Floats, "n", 2, NAN_IS_NONE] = field(default_factory=_none)
    line: tuple[int, ...] = ()

    def __post_init__(self) -> None:
        n = len(self.image)
        for name, nothing in (("height_sigma_m", np.nan), ("is_free", False), ("score", np.nan)):
            if not len(getattr(self, name)):
                object.__setattr__(self, name, np.full(n, nothing))
        if not len(self.from_px):
            object.__setattr__(self, "from_px", np.full((n, 2), np.nan))
        freeze(self)
        for name in ("area", "source", "from_image", "line"):
            if len(getattr(self, name)) not in {0, n}:
                raise ValueError(f"{name}: {len(getattr(self, name))} entries, expected {n}")

    def take(self, rows: Sequence[int]) -> Picks:
        """Some of the picks, by index."""
        return Picks(**taken(self, rows))

    def source_of(self, pick: int) -> Source:
        """Who made a pick."""
        return self.source[pick] if self.source else "hand"

    def of_source(self, source: Source) -> Bools:
        """(P,) which picks were made by one."""
        made = [self.source_of(i) == source for i in range(len(self.image))]
        return np.array(made, dtype=np.bool_)

    @property
    def is_copy(self) -> Bools:
        """(P,) rows that repeat an earlier one to the last digit: counted once."""
        seen: set[tuple[object, ...]] = set()
        copy = np.zeros(len(self.image), dtype=np.bool_)
        for i, place in enumerate(map(tuple, self.pixel_px.tolist())):
            row = self.image[i], self.label[i], self.source_of(i), place
            copy[i] = row in seen
            seen.add(row)
        return copy

    @property
    def clicks(self) -> dict[tuple[str, str], list[int]]:
        """Photo and label -> the rows that are no matches and no copies: one or more clicks."""
        rows: dict[tuple[str, str], list[int]] = {}
        for i in np.flatnonzero(~(self.of_source("match") | self.is_copy)).tolist():
            rows.setdefault((self.image[i], self.label[i]), []).append(i)
        return rows

    def line_of(self, pick: int) -> int | None:
        """Line of the file in which a pick stands; None where there is no file."""
        return self.line[pick] if self.line else None


Along = Literal["slope", "horizontal"]
"""What a length is: the straight 3-D distance, or the distance in the horizontal plane."""


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
        (L,) True: an observation; False: withheld, only judged.
    tape
        (L,) name of the tape, empty where the file gives none: the one tape; or nothing at all
        where none is given anywhere.
    along
        (L,) what was measured; or nothing at all: the straight 3-D distance of all.
    """

    name: Annotated[tuple[str, ...], "n"]
    start: tuple[str, ...]
    end: tuple[str, ...]
    length_m: Annotated[Floats, "n"]
    sigma_m: Annotated[Floats, "n"]
    adjust: Annotated[Bools, "n"]
    tape: tuple[str, ...] = ()
    along: tuple[Along, ...] = ()

    def take(self, rows: Sequence[int]) -> KnownLines:
        """Some of the lines, by index."""
        return KnownLines(**taken(self, rows))

    def with_more(self, others: KnownLines) -> KnownLines:
        """Append others."""
        mine, theirs = range(len(self.name)), range(len(others.name))
        return KnownLines(
            name=self.name + others.name,
            start=self.start + others.start,
            end=self.end + others.end,
            length_m=np.concatenate([self.length_m, others.length_m]),
            sigma_m=np.concatenate([self.sigma_m, others.sigma_m]),
            adjust=np.concatenate([self.adjust, others.adjust]),
            tape=(*map(self.tape_of, mine), *map(others.tape_of, theirs)),
            along=(*map(self.along_of, mine), *map(others.along_of, theirs)),
        )

    def __post_init__(self) -> None:
        super().__post_init__()
        n = len(self.name)
        for name in ("tape", "along"):
            if len(getattr(self, name)) not in {0, n}:
                raise ValueError(f"{name}: {len(getattr(self, name))} entries, expected {n}")

    def tape_of(self, line: int) -> str:
        """Name of the tape of a length; empty for the one tape."""
        return self.tape[line] if self.tape else ""

    def along_of(self, line: int) -> Along:
        """What was measured between the ends of a length."""
        return self.along[line] if self.along else "slope"


@dataclass(frozen=True, kw_only=True, eq=False)
class KnownPoints(FrozenArrays):
    """C points with known coordinates, geodetic or local, as the file has them.

    Attributes
    ----------
    label
        (C,) names.
    kind
        ``geodetic``: (latitude_deg, longitude_deg, height_m); ``local``: (east_m, north_m, up_m)
        in the world's axes.
    coordinates
        (C, 3) as `kind` says.
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


@dataclass(frozen=True, kw_only=True)
class MeasurementRequest:
    """One thing to measure.

    Attributes
    ----------
    name, kind
        Its name; what it is.
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
        """The parameters as measure.csv has them."""
        return ";".join(f"{name}={value!r}" for name, value in self.parameters)


class LeftOut(Enum):
    """Why a plate that was recognised is not measured; what a message says of it."""

    NO = ""
    COVERED = "something lies across it, such as the edge of a shadow, dirt, or a wheel"
    DOUBTFUL = "what was seen there does not look enough like it: too small, or half hidden"
    TWICE = "its number is there twice in this photo, so nothing says which one is meant"
    FAINT = "it is too small or too faint there to be measured"


@dataclass(frozen=True, kw_only=True, eq=False)
class SeenPlate(FrozenArrays):
    """A plate in one photo.

    Attributes
    ----------
    plate
        Its id.
    corner_px, sigma_px
        (4, 2), (4,) of its black square, from the first corner on, as its rows of cells run; the
        standard deviation of each coordinate. NaN where a corner was not seen.
    center_px, center_sigma_px
        (2,) the place where its diagonals meet, and its standard deviation.
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
    left_out: LeftOut = LeftOut.NO

    @property
    def side_px(self) -> float:
        """Length of its shortest side; NaN where a corner was not seen."""
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
        (P, 2) u right, v down of the original, unrotated file; (0, 0) is the centre of the
        top-left pixel.
    known
        Coordinates that the file holds of its points, with the sigma that was stated for them.
    messages
        What was left out, or had to be assumed.
    """

    image: Annotated[tuple[str, ...], "n"]
    label: tuple[str, ...]
    pixel_px: Annotated[Floats, "n", 2]
    known: KnownPoints | None
    messages: tuple[Message, ...]
