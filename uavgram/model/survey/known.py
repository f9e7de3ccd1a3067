"""What is known beforehand of distances, angles, areas and the like, as observations."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from typing import Annotated

import numpy as np

from uavgram.model.arrays import NAN_IS_NONE, Bools, Floats, FrozenArrays, Ints
from uavgram.model.survey.control_lines import ON_LINE, LinePosition

NOT_KNOWN = {
    "coordinate": "give points with known coordinates in control.csv (`control` in the project)",
    "speed": "a speed says nothing of where the points are",
    "skid_speed": "a speed says nothing of where the points are",
    "profile": "it has no single value: give the heights or distances of its points",
    ON_LINE: "give lines of known position in control_lines.csv (`control_lines` in the project)",
}
"""Kinds of measurement that cannot be given as known, and why or what to do instead."""


@dataclass(frozen=True, kw_only=True, eq=False)
class KnownThings(FrozenArrays):
    """N things that are known of the scene, as a project states them.

    Attributes
    ----------
    name, kind
        (N,) what each is called, and what it is.
    points
        (N,) labels of each, in order.
    value
        (N,) in the unit of the measurement of that kind (metres, square metres, degrees); NaN for
        conditions, which have none.
    sigma
        (N,) standard deviation in the same unit; of conditions degrees or metres.
    adjust
        (N,) True: an observation; False: withheld, only judged.
    parameters
        (N,) numbers that a kind needs beside its points.
    position
        (N,) of points on a line of known position: where that lies; None of others. Or nothing at
        all where there is no such line.
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
        """One of them, where it is seen whole: of a line of known position any point will do.

        Parameters
        ----------
        index
            Which.
        place
            Row of every label that is there.
        """
        points = self.points[index]
        seen = tuple(place[label] for label in points if label in place)
        is_line = bool(self.position) and self.position[index] is not None
        return self.thing(index, seen) if len(seen) == len(points) or (is_line and seen) else None

    def thing(self, index: int, label: tuple[int, ...]) -> KnownThing:
        """One of them, with its points as rows of a survey's labels."""
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
    """One known thing of a survey.

    Attributes
    ----------
    index
        Which it is among the project's: it keeps that number when others are left out.
    name, kind, value, sigma, parameters
        As in `KnownThings`; the value of a condition is NaN.
    position
        Of points on a line of known position: where that lies. Its own sigmas hold for a `sigma` of
        `LinePosition.across_m`, and grow and shrink with that.
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
        """The same with the labels' new rows (-1: gone); None where too many are gone for it."""
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

LEAST_TURN_RAD = 0.1
"""Lines whose directions differ by less count as parallel: along them nothing fixes a position."""


def lines_place(things: Iterable[KnownThing]) -> bool:
    """Whether lines of known position fix a plane figure of ground points on the map.

    East, north and heading are three numbers: it takes three points on lines, not all parallel.
    """
    on_lines = [(one.position, len(one.label)) for one in things if one.position is not None]
    if sum(count for _, count in on_lines) < 3:
        return False
    ahead = np.array([line.ends_m[1, :2] - line.ends_m[0, :2] for line, _ in on_lines])
    turn = np.arctan2(ahead[:, 1], ahead[:, 0])
    return bool((np.abs(np.sin(turn - turn[0])) > LEAST_TURN_RAD).any())
