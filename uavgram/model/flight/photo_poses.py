"""Poses that come with the photos themselves, instead of a flight log."""

from __future__ import annotations

from dataclasses import dataclass, field, fields, replace
from typing import Any

import numpy as np

from uavgram.model.arrays import Bools, Floats, Ints, freeze, freeze_as
from uavgram.model.flight.log import HeightDatum, Track

_UNSTATED: Floats = np.empty(0)


def unstated() -> Floats:
    """Stand for a column of NaN: the source of the poses does not state it."""
    return _UNSTATED


@dataclass(frozen=True, kw_only=True, eq=False)
class PhotoPoses:
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

    frame_id: tuple[str, ...]
    latitude_deg: Floats
    longitude_deg: Floats
    height_m: Floats
    height_home_m: Floats = field(default_factory=unstated)
    datum: HeightDatum
    datum_guess: str = ""
    time_utc_s: Floats = field(default_factory=unstated)
    ypr_rad: Floats = field(default_factory=unstated)
    vehicle_ypr_rad: Floats = field(default_factory=unstated)
    sigma_horizontal_m: Floats = field(default_factory=unstated)
    sigma_vertical_m: Floats = field(default_factory=unstated)
    sigma_attitude_rad: Floats = field(default_factory=unstated)
    source: str

    def __post_init__(self) -> None:
        n = len(self.frame_id)
        optional = ("latitude_deg", "longitude_deg", "height_m", "height_home_m", "time_utc_s")
        sigmas = ("sigma_horizontal_m", "sigma_vertical_m", "sigma_attitude_rad")
        shapes = {
            **dict.fromkeys((*optional, *sigmas), (n,)),
            **dict.fromkeys(("ypr_rad", "vehicle_ypr_rad"), (n, 3)),
        }
        for name, shape in shapes.items():
            if getattr(self, name) is _UNSTATED:
                object.__setattr__(self, name, np.full(shape, np.nan))
        freeze(self, may_be_nan=tuple(shapes), **shapes)

    def rows(self, index: Ints) -> PhotoPoses:
        """Pick the photos at `index` (M,), in that order."""
        columns: dict[str, Any] = {
            part.name: getattr(self, part.name)[index]
            for part in fields(self)
            if isinstance(getattr(self, part.name), np.ndarray)
        }
        return replace(self, frame_id=tuple(self.frame_id[k] for k in index), **columns)


@dataclass(frozen=True, kw_only=True, eq=False)
class PhotoExposures:
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

    frame_id: tuple[str, ...]
    position_world_m: Floats
    world_from_body: Floats
    world_from_gimbal: Floats
    sigma_position_m: Floats
    sigma_attitude_rad: Floats
    by_course: Bools
    source: str

    def __post_init__(self) -> None:
        n = len(self.frame_id)
        freeze(
            self,
            position_world_m=(n, 3),
            world_from_body=(n, 3, 3),
            world_from_gimbal=(n, 3, 3),
            sigma_position_m=(n, 2),
            sigma_attitude_rad=(n, 2),
        )
        freeze_as(self, np.bool_, by_course=(n,))


Flight = Track | PhotoExposures
"""What an exposure is looked up in: by its time, or by its photo."""
