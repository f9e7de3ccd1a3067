"""Known geometric quantities (distances, angles, areas...), and lines of known position."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from typing import Annotated, Literal

import numpy as np

from uavgram.model.arrays import NAN_IS_NONE, Bools, Floats, FrozenArrays, Ints

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

    def seen_thing(self, index: int, place: Mapping[str, int]) -> KnownThing | None:
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

    def relabelled(self, new_label: Ints) -> KnownThing | None:
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
