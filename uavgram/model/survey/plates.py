"""Targets that the program found in photos: coded plates, and marks of known form."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from typing import Annotated

import numpy as np

from uavgram.model.arrays import NAN_IS_NONE, Floats, FrozenArrays


class LeftOut(Enum):
    """Why a plate that was recognised is not measured; what a message says of it."""

    NO = ""
    COVERED = "something lies across it, such as the edge of a shadow, dirt, or a wheel"
    DOUBTFUL = "what was seen there does not look enough like it: too small, or half hidden"
    TWICE = "its number is there twice in this photo, so nothing says which one is meant"
    FAINT = "it is too small or too faint there to be measured"


@dataclass(frozen=True, kw_only=True, eq=False)
class SeenPlate(FrozenArrays):
    """A plate in one photo.

    Attributes
    ----------
    plate
        Its id.
    corner_px, sigma_px
        (4, 2), (4,) of its black square, from the first corner on, as its rows of cells run; the
        standard deviation of each coordinate. NaN where a corner was not seen.
    center_px, center_sigma_px
        (2,) the place where its diagonals meet, and its standard deviation.
    score
        Correlation of a plate's picture with the photo.
    shadows
        Number of shadow edges across it.
    left_out
        Why it is not to be used.
    """

    plate: int
    corner_px: Annotated[Floats, 4, 2, NAN_IS_NONE]
    sigma_px: Annotated[Floats, 4, NAN_IS_NONE]
    center_px: Annotated[Floats, 2, NAN_IS_NONE]
    center_sigma_px: float
    score: float
    shadows: int = 0
    left_out: LeftOut = LeftOut.NO

    @property
    def side_px(self) -> float:
        """Length of its shortest side; NaN where a corner was not seen."""
        sides = np.roll(self.corner_px, -1, axis=0) - self.corner_px
        return float(np.linalg.norm(sides, axis=1).min())
