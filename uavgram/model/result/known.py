"""Known quantities and lines of position, as given and as adjusted."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Literal

import numpy as np

from uavgram.model.arrays import NAN_IS_NONE, Bools, Floats, FrozenArrays

LineOfPositionStatus = Literal["used", "suspect", "removed", "checked", "unseen"]
"""Status as of a known quantity; never ``idle``, as a line always constrains a placed world."""


@dataclass(frozen=True, kw_only=True, eq=False)
class ControlLineResults(FrozenArrays):
    """L lines of position in a georeferenced world; NaN means "there is none".

    Attributes
    ----------
    name, points
        (L,) as given.
    start_world_m, end_world_m
        (L, 3) as given; without known heights, up is that of the adjusted ground.
    has_height
        (L,) whether the heights are known.
    sigma_m
        (L,) of the line's position, perpendicular to it, in its middle.
    offset_m
        (L,) of the adjusted points from the line, in plan: the largest, positive to the left.
    w, redundancy, mdb_m
        (L,) as in `KnownResults`, where each line has its row too.
    status
        (L,) as there.
    """

    name: Annotated[tuple[str, ...], "n"]
    points: tuple[tuple[str, ...], ...]
    start_world_m: Annotated[Floats, "n", 3]
    end_world_m: Annotated[Floats, "n", 3]
    has_height: Annotated[Bools, "n"]
    sigma_m: Annotated[Floats, "n"]
    offset_m: Annotated[Floats, "n", NAN_IS_NONE]
    w: Annotated[Floats, "n", NAN_IS_NONE]
    redundancy: Annotated[Floats, "n", NAN_IS_NONE]
    mdb_m: Annotated[Floats, "n", NAN_IS_NONE]
    status: tuple[LineOfPositionStatus, ...]


NO_LINES_OF_POSITION = ControlLineResults(
    name=(),
    points=(),
    start_world_m=np.empty((0, 3)),
    end_world_m=np.empty((0, 3)),
    has_height=np.empty(0, dtype=np.bool_),
    sigma_m=np.empty(0),
    offset_m=np.empty(0),
    w=np.empty(0),
    redundancy=np.empty(0),
    mdb_m=np.empty(0),
    status=(),
)


KnownStatus = Literal["used", "suspect", "removed", "checked", "unseen", "idle"]


@dataclass(frozen=True, kw_only=True, eq=False)
class KnownResults(FrozenArrays):
    """N known quantities; NaN means "there is none".

    Attributes
    ----------
    name, kind, points
        (N,) as given.
    value, sigma
        (N,) as given, in `unit`; a condition (a right angle, points in line) has no value.
    unit
        (N,) m, m2 or deg.
    adjusted, adjusted_sigma
        (N,) the value between the adjusted points, and its sigma. For a condition, its misclosure:
        for several numbers (offsets of points from a line) the root of the sum of squares, without
        a sigma.
    residual
        (N,) adjusted less given; for a condition the same as `adjusted`.
    w, redundancy, mdb
        (N,) Baarda's standardised residual, redundancy number and minimal detectable bias; for
        several numbers the largest w (in magnitude), the mean redundancy, and the largest bias. For
        withheld ones w is the error over the joint sigma (for several numbers, a normal deviate as
        unlikely as their chi-square), the others NaN.
    status
        (N,) ``used``, ``suspect``, ``removed``, ``checked`` (withheld), ``unseen``, ``idle`` (all
        of its points are on the ground, which it does not constrain).
    """

    name: Annotated[tuple[str, ...], "n"]
    kind: tuple[str, ...]
    points: tuple[tuple[str, ...], ...]
    value: Annotated[Floats, "n", NAN_IS_NONE]
    sigma: Annotated[Floats, "n"]
    unit: tuple[str, ...]
    adjusted: Annotated[Floats, "n", NAN_IS_NONE]
    adjusted_sigma: Annotated[Floats, "n", NAN_IS_NONE]
    residual: Annotated[Floats, "n", NAN_IS_NONE]
    w: Annotated[Floats, "n", NAN_IS_NONE]
    redundancy: Annotated[Floats, "n", NAN_IS_NONE]
    mdb: Annotated[Floats, "n", NAN_IS_NONE]
    status: tuple[KnownStatus, ...]


NOTHING_KNOWN = KnownResults(
    name=(),
    kind=(),
    points=(),
    value=np.empty(0),
    sigma=np.empty(0),
    unit=(),
    adjusted=np.empty(0),
    adjusted_sigma=np.empty(0),
    residual=np.empty(0),
    w=np.empty(0),
    redundancy=np.empty(0),
    mdb=np.empty(0),
    status=(),
)
