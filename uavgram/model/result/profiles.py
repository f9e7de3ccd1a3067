"""Points along a line: what a profile of them shows."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Annotated

import numpy as np

from uavgram.model.arrays import Floats, FrozenArrays, Ints
from uavgram.model.columns import Column

COLUMNS = ("station", "offset", "height", "ground")
"""What is told of each point of a profile."""
PLACE_KEYS = tuple(f"{name}_m" for name in COLUMNS)
SIGMA_KEYS = tuple(f"{name}_sigma_m" for name in COLUMNS)


@dataclass(frozen=True, kw_only=True, eq=False)
class ProfileResults(FrozenArrays):
    """N points of profiles, one profile after the other.

    A profile runs from its first point to its last, seen from above.

    Attributes
    ----------
    profile
        (N,) name of the profile.
    label
        (N,) name of the point.
    place_m
        (N, 4) station from the first point; offset, to the right of the line positive; height over
        the first point; height of the ground below over the first point.
    sigma_m
        (N, 4) their standard deviations; 0 where that is so by definition.
    """

    profile: Annotated[tuple[str, ...], "n"]
    label: tuple[str, ...]
    place_m: Annotated[Floats, "n", 4, Column(keys=PLACE_KEYS, axes=COLUMNS, stem="")]
    sigma_m: Annotated[Floats, "n", 4, Column(keys=SIGMA_KEYS, axes=COLUMNS)]

    def each(self) -> Iterator[tuple[str, Ints]]:
        """Name of every profile, and the rows of its points."""
        for name in dict.fromkeys(self.profile):
            yield name, np.array([i for i, one in enumerate(self.profile) if one == name])


NO_PROFILES = ProfileResults(
    profile=(), label=(), place_m=np.zeros((0, 4)), sigma_m=np.zeros((0, 4))
)
