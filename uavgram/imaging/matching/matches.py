"""Points to be matched in another photo, requirements on matches, and reasons for refusal.

The requirements are tuned on rendered streets (tests/benchmarks/study_matching_kernel.py).
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum
from typing import Annotated

from uavgram.model.arrays import NAN_IS_NONE, Floats, FrozenArrays, Ints


class RefusalReason(IntEnum):
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


REASON_TEXTS: dict[RefusalReason, str] = {
    RefusalReason.NONE: "found",
    RefusalReason.OUTSIDE: "too close to the edge of the photo",
    RefusalReason.WEAK: "the picture is too even there",
    RefusalReason.NOT_LIKE: "nothing there looks like it",
    RefusalReason.NOT_UNIQUE: "several places look like it",
    RefusalReason.NOT_BACK: "what looks like it is something else",
    RefusalReason.UNSTABLE: "what surrounds it has changed, or is not flat",
    RefusalReason.DISTORTED: "what surrounds it has changed its shape",
    RefusalReason.TOO_FAR: "its place is known too poorly to search for it",
    RefusalReason.OFF_GROUND: "it may be off the ground",
}
"""Text of each reason, to follow "not found: "."""


@dataclass(frozen=True, kw_only=True, eq=False)
class SoughtPoints(FrozenArrays):
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
class Matches(FrozenArrays):
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
        (n,) a `RefusalReason`, as a number.
    """

    pixel_px: Annotated[Floats, "n", 2, NAN_IS_NONE]
    covariance_px2: Annotated[Floats, "n", 2, 2, NAN_IS_NONE]
    sigma_px: Annotated[Floats, "n", NAN_IS_NONE]
    score: Annotated[Floats, "n"]
    refused: Annotated[Ints, "n"]

    def __len__(self) -> int:
        return len(self.score)


@dataclass(frozen=True, kw_only=True)
class Patch:
    """Size of the patch about a point that is compared.

    Attributes
    ----------
    half, other_halves
        Half sides of the matched patch, and of the patches that must agree with it [steps].
    search_half
        Half side of the patch in the search [steps].
    likeness
        Least correlation after matching: a small patch alone must fit better.
    step
        Step of the common window, in pixels of the coarser photo.
    after
        Reasons of an earlier refusal after which this patch is tried.
    """

    half: int
    other_halves: tuple[int, int]
    search_half: int
    likeness: float
    step: float = 1.0
    after: tuple[RefusalReason, ...] = ()


PATCHES = (
    Patch(half=10, other_halves=(7, 15), search_half=12, likeness=0.8),
    # A smaller patch may be complete where part of the larger one is hidden or outside the photo.
    Patch(
        half=7,
        other_halves=(5, 9),
        search_half=8,
        likeness=0.95,
        after=(
            RefusalReason.OUTSIDE,
            RefusalReason.NOT_LIKE,
            RefusalReason.NOT_BACK,
            RefusalReason.UNSTABLE,
            RefusalReason.DISTORTED,
        ),
    ),
    # Averages over two pixels may show texture that is hidden in noise.
    Patch(
        half=14,
        other_halves=(10, 18),
        search_half=14,
        likeness=0.8,
        step=2.0,
        after=(RefusalReason.WEAK,),
    ),
)
"""Patches, tried in this order for points not found before."""


@dataclass(frozen=True, kw_only=True)
class MatchOptions:
    """Requirements on a match.

    Attributes
    ----------
    patches
        Patches, tried in this order.
    search_likeness
        Least correlation after the search.
    second_peak, second_peak_far
        Largest ratio of 1 - correlation to that of the next best place; the second in large
        regions, where every other pixel is compared, and chance alone makes one of two equal places
        the better.
    back, agree
        Largest distance from the point after matching back, and between sizes [steps].
    change, shift, gain
        Largest change of the map, largest distance from the search's place [steps], largest factor
        of the contrast either way.
    contrast, noisy_contrast
        Least standard deviation of a patch [grey values] whose steps are pixels; and that below
        which noise may explain a missing match.
    sigma_px
        Largest standard deviation in the worse direction.
    noise_share
        Share of the residuals between two patches that moves a place: the rest is light and blur.
    bend
        Departure of places from the affine map at one pixel from the middle, half the second
        derivative [1/px]: crowns, gutters and undulation of roads, and the photos' perspective.
    floor
        Least error left by sharpening and interpolation [steps].
    farthest
        Largest distance from the prediction that is searched [steps].
    """

    patches: tuple[Patch, ...] = PATCHES
    search_likeness: float = 0.75
    second_peak: float = 0.75
    second_peak_far: float = 0.5
    back: float = 0.3
    agree: float = 0.35
    change: float = 0.2
    shift: float = 2.0
    gain: float = 2.0
    contrast: float = 1.5
    noisy_contrast: float = 6.0
    sigma_px: float = 0.3
    noise_share: float = 0.72
    bend: float = 4e-4
    floor: float = 0.01
    farthest: int = 420
