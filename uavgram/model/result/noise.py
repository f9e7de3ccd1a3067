"""How large errors are: as stated, and as the residuals of a survey show them."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

SurfaceShape = Literal["plane", "quadratic", "correlated"]

PICKED: dict[str, str] = {
    "hand": "picks made by hand",
    "target": "targets",
    "match": "matches",
    "tie": "tie points",
}
"""What is seen in photos, by who found it: a group of its own, with a sigma of its own."""


@dataclass(frozen=True, kw_only=True)
class PickNoise:
    """The sigma of picks of one source.

    Attributes
    ----------
    source
        How they were made: one of `PICKED`.
    stated_px
        Their sigma as stated (root mean square) [px].
    factor, sigma
        What it is multiplied by, and the standard deviation of that factor.
    """

    source: str
    stated_px: float
    factor: float
    sigma: float


@dataclass(frozen=True, kw_only=True)
class LearntSigma:
    """A sigma in metres.

    Attributes
    ----------
    stated_m
        As stated (root mean square) [m].
    factor, sigma
        What it is multiplied by, and the standard deviation of that factor.
    """

    stated_m: float
    factor: float
    sigma: float


@dataclass(frozen=True, kw_only=True)
class AreaNoise:
    """How far the ground of one area departs from its plane.

    Attributes
    ----------
    area
        Its name.
    stated_m, estimated_m, sigma_m
        Each point's own departure (roughness): as stated, as found, and the standard deviation of
        that [m].
    shape
        What else the ground is: ``quadratic`` (a crown or a hollow) or ``correlated`` (relief that
        changes smoothly); ``plane``: nothing else.
    relief_m
        Size of these smooth departures (root mean square at the points) [m]; 0 for a plane.
    probability
        Of so uneven a ground by chance, where it is as stated.
    """

    area: str
    stated_m: float
    estimated_m: float
    sigma_m: float
    shape: SurfaceShape
    relief_m: float
    probability: float = 0.0

    @property
    def size_m(self) -> float:
        """How far a point lies off the plane: roughness and smooth departures together [m]."""
        return math.hypot(self.estimated_m, self.relief_m)


@dataclass(frozen=True, kw_only=True)
class Noise:
    """What the survey says of the errors of its picks and taped lengths, and of its ground.

    `identification` is how far people pick beside what was meant, alike in all photos.
    """

    picks: tuple[PickNoise, ...]
    roughness: tuple[AreaNoise, ...]
    lengths: LearntSigma | None = None
    identification: LearntSigma | None = None

    def called(self, picks: PickNoise) -> str:
        """What picks of one source are called; just picks where people made all."""
        people_alone = [one.source for one in self.picks] == ["hand"]
        return "picks" if people_alone else PICKED[picks.source]
