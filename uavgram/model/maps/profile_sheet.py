"""The drawing of one profile: its points, and the axes that show them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from uavgram.model.arrays import Floats, FrozenArrays


@dataclass(frozen=True, kw_only=True, eq=False)
class ProfileSheet(FrozenArrays):
    """Points along a line in their order, and axes with round numbers.

    Attributes
    ----------
    name
        Of the profile.
    label
        (N,) names of the points.
    station_m, height_m, ground_m
        (N,) along the line from its first point; heights of point and ground over the first point.
    station_sigma_m, height_sigma_m, ground_sigma_m
        (N,) their standard deviations.
    station_ticks_m, height_ticks_m
        Round numbers; first and last are the ends of the axes.
    exaggeration
        Heights are drawn so many times larger than lengths.
    """

    name: str
    label: Annotated[tuple[str, ...], "n"]
    station_m: Annotated[Floats, "n"]
    height_m: Annotated[Floats, "n"]
    ground_m: Annotated[Floats, "n"]
    station_sigma_m: Annotated[Floats, "n"]
    height_sigma_m: Annotated[Floats, "n"]
    ground_sigma_m: Annotated[Floats, "n"]
    station_ticks_m: Annotated[Floats, "s"]
    height_ticks_m: Annotated[Floats, "h"]
    exaggeration: int

    @property
    def origin(self) -> str:
        """The point from which stations and heights count."""
        return self.label[0]
