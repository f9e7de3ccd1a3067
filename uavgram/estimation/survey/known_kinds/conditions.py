"""Conditions on points without a number: right angle, collinear, coplanar, level and others."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from uavgram.estimation.survey.known_kinds.known_kind import AlikeThings, KnownKind, KnownResiduals
from uavgram.geometry.ground import conditions
from uavgram.geometry.ground.conditions import Residuals
from uavgram.model.arrays import Floats
from uavgram.model.observations import KnownThing


@dataclass(frozen=True, kw_only=True)
class Condition(KnownKind):
    """Condition, which has no value.

    Attributes
    ----------
    function
        Residuals as a function of points (N, k, 3), and of whether they are on the ground.
    count
        Number of rows of a thing, from its number of points and the number of axes across a line:
        one along the ground, and one more upwards if the points are off it.
    lines
        Whether its points are the ends of lines.
    """

    function: Callable[[Floats, bool], Residuals]
    count: Callable[[int, int], int] = lambda *_: 1
    lines: bool = False

    def departures(self, alike: AlikeThings) -> KnownResiduals:
        """Compute the residuals; 0 where there is no derivative, as no direction reduces them."""
        value, gradient = self.function(alike.world, alike.on_ground)
        return KnownResiduals(np.nan_to_num(value), np.nan_to_num(gradient))

    def row_count(self, thing: KnownThing, *, on_ground: bool) -> int:
        """Count the rows of one thing."""
        return self.count(len(thing.label), 1 if on_ground else 2)

    def points_fault(self, points: tuple[str, ...]) -> str:
        """Describe why the points are no valid ends of lines."""
        if not self.lines:
            return ""
        if len(points) % 2:
            return f"needs both ends of each line (got {len(points)} points)"
        ends = [frozenset(points[i : i + 2]) for i in range(0, len(points), 2)]
        is_twice = len(set(ends)) < len(ends)
        return "names one line twice: that adds no information" if is_twice else ""


CONDITIONS = (
    Condition(
        "right_angle",
        shown="right angle",
        points=(3, 3),
        unit="deg",
        function=lambda points, _: conditions.right_angle(points),
    ),
    Condition(
        "collinear",
        "straight line",
        "on a straight line",
        points=(3, None),
        function=lambda points, flat: conditions.collinear(points, on_ground=flat),
        count=lambda points, across: across * (points - 2),
    ),
    Condition(
        "parallel",
        "pair of parallel lines",
        "parallel lines",
        points=(4, 4),
        unit="deg",
        function=lambda points, flat: conditions.parallel(points, on_ground=flat),
        count=lambda _, across: across,
        lines=True,
    ),
    Condition(
        "coplanar",
        "plane",
        "in one plane",
        points=(4, None),
        needs="relief",
        function=lambda points, _: conditions.coplanar(points),
        count=lambda points, _: points - 3,
    ),
    Condition(
        "level",
        "level line",
        "at one height",
        points=(2, None),
        needs="tilt",
        function=lambda points, _: conditions.level(points),
        count=lambda points, _: points - 1,
    ),
    Condition(
        "vertical",
        shown="one above the other",
        points=(2, 2),
        needs="height",
        function=lambda points, _: conditions.vertical(points),
        count=lambda *_: 2,
    ),
    Condition(
        "equal_lengths",
        "set of equal lengths",
        "equally long",
        points=(4, None),
        function=lambda points, _: conditions.equal_lengths(points),
        count=lambda points, _: points // 2 - 1,
        lines=True,
    ),
)
