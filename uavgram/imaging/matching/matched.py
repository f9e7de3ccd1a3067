"""Points to be matched in another photo, their matches, and reasons for refusal."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum
from typing import Annotated

from uavgram.model.arrays import NAN_IS_NONE, Floats, FrozenArrays, Ints


class Refused(IntEnum):
    """Reason why a point was not found; NONE where it was."""

    NONE = 0
    OUTSIDE = 1
    """The patch, or the whole search region, is not within both photos."""
    WEAK = 2
    """The picture around the point has too little texture."""
    NOT_LIKE = 3
    """Nothing in the region resembles it: hidden, moved, or in another light."""
    NOT_UNIQUE = 4
    """Two or more places resemble it: a repeated marking, or an edge along itself."""
    NOT_BACK = 5
    """Matching back from the target does not return to the point."""
    UNSTABLE = 6
    """Patches of different sizes find different places: not one flat piece of ground."""
    DISTORTED = 7
    """The patch fits only with more rotation or stretch than the poses allow."""
    TOO_FAR = 8
    """The search region is too large: better poses are needed first."""
    OFF_GROUND = 9
    """One side of it is, or may be, at another height than the rest."""


REASON: dict[Refused, str] = {
    Refused.NONE: "found",
    Refused.OUTSIDE: "too close to the edge of the photo",
    Refused.WEAK: "the picture is too even there",
    Refused.NOT_LIKE: "nothing there looks like it",
    Refused.NOT_UNIQUE: "several places look like it",
    Refused.NOT_BACK: "what looks like it is something else",
    Refused.UNSTABLE: "what surrounds it has changed, or is not flat",
    Refused.DISTORTED: "what surrounds it has changed its shape",
    Refused.TOO_FAR: "its place is known too poorly to search for it",
    Refused.OFF_GROUND: "it may be off the ground",
}
"""Text of each reason, to follow "not found: "."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Sought(FrozenArrays):
    """n points of one photo (the source) to be found in another (the target).

    Attributes
    ----------
    source_px
        (n, 2) pixels (u, v) in the source, (0, 0) = centre of the top-left pixel.
    target_px
        (n, 2) predicted pixels in the target.
    covariance_px2
        (n, 2, 2) of the predictions, (u, v); their 99.9 % region is searched.
    affine
        (n, 2, 2) d target pixel / d source pixel, through poses and ground.
    rise
        (n, 2) d target pixel / d height [px/m] of the point; 0 where its height is known.
    """

    source_px: Annotated[Floats, "n", 2]
    target_px: Annotated[Floats, "n", 2]
    covariance_px2: Annotated[Floats, "n", 2, 2]
    affine: Annotated[Floats, "n", 2, 2]
    rise: Annotated[Floats, "n", 2]

    def __len__(self) -> int:
        return len(self.source_px)


@dataclass(frozen=True, kw_only=True, eq=False)
class Matched(FrozenArrays):
    """Matches of n points in the target.

    Attributes
    ----------
    pixel_px
        (n, 2) pixels (u, v) in the target; NaN where refused.
    covariance_px2
        (n, 2, 2) of the matching alone, (u, v), without the error of the pick in the source; NaN
        where refused.
    sigma_px
        (n,) root of the mean variance of u and v; NaN where refused.
    score
        (n,) correlation of the patches after matching, 0 to 1; where refused the best one found, 0
        where nothing was compared.
    refused
        (n,) a `Refused`, as a number.
    """

    pixel_px: Annotated[Floats, "n", 2, NAN_IS_NONE]
    covariance_px2: Annotated[Floats, "n", 2, 2, NAN_IS_NONE]
    sigma_px: Annotated[Floats, "n", NAN_IS_NONE]
    score: Annotated[Floats, "n"]
    refused: Annotated[Ints, "n"]

    def __len__(self) -> int:
        return len(self.score)
