"""What is handed over of each photo: place, attitude, accuracies."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from uavgram.model.arrays import Floats, freeze
from uavgram.model.flight.log import HeightDatum

PoseChoice = Literal["seed", "refined"]


@dataclass(frozen=True, kw_only=True, eq=False)
class GeoTags:
    """N photos as other programs want to know them.

    Attributes
    ----------
    frame_id, path
        (N,) name, and where the photo is.
    pose
        (N,) which pose the row was made of.
    latitude_deg, longitude_deg, height_m
        (N,) WGS 84 of the projection centre, height above `datum`.
    datum
        What the heights are above.
    gimbal_ypr_rad, nadir_ypr_rad
        (N, 3) yaw, pitch, roll in both conventions of geometry/motion/nadir_angles.py, yaw in
        [0, 2 pi).
    sigma_horizontal_m, sigma_vertical_m
        (N,) the larger axis of the horizontal standard ellipse, and of the height.
    """

    frame_id: tuple[str, ...]
    path: tuple[str, ...]
    pose: tuple[PoseChoice, ...]
    latitude_deg: Floats
    longitude_deg: Floats
    height_m: Floats
    datum: HeightDatum
    gimbal_ypr_rad: Floats
    nadir_ypr_rad: Floats
    sigma_horizontal_m: Floats
    sigma_vertical_m: Floats

    def __post_init__(self) -> None:
        n = len(self.frame_id)
        freeze(self, latitude_deg=(n,), longitude_deg=(n,), height_m=(n,))
        freeze(self, gimbal_ypr_rad=(n, 3), nadir_ypr_rad=(n, 3))
        freeze(self, sigma_horizontal_m=(n,), sigma_vertical_m=(n,))
