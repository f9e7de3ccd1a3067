"""Lines of known position: two points with known coordinates, and what is picked between them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Literal

import numpy as np

from uavgram.model.arrays import NAN_IS_NONE, Bools, Floats, FrozenArrays

ON_LINE = "on_line"
"""Kind of the known thing that such a line is."""

STRAIGHTNESS_M = 0.005
"""How far picked points may lie beside a line for which nothing is stated."""


@dataclass(frozen=True, kw_only=True, eq=False)
class ControlLines(FrozenArrays):
    """L lines with known coordinates, geodetic or local, as the file has them.

    Attributes
    ----------
    name, points
        (L,) what each is called, and the labels that were picked somewhere on it.
    kind
        ``geodetic``: (latitude_deg, longitude_deg, height_m); ``local``: (east_m, north_m, up_m)
        in the world's axes.
    coordinates
        (L, 2, 3) of start and end, as `kind` says; NaN for heights that are not known.
    sigma_m
        (L, 2, 3) of each: east, north, up; NaN where the height is not known.
    straightness_m
        (L,) sigma of how far a point that was picked lies beside the line.
    adjust
        (L,) True: an observation; False: withheld, only judged.
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
    """Where one line lies in the world.

    Attributes
    ----------
    ends_m
        (2, 3) start and end; without known heights their third coordinates are 0 and mean nothing.
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
        """Sigma of the place of its middle, square to it in plan."""
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
