"""Tie points: what several photos show of the ground, without a name."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Annotated

import numpy as np

from uavgram.model.arrays import Bools, Floats, FrozenArrays, Ints, rows_of


@dataclass(frozen=True, kw_only=True, eq=False)
class TiePicks(FrozenArrays):
    """N sightings of tie points in photos, by name.

    Attributes
    ----------
    image
        (N,) file name of the photo.
    tie
        (N,) name of the tie point; one name stands in two photos or more.
    pixel_px, sigma_px
        (N, 2), (N,) place, as of a pick, and the standard deviation of each coordinate.
    line
        (N,) line of the file; nothing where they come from no file.
    """

    image: Annotated[tuple[str, ...], "n"]
    tie: Annotated[tuple[str, ...], "n"]
    pixel_px: Annotated[Floats, "n", 2]
    sigma_px: Annotated[Floats, "n"]
    line: tuple[int, ...] = ()


NO_TIES = TiePicks(image=(), tie=(), pixel_px=np.empty((0, 2)), sigma_px=np.empty(0))


def _no_index() -> Ints:
    return np.zeros(0, dtype=np.int64)


@dataclass(frozen=True, kw_only=True, eq=False)
class Sightings(FrozenArrays):
    """N sightings of T tie points, by index.

    Attributes
    ----------
    frame, point
        (N,) which frame shows which point.
    pixel_px, sigma_px
        (N, 2), (N,) where, and the standard deviation of each coordinate.
    row
        (N,) where each stands in the table that it is from; -1: nowhere.
    pick
        (T,) the pick that a point lies under: the first of a chain of matches. Of other tie points
        nothing is known but that they are seen: -1.
    near, near_rise_m, near_sigma_m
        (T,) the label that each tie point lies beside, on the same ground; by how much the ground
        there rises from it to the label, over the area's plane, and to what sigma. -1: of none.
    """

    frame: Annotated[Ints, "n"] = field(default_factory=_no_index)
    point: Annotated[Ints, "n"] = field(default_factory=_no_index)
    pixel_px: Annotated[Floats, "n", 2] = field(default_factory=lambda: np.zeros((0, 2)))
    sigma_px: Annotated[Floats, "n"] = field(default_factory=lambda: np.zeros(0))
    row: Annotated[Ints, "n"] = field(default_factory=_no_index)
    pick: Annotated[Ints, "t"] = field(default_factory=_no_index)
    near: Annotated[Ints, "t"] = field(default_factory=_no_index)
    near_rise_m: Annotated[Floats, "t"] = field(default_factory=lambda: np.zeros(0))
    near_sigma_m: Annotated[Floats, "t"] = field(default_factory=lambda: np.zeros(0))

    def __post_init__(self) -> None:
        if not len(self.near):
            object.__setattr__(self, "near", np.full(len(self.pick), -1))
            object.__setattr__(self, "near_rise_m", np.zeros(len(self.pick)))
            object.__setattr__(self, "near_sigma_m", np.ones(len(self.pick)))
        super().__post_init__()

    @property
    def points(self) -> int:
        """Number T of tie points."""
        return len(self.pick)

    def without(self, out: Bools) -> tuple[Sightings, Ints]:
        """Those that are not in `out` (N,), and the points (T',) that are left.

        A point that is then seen once or never is left out too.
        """
        rows = np.flatnonzero(~out)
        count = np.bincount(self.point[rows], minlength=self.points)
        rows = rows[count[self.point[rows]] > 1]
        points, point = np.unique(self.point[rows], return_inverse=True)
        some = rows_of(self, rows, "n") | rows_of(self, points, "t")
        return replace(self, **some | {"point": point}), points


NO_SIGHTINGS = Sightings()
