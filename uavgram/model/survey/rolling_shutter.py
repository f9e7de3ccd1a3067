"""A camera that reads the rows of a photo one after the other, while it moves."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import numpy as np

from uavgram.model.arrays import Floats, FrozenArrays
from uavgram.model.camera.readout import Readout


@dataclass(frozen=True, kw_only=True, eq=False)
class RollingShutter(FrozenArrays):
    """What an adjustment needs to find the readout time.

    Attributes
    ----------
    readout
        What is known of it beforehand.
    motion
        (F, 6) of each frame at its exposure: velocity in the world [m/s], angular rate in camera
        axes [rad/s].
    """

    readout: Readout
    motion: Annotated[Floats, "f", 6]

    @property
    def first_value(self) -> Floats:
        """(1,) the readout time beforehand [s]."""
        return np.array([self.readout.value_s])
