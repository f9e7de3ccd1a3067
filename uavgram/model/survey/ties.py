"""Tie points: what several photos show of the ground, without a name."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Annotated

import numpy as np

from uavgram.model.arrays import NAN_IS_NONE, Bools, Floats, FrozenArrays, Ints, rows_of


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


MOST_LEFT = 0.5
"""Share of the weights of the ties around a label that are left, from which on they still tell."""


def _no_index() -> Ints:
    return np.zeros(0, dtype=np.int64)


@dataclass(frozen=True, kw_only=True, eq=False)
class Beside(FrozenArrays):
    """What ties say of the ground below B labels, each from m ties around it.

    Attributes
    ----------
    label
        (B,) by index.
    tie, weight
        (B, m) tie points, and the weights with which their heights over the area's plane make that
        of the label.
    sigma_m
        (B,) of what they make, beside the prior that the ground is even; NaN where they say nothing
        of the height.
    uneven
        (B,) how many times as uneven as the area's ground is the ground there.
    """

    label: Annotated[Ints, "b"] = field(default_factory=_no_index)
    tie: Annotated[Ints, "b", "m"] = field(default_factory=lambda: np.zeros((0, 0), dtype=np.int64))
    weight: Annotated[Floats, "b", "m"] = field(default_factory=lambda: np.zeros((0, 0)))
    sigma_m: Annotated[Floats, "b", NAN_IS_NONE] = field(default_factory=lambda: np.zeros(0))
    uneven: Annotated[Floats, "b"] = field(default_factory=lambda: np.zeros(0))

    def of_labels(self, new_label: Ints) -> Beside:
        """Of the labels by their new indices (K,); without those that have none (-1)."""
        kept = rows_of(self, np.flatnonzero(new_label[self.label] >= 0), "b")
        return replace(self, **kept | {"label": new_label[kept["label"]]})

    def of_ties(self, new_point: Ints) -> Beside:
        """By the new indices of the tie points (T,); some are gone (-1).

        The others stand in for them: with what is left of the weights their sigma grows. Of the
        height of a label that has lost most of them, nothing is said.
        """
        if not len(self.label):
            return self
        tie = np.append(new_point, -1)[self.tie]
        weight = np.where(tie >= 0, self.weight, 0.0)
        left = np.abs(weight).sum(axis=1) / np.abs(self.weight).sum(axis=1)
        says = left > MOST_LEFT
        left = np.where(says, left, 1.0)
        first = np.take_along_axis(tie, np.argmax(np.abs(weight), axis=1)[:, None], axis=1)
        return replace(
            self,
            tie=np.where(tie >= 0, tie, first),
            weight=np.where(says[:, None], weight / left[:, None], self.weight),
            sigma_m=np.where(says, self.sigma_m / left, np.nan),
        )


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
    beside
        What ties say of labels beside them, on the same ground.
    """

    frame: Annotated[Ints, "n"] = field(default_factory=_no_index)
    point: Annotated[Ints, "n"] = field(default_factory=_no_index)
    pixel_px: Annotated[Floats, "n", 2] = field(default_factory=lambda: np.zeros((0, 2)))
    sigma_px: Annotated[Floats, "n"] = field(default_factory=lambda: np.zeros(0))
    row: Annotated[Ints, "n"] = field(default_factory=_no_index)
    pick: Annotated[Ints, "t"] = field(default_factory=_no_index)
    beside: Beside = field(default_factory=Beside)

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
        new_point = np.full(self.points, -1)
        new_point[points] = np.arange(len(points))
        beside = self.beside.of_ties(new_point)
        return replace(self, **some | {"point": point}, beside=beside), points


NO_SIGHTINGS = Sightings()
