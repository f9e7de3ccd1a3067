"""What is handed over of each photo: place, attitude, accuracies."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Literal

from uavgram.model.arrays import Floats, FrozenArrays
from uavgram.model.flight.log import HeightDatum

PoseChoice = Literal["seed", "refined"]


@dataclass(frozen=True, kw_only=True, eq=False)
class GeoTags(FrozenArrays):
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

    frame_id: Annotated[tuple[str, ...], "n"]
    path: tuple[str, ...]
    pose: tuple[PoseChoice, ...]
    latitude_deg: Annotated[Floats, "n"]
    longitude_deg: Annotated[Floats, "n"]
    height_m: Annotated[Floats, "n"]
    datum: HeightDatum
    gimbal_ypr_rad: Annotated[Floats, "n", 3]
    nadir_ypr_rad: Annotated[Floats, "n", 3]
    sigma_horizontal_m: Annotated[Floats, "n"]
    sigma_vertical_m: Annotated[Floats, "n"]
