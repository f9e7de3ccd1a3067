"""What ties the photos together beside picks: tie points, as they were used."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from uavgram.model.arrays import Floats, FrozenArrays, Ints


@dataclass(frozen=True, kw_only=True)
class TieSummary:
    """All tie points together; how many sightings each photo has stands with the frames.

    Attributes
    ----------
    points, sightings
        How many tie points took part, and how often they were seen in photos.
    rms_px
        Root mean square of the residuals of each coordinate [px].
    """

    points: int
    sightings: int
    rms_px: float


@dataclass(frozen=True, kw_only=True, eq=False)
class TieCloud(FrozenArrays):
    """Tie points to look at; they are too many for results.json.

    Attributes
    ----------
    position_world_m
        (T, 3) east, north, up, as adjusted.
    frame, pixel_px
        (N,), (N, 2) photos that show them (among all frames of the project), and where.
    """

    position_world_m: Annotated[Floats, "t", 3]
    frame: Annotated[Ints, "n"]
    pixel_px: Annotated[Floats, "n", 2]
