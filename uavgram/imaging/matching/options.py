"""Patch sizes, and requirements on a match.

Tuned on rendered streets (tests/benchmarks/study_matching_kernel.py).
"""

from __future__ import annotations

from dataclasses import dataclass

from uavgram.imaging.matching.matched import Refused


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
    after: tuple[Refused, ...] = ()


PATCHES = (
    Patch(half=10, other_halves=(7, 15), search_half=12, likeness=0.8),
    # A smaller patch may be complete where part of the larger one is hidden or outside the photo.
    Patch(
        half=7,
        other_halves=(5, 9),
        search_half=8,
        likeness=0.95,
        after=(
            Refused.OUTSIDE,
            Refused.NOT_LIKE,
            Refused.NOT_BACK,
            Refused.UNSTABLE,
            Refused.DISTORTED,
        ),
    ),
    # Averages over two pixels may show texture that is hidden in noise.
    Patch(
        half=14,
        other_halves=(10, 18),
        search_half=14,
        likeness=0.8,
        step=2.0,
        after=(Refused.WEAK,),
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
