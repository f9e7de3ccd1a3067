"""Poses that come with the photos themselves, instead of a flight log."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from typing import Annotated

import numpy as np

from uavgram.model.arrays import NAN_IS_NONE, Bools, Floats, FrozenArrays, Ints, rows_of
from uavgram.model.flight.log import HeightDatum, Track

_UNSTATED: Floats = np.empty(0)


def unstated() -> Floats:
    """Stand for a column of NaN: the source of the poses does not state it."""
    return _UNSTATED


@dataclass(frozen=True, kw_only=True, eq=False)
class PhotoPoses(FrozenArrays):
    """N photos with a place each, and perhaps an attitude, as their source states them.

    Attributes
    ----------
    frame_id
        (N,) names of photos, each once, in the order of the names.
    latitude_deg, longitude_deg
        (N,) WGS 84, of the camera; NaN where only another source has it.
    height_m
        (N,) above `datum`; NaN where the place is.
    height_home_m
        (N,) above the take-off point; NaN where unknown.
    datum
        What `height_m` is above.
    datum_guess
        Why this datum was assumed; empty where the source states it.
    time_utc_s
        (N,) UTC seconds since the Unix epoch, where the source itself states the exposure (not
        the camera's clock); NaN elsewhere.
    ypr_rad
        (N, 3) yaw (from north), pitch, roll, Z-Y-X, of the gimbal: x the optical axis, -z image
        up, so pitch -90 degrees looks straight down; NaN where unknown.
    vehicle_ypr_rad
        (N, 3) of the vehicle, body FRD; NaN where unknown.
    sigma_horizontal_m, sigma_vertical_m, sigma_attitude_rad
        (N,) standard deviations of each axis; NaN where the source states none.
    source
        What they were read from, in words.
    """

    frame_id: Annotated[tuple[str, ...], "n"]
    latitude_deg: Annotated[Floats, "n", NAN_IS_NONE]
    longitude_deg: Annotated[Floats, "n", NAN_IS_NONE]
    height_m: Annotated[Floats, "n", NAN_IS_NONE]
    height_home_m: Annotated[Floats, "n", NAN_IS_NONE] = field(default_factory=unstated)
    datum: HeightDatum
    datum_guess: str = ""
    time_utc_s: Annotated[Floats, "n", NAN_IS_NONE] = field(default_factory=unstated)
    ypr_rad: Annotated[Floats, "n", 3, NAN_IS_NONE] = field(default_factory=unstated)
    vehicle_ypr_rad: Annotated[Floats, "n", 3, NAN_IS_NONE] = field(default_factory=unstated)
    sigma_horizontal_m: Annotated[Floats, "n", NAN_IS_NONE] = field(default_factory=unstated)
    sigma_vertical_m: Annotated[Floats, "n", NAN_IS_NONE] = field(default_factory=unstated)
    sigma_attitude_rad: Annotated[Floats, "n", NAN_IS_NONE] = field(default_factory=unstated)
    source: str

    def __post_init__(self) -> None:
        n = len(self.frame_id)
        for name, value in vars(self).copy().items():
            if value is _UNSTATED:
                shape = (n, 3) if name.endswith("ypr_rad") else (n,)
                object.__setattr__(self, name, np.full(shape, np.nan))
        super().__post_init__()

    def rows(self, index: Ints) -> PhotoPoses:
        """Pick the photos at `index` (M,), in that order."""
        return replace(self, **rows_of(self, index))


@dataclass(frozen=True, kw_only=True, eq=False)
class PhotoExposures(FrozenArrays):
    """Photo poses in the local world: exposures that no clock can move.

    Attributes
    ----------
    frame_id
        (N,) names.
    position_world_m
        (N, 3) of the reference point that the source states.
    world_from_body
        (N, 3, 3) the vehicle, in whose axes the lever arm is given.
    world_from_gimbal
        (N, 3, 3) the gimbal: x optical axis, -z image up.
    sigma_position_m
        (N, 2) horizontal and vertical.
    sigma_attitude_rad
        (N, 2) of roll and pitch, and of yaw.
    by_course
        (N,) True where the yaw is only the course from photo to photo.
    source
        Where they come from.
    """

    frame_id: Annotated[tuple[str, ...], "n"]
    position_world_m: Annotated[Floats, "n", 3]
    world_from_body: Annotated[Floats, "n", 3, 3]
    world_from_gimbal: Annotated[Floats, "n", 3, 3]
    sigma_position_m: Annotated[Floats, "n", 2]
    sigma_attitude_rad: Annotated[Floats, "n", 2]
    by_course: Annotated[Bools, "n"]
    source: str

    def rows_of(self, names: Iterable[str]) -> Ints:
        """(n,) row of each name."""
        row = {name: k for k, name in enumerate(self.frame_id)}
        return np.array([row[name] for name in names], dtype=np.int64)


Flight = Track | PhotoExposures
"""What an exposure is looked up in: by its time, or by its photo."""
