"""What the orientation of the photos and the camera have in common: correlations."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from uavgram.model.arrays import NAN_IS_NONE, Floats, FrozenArrays

POSE_NAMES = ("east", "north", "up", "turn about right", "turn about down", "turn about forward")
"""Of the six unknowns of a pose: centre in the world, and small turns about the camera's axes."""


@dataclass(frozen=True, kw_only=True, eq=False)
class OrientationCorrelation(FrozenArrays):
    """Correlations of the adjusted poses with what all photos share, to four decimals.

    Those within one pose follow from its covariance. NaN stands where something is known exactly.

    Attributes
    ----------
    parameters
        (P,) names of what is shared: the lens model's parameters, height and slopes of the ground
        plane, and the readout time where that is an unknown.
    shared
        (P, P) among these.
    frame_id
        (F,) adjusted photos.
    with_pose
        (F, 6, P) of each pose with them.
    """

    parameters: tuple[str, ...]
    shared: Annotated[Floats, "p", "p", NAN_IS_NONE]
    frame_id: Annotated[tuple[str, ...], "n"]
    with_pose: Annotated[Floats, "n", 6, "p", NAN_IS_NONE]
