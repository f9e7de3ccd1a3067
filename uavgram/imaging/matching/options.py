"""How much of the picture is compared, and what is asked of a match.

Tuned on rendered streets (tests/benchmarks/study_matching_kernel.py).
"""

from __future__ import annotations

from dataclasses import dataclass

from uavgram.imaging.matching.matched import Refused


@dataclass(frozen=True, kw_only=True)
class Patch:
    """How much of the picture about a point is compared.

    Attributes
    ----------
    half, other_halves
        Of the sides of the patch that is matched, and of those that must agree with it [steps].
    search_half
        Of the side of the patch that is searched [steps].
    likeness
        Least correlation after matching: a small patch alone must fit better.
    step
        Of the common window, in pixels of the coarser photo.
    after
        Why a point was refused before, to be tried with this one.
    """

    half: int
    other_halves: tuple[int, int]
    search_half: int
    likeness: float
    step: float = 1.0
    after: tuple[Refused, ...] = ()


PATCHES = (
    Patch(half=10, other_halves=(7, 15), search_half=12, likeness=0.8),
    # Where something hides part of the patch, or ends the photo, a smaller one may see it all.
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
    # What drowns in noise pixel by pixel may stand out of it in twos.
    Patch(
        half=14,
        other_halves=(10, 18),
        search_half=14,
        likeness=0.8,
        step=2.0,
        after=(Refused.WEAK,),
    ),
)
"""One after the other is tried for what was not found before."""


@dataclass(frozen=True, kw_only=True)
class MatchOptions:
    """What is asked of a match.

    Attributes
    ----------
    patches
        Tried one after the other.
    search_likeness
        Least correlation after the search.
    second_peak, second_peak_far
        Most that 1 - correlation may be of that of the next best place; in large regions, where
        every other pixel is compared, and chance alone makes one of two alike the better.
    back, agree
        Most distance from the point after matching back, and between sizes [steps].
    change, shift, gain
        Most change of the map, most way from the search's place [steps], most change of contrast
        either way.
    contrast, noisy_contrast
        Least standard deviation of a patch [grey values] whose steps are pixels, and that below
        which the noise may be why nothing looks like it.
    sigma_px
        Most standard deviation in the worse direction.
    noise_share
        Of what remains between two patches, that which moves a place: the rest is light and blur.
    bend
        How far places depart from the affine map at one pixel from the middle, half the second
        derivative [1/px]: crowns, gutters and undulation of roads, and the photos' perspective.
    floor
        What sharpening and interpolation leave at best [steps].
    farthest
        Most steps from the prediction that are searched.
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
