"""Lines of known position: where they lie, and how what was picked on them fits."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Literal

import numpy as np

from uavgram.model.arrays import NAN_IS_NONE, Bools, Floats, FrozenArrays

LineOfPositionStatus = Literal["used", "suspect", "removed", "checked", "unseen"]
"""As of a known thing; a line is never idle in a world that has its place."""


@dataclass(frozen=True, kw_only=True, eq=False)
class ControlLineResults(FrozenArrays):
    """L lines, in a world that has its place; NaN stands for "there is none".

    Attributes
    ----------
    name, points
        (L,) as given.
    start_world_m, end_world_m
        (L, 3) as given; without known heights, up is that of the adjusted ground.
    has_height
        (L,) whether the heights are known.
    sigma_m
        (L,) of the line's place, square to it, in its middle.
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
