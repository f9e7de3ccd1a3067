"""Tie points: unnamed points of the ground that several photos show."""

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
        (N,) name of the tie point; a name occurs in two photos or more.
    pixel_px, sigma_px
        (N, 2), (N,) position, in the convention of picks, and the standard deviation of each
        coordinate.
    line
        (N,) line of the file; empty where they come from no file.
    """

    image: Annotated[tuple[str, ...], "n"]
    tie: Annotated[tuple[str, ...], "n"]
    pixel_px: Annotated[Floats, "n", 2]
    sigma_px: Annotated[Floats, "n"]
    line: tuple[int, ...] = ()


NO_TIES = TiePicks(image=(), tie=(), pixel_px=np.empty((0, 2)), sigma_px=np.empty(0))


MIN_WEIGHT_SHARE = 0.5
"""Smallest remaining share of the weights of a label's ties at which they are still used."""


def _no_index() -> Ints:
    return np.zeros(0, dtype=np.int64)


@dataclass(frozen=True, kw_only=True, eq=False)
class GroundConstraints(FrozenArrays):
    """Constraints on the ground height at B labels, each from m tie points around it.

    Attributes
    ----------
    label
        (B,) by index.
    tie, weight
        (B, m) tie points, and the weights of their heights above the area's plane in that of the
        label.
    sigma_m
        (B,) of the weighted height, apart from the prior that the ground is even; NaN where they do
        not determine the height.
    uneven
        (B,) unevenness of the ground there as a multiple of that of the area.
    """

    label: Annotated[Ints, "b"] = field(default_factory=_no_index)
    tie: Annotated[Ints, "b", "m"] = field(default_factory=lambda: np.zeros((0, 0), dtype=np.int64))
    weight: Annotated[Floats, "b", "m"] = field(default_factory=lambda: np.zeros((0, 0)))
    sigma_m: Annotated[Floats, "b", NAN_IS_NONE] = field(default_factory=lambda: np.zeros(0))
    uneven: Annotated[Floats, "b"] = field(default_factory=lambda: np.zeros(0))

    def of_labels(self, new_label: Ints) -> GroundConstraints:
        """Return the rows of labels with new indices (K,); without those of dropped labels (-1)."""
        kept = rows_of(self, np.flatnonzero(new_label[self.label] >= 0), "b")
        return replace(self, **kept | {"label": new_label[kept["label"]]})

    def of_ties(self, new_point: Ints) -> GroundConstraints:
        """Return it with the new indices of the tie points (T,), -1 for dropped ones.

        The other points replace them: their weights are rescaled and their sigma grows. A label
        that has lost most of its weights gets no height (NaN).
        """
        if not len(self.label):
            return self
        tie = np.append(new_point, -1)[self.tie]
        weight = np.where(tie >= 0, self.weight, 0.0)
        left = np.abs(weight).sum(axis=1) / np.abs(self.weight).sum(axis=1)
        says = left > MIN_WEIGHT_SHARE
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
        (N,) frame and point of each sighting.
    pixel_px, sigma_px
        (N, 2), (N,) position, and the standard deviation of each coordinate.
    row
        (N,) row of each in the table from which it comes; -1: none.
    pick
        (T,) pick that shows the same point: the first of a chain of matches; -1 for points without
        a pick.
    constraints
        Constraints from ties on the ground at labels near them.
    """

    frame: Annotated[Ints, "n"] = field(default_factory=_no_index)
    point: Annotated[Ints, "n"] = field(default_factory=_no_index)
    pixel_px: Annotated[Floats, "n", 2] = field(default_factory=lambda: np.zeros((0, 2)))
    sigma_px: Annotated[Floats, "n"] = field(default_factory=lambda: np.zeros(0))
    row: Annotated[Ints, "n"] = field(default_factory=_no_index)
    pick: Annotated[Ints, "t"] = field(default_factory=_no_index)
    constraints: GroundConstraints = field(default_factory=GroundConstraints)

    @property
    def points(self) -> int:
        """Number T of tie points."""
        return len(self.pick)

    def without(self, out: Bools) -> tuple[Sightings, Ints]:
        """Return the sightings outside the mask `out` (N,), and the points (T',) that are left.

        A point that is then seen once or never is left out too.
        """
        rows = np.flatnonzero(~out)
        count = np.bincount(self.point[rows], minlength=self.points)
        rows = rows[count[self.point[rows]] > 1]
        points, point = np.unique(self.point[rows], return_inverse=True)
        some = rows_of(self, rows, "n") | rows_of(self, points, "t")
        new_point = np.full(self.points, -1)
        new_point[points] = np.arange(len(points))
        beside = self.constraints.of_ties(new_point)
        return replace(self, **some | {"point": point}, constraints=beside), points


NO_SIGHTINGS = Sightings()
