"""One photo with known lengths, drawn many times: what is common, what is drawn, what is found."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from uavgram.model.arrays import NAN_IS_NONE, Bools, Floats, FrozenArrays, Ints
from uavgram.model.camera.calibration import Calibration


@dataclass(frozen=True, kw_only=True, eq=False)
class PhotoDesign(FrozenArrays):
    """What all draws have in common.

    Attributes
    ----------
    calibration
        The camera; its covariance is not read.
    height_m
        (E,) of the ends above the ground.
    line
        (L, 2) ends of the lengths.
    pixel_sigma_px, length_sigma_m
        (E,) of each coordinate, (L,).
    information
        (6, 6) inverse covariance of the pose beforehand: (δcentre world, δθ camera); 0 where
        nothing is known. Where it leaves the pose's place or heading free altogether, any small
        number there holds the pose without moving a length.
    camera_root
        (P, K) what K unknowns, each normal with sigma 1, do to the camera's parameters: a root of
        their covariance. None: the camera is exact.
    ground_root
        (3, G) what G unknowns, each normal with sigma 1, do to the ground's plane. None: it is
        exact.
    tape_scale_sigma
        Of the tape, a share of all lengths; 0: it is exact.
    """

    calibration: Calibration
    height_m: Annotated[Floats, "e"]
    line: Annotated[Ints, "l", 2]
    pixel_sigma_px: Annotated[Floats, "e"]
    length_sigma_m: Annotated[Floats, "l"]
    information: Annotated[Floats, 6, 6]
    camera_root: Floats | None = None
    ground_root: Floats | None = None
    tape_scale_sigma: float = 0.0


@dataclass(frozen=True, kw_only=True, eq=False)
class PhotoDraws(FrozenArrays):
    """B draws.

    Attributes
    ----------
    pixel_px, length_m
        (B, E, 2) of the ends, (B, L) readings.
    center_world_m, world_from_camera
        (B, 3), (B, 3, 3) the pose beforehand.
    ground
        (B, 3) the ground's plane beforehand: height at the origin [m], slopes to east and north.
    """

    pixel_px: Annotated[Floats, "b", "e", 2]
    length_m: Annotated[Floats, "b", "l"]
    center_world_m: Annotated[Floats, "b", 3]
    world_from_camera: Annotated[Floats, "b", 3, 3]
    ground: Annotated[Floats, "b", 3]


@dataclass(frozen=True, kw_only=True, eq=False)
class PhotoPosesFound(FrozenArrays):
    """B adjusted poses.

    Attributes
    ----------
    center_world_m, world_from_camera, covariance
        (B, 3), (B, 3, 3), (B, 6, 6) as of `Poses`; without a covariance where one did not come
        to rest.
    place_m
        (B, E, 3) of the ends.
    common
        (B, K) the unknowns of camera, ground and tape, in that order; K = 0 where all are exact.
    cost
        (B,) weighted sum of squares.
    converged, steps
        (B,) whether it came to rest, and after how many steps.
    """

    center_world_m: Annotated[Floats, "b", 3]
    world_from_camera: Annotated[Floats, "b", 3, 3]
    covariance: Annotated[Floats, "b", 6, 6, NAN_IS_NONE]
    place_m: Annotated[Floats, "b", "e", 3, NAN_IS_NONE]
    common: Annotated[Floats, "b", "k", NAN_IS_NONE]
    cost: Annotated[Floats, "b", NAN_IS_NONE]
    converged: Annotated[Bools, "b"]
    steps: Annotated[Ints, "b"]
