"""A camera that reads the rows of a photo one after the other, while it moves."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import numpy as np

from uavgram.model.arrays import Floats, FrozenArrays
from uavgram.model.camera.readout import Readout

LOGGED_RATE_RAD_S = 0.03
"""How well a log says how fast a camera turns, 1.7 degrees a second: attitudes good to 0.1 degree,
ten times a second, and a mount that shakes in between."""


@dataclass(frozen=True, kw_only=True, eq=False)
class RollingShutter(FrozenArrays):
    """What an adjustment needs to find the readout time.

    Attributes
    ----------
    readout
        What is known of it beforehand.
    motion
        (F, 6) of each frame at its exposure: velocity [m/s], in the world or, where the survey's
        gauge is free, in camera axes; angular rate in camera axes [rad/s].
    rate_sigma_rad_s
        How well `motion` says how fast a camera turns.
    by_photos
        Whether no log says how the camera moved: `motion` is then the way from photo to photo, in
        the time between them or at a usual speed, and the unknown is a readout time at that speed.
    """

    readout: Readout
    motion: Annotated[Floats, "f", 6]
    rate_sigma_rad_s: float = LOGGED_RATE_RAD_S
    by_photos: bool = False

    @property
    def first_value(self) -> Floats:
        """(1,) the readout time beforehand [s]."""
        return np.array([self.readout.value_s])
