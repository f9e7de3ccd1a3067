"""Least-squares matching of two patches: the affine map, its covariance, and requirements on it.

Gruen 1985, "Adaptive least squares correlation", with brightness and contrast free; solved by the
inverse compositional algorithm (Baker and Matthews 2004, "Lucas-Kanade 20 years on"): gradients are
those of the fixed patch, so the normal equations are formed once. The poses predict rotation and
stretch of the patches to some per cent; this prior matters where the picture has little texture.

The requirements are tuned on rendered streets (tests/benchmarks/study_matching_kernel.py).

The normal equations of the matching alone are too optimistic where a picture has little texture:

- Noise has slopes, too. A shift of the patch is determined by the slopes that both photos show;
  those of the fixed patch alone include the slopes of its noise, and so promise too much.
- Noise of neighbouring pixels is correlated by JPEG and resampling. The effective number of pixels
  is smaller than their count.
- Ground is not flat: where the place depends on a distant edge, it errs as the ground bends.

So the covariance is that of an M-estimator (Huber 1967, "The behavior of maximum likelihood
estimates under nonstandard conditions"), with all three effects.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum
from typing import Annotated, NamedTuple

import cv2
import numpy as np

from uavgram.imaging.patches import (
    Grey,
    compute_slopes,
    estimate_neighbour_correlation,
    make_grid,
    sample_grey,
)
from uavgram.model.arrays import NAN_IS_NONE, Bools, Floats, FrozenArrays, Ints

CHANGE_SIGMA = 0.05
"""Prior sigma of each element of the affine map, from errors of poses and ground slopes."""

MAP_PRIOR = np.diag([0.0, 0.0, 1.0, 1.0, 1.0, 1.0])
"""Selects the parameters with a prior: four of the six, the elements of the affine map."""

_ROUNDING = 0.4  # standard deviation of the difference of two rounded grey values
_CONVERGED = 2e-3  # steps
_MAX_SHIFT = 6.0  # steps from the start: farther is no refinement
_MOST_ROWS = 30000  # of an image that OpenCV can resample


class System(NamedTuple):
    """Fixed patches: grid, weights, normalised values and their derivatives by the map."""

    grid: Floats  # (k, 2)
    weight: Floats  # (k,)
    value: Floats  # (m, k) mean 0, weighted variance 1
    contrast: Floats  # (m,)
    by: Floats  # (m, 6, k) change of the values by the map's parameters


class PatchFits(NamedTuple):
    """Matches of m patches.

    Attributes
    ----------
    place
        (m, 2) the fixed window's middle in the moving window, steps from its middle.
    linear
        (m, 2, 2) d moving / d fixed.
    likeness
        (m,) weighted correlation after matching.
    gain
        (m,) contrast of the moving patch over that of the fixed one.
    fixed
        Fixed patches.
    value
        (m, k) values of the moving patches at the match, normalised like the fixed ones.
    """

    place: Floats
    linear: Floats
    likeness: Floats
    gain: Floats
    fixed: System
    value: Floats

    @property
    def contrast(self) -> Floats:
        """(m,) weighted standard deviation of the fixed patches [grey values]."""
        return self.fixed.contrast

    def some(self, chosen: Bools) -> PatchFits:
        """Select patches by a mask (m,)."""
        fixed = self.fixed._replace(
            value=self.fixed.value[chosen],
            contrast=self.fixed.contrast[chosen],
            by=self.fixed.by[chosen],
        )
        return PatchFits(
            place=self.place[chosen],
            linear=self.linear[chosen],
            likeness=self.likeness[chosen],
            gain=self.gain[chosen],
            fixed=fixed,
            value=self.value[chosen],
        )


def fit_patches(
    fixed: Grey,
    moving: Grey,
    start: Floats,
    linear: Floats,
    half: int,
    steps: int,
    bell: tuple[Floats, float] | None = None,
) -> PatchFits:
    """Match the middle of fixed windows in moving ones.

    Parameters
    ----------
    fixed, moving
        (m, s, s) windows.
    start
        (m, 2) start values of the places.
    linear
        (m, 2, 2) start values of the maps.
    half
        Half the patch's side.
    steps
        Largest number of iterations.
    bell
        Middle (2,) of the weights in the patch, and the distance from it at which they have fallen
        to 0.14; by default the patch's own middle and half side.
    """
    system = _system(fixed, half, *(bell or (np.zeros(2), float(half))))
    everyone = np.arange(len(start))
    place, linear = start.copy(), linear.copy()
    value, _ = _resample_windows(moving, everyone, place, linear, system)
    # Normal equations of the fixed patch, formed once; pull is the weight of the prior on the map.
    inverse, pull = _inverse(system, compute_residual_variance(system, value, 2))
    gain = inverse @ (system.by * system.weight)
    active = everyone
    for step in range(steps):
        if step:
            value, _ = _resample_windows(moving, active, place, linear, system)
        changed = (linear[active] - np.eye(2)).reshape(-1, 4)
        delta = (gain[active] @ (value - system.value[active])[..., None])[..., 0]
        delta += pull[active, None] * (inverse[active][..., 2:] @ changed[..., None])[..., 0]
        # Inverse composition: the update of the fixed patch is inverted and applied to the moving
        # one.
        back = np.linalg.inv(np.eye(2) + delta[:, 2:].reshape(-1, 2, 2))
        linear[active] = linear[active] @ back
        move = (linear[active] @ delta[:, :2, None])[..., 0]
        place[active] -= move
        size = np.hypot(*move.T)
        near = np.hypot(*(place[active] - start[active]).T) < _MAX_SHIFT
        active = active[(size > _CONVERGED) & near & np.isfinite(size)]
        if not len(active):
            break
    value, contrast = _resample_windows(moving, everyone, place, linear, system)
    return PatchFits(
        place=place,
        linear=linear,
        likeness=(value * system.value) @ system.weight / system.weight.sum(),
        gain=contrast / system.contrast,
        fixed=system,
        value=value,
    )


def compute_residual_variance(system: System, value: Floats, unknowns: int) -> Floats:
    """Compute the variance (m,) of the residuals between the fixed patches and others (m, k).

    It is at least that of rounding to whole grey values.

    Parameters
    ----------
    system
        Fixed patches.
    value
        Values of the other patches, normalised alike.
    unknowns
        Number of parameters fitted to both.
    """
    weight = system.weight
    # Effective number of pixels of the weighted sum.
    number = weight.sum() ** 2 / (weight**2).sum()
    rest = (value - system.value) ** 2 @ weight / weight.sum() * number / (number - unknowns)
    return np.asarray(np.maximum(rest, (_ROUNDING / system.contrast) ** 2))


def _inverse(system: System, noise: Floats) -> tuple[Floats, Floats]:
    """Compute inverse normal equations (m, 6, 6) with the prior of the map, and its weight (m,)."""
    normal = (system.by * system.weight) @ np.swapaxes(system.by, 1, 2)
    normal += (1e-9 * np.trace(normal, axis1=1, axis2=2) + 1e-12)[:, None, None] * np.eye(6)
    pull = noise / CHANGE_SIGMA**2
    normal += pull[:, None, None] * MAP_PRIOR
    return np.asarray(np.linalg.inv(normal), np.float64), pull


def _system(fixed: Grey, half: int, middle: Floats, wide: float) -> System:
    steps = make_grid(half)
    weight: Floats = np.exp(-2.0 * ((steps - middle) ** 2).sum(axis=1) / wide**2)
    middle = fixed.shape[1] // 2
    cut = slice(middle - half - 1, middle + half + 2)
    patch = fixed[:, cut, cut].astype(np.float64)
    slope = np.stack(compute_slopes(patch), axis=1).reshape(len(fixed), 2, len(steps))
    value, contrast = _normalise(patch[:, 1:-1, 1:-1].reshape(len(fixed), -1), weight)
    slope /= contrast[:, None, None]
    by = np.concatenate([slope, *(slope[:, [i]] * steps.T for i in range(2))], axis=1)
    # Eliminate brightness and contrast: project their effects out of the derivatives.
    by -= (by @ weight / weight.sum())[..., None]
    by -= (by @ (weight * value)[..., None] / weight.sum()) * value[:, None]
    return System(steps, weight, value, contrast, by)


def _resample_windows(
    moving: Grey, index: Ints, place: Floats, linear: Floats, system: System
) -> tuple[Floats, Floats]:
    """Resample moving windows at mapped grids; return normalised values and contrasts."""
    side = moving.shape[1]
    at = system.grid @ np.swapaxes(linear[index], 1, 2) + place[index][:, None] + side // 2
    at = np.clip(at, 0.0, side - 1.0)
    out = np.empty(at.shape[:2])
    block = _MOST_ROWS // side
    for first in range(0, len(index), block):
        u, v = np.moveaxis(at[first : first + block].astype(np.float32), -1, 0)
        tall = moving[index[first : first + block]].reshape(-1, side)
        v = v + np.arange(len(v), dtype=np.float32)[:, None] * side
        out[first : first + block] = sample_grey(tall, u, v, cv2.INTER_LANCZOS4)
    return _normalise(out, system.weight)


def _normalise(value: Floats, weight: Floats) -> tuple[Floats, Floats]:
    """Normalise values (m, k) to weighted mean 0 and variance 1; return also (m,) deviations."""
    total = weight.sum()
    centred: Floats = value - (value @ weight / total)[:, None]
    deviation: Floats = np.sqrt(centred**2 @ weight / total) + 1e-6
    return centred / deviation[:, None], deviation


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
    RefusalReason.NOT_BACK: "only something else looks like it",
    RefusalReason.UNSTABLE: "its surroundings have changed, or are not flat",
    RefusalReason.DISTORTED: "its surroundings have changed their shape",
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
    is_confirmed
        (n,) whether the point was clicked in another photo, too.
    """

    source_px: Annotated[Floats, "n", 2]
    target_px: Annotated[Floats, "n", 2]
    covariance_px2: Annotated[Floats, "n", 2, 2]
    affine: Annotated[Floats, "n", 2, 2]
    rise: Annotated[Floats, "n", 2]
    is_confirmed: Annotated[Bools, "n"]

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


def estimate_match_covariance(found: PatchFits, options: MatchOptions, step: float = 1.0) -> Floats:
    """Compute covariances (m, 2, 2) of places [steps].

    Parameters
    ----------
    found
        m places.
    options
        Noise share, bend of the ground, and floor.
    step
        Step of the patches [px].
    """
    noise, bent = _compute_noise_and_bend_covariances(found)
    return (
        options.noise_share**2 * noise
        + (options.bend * step) ** 2 * bent
        + options.floor**2 * np.eye(2)
    )


def is_precise(covariance: Floats, sigma: float) -> Bools:
    """Mark covariances (m, 2, 2) that are positive, and below a sigma in every direction.

    The covariance of an estimator with correlated noise is not positive by construction.
    """
    least, largest = np.linalg.eigvalsh(covariance).T
    return np.asarray((least > 0.0) & (largest < sigma**2))


def _compute_noise_and_bend_covariances(found: PatchFits) -> tuple[Floats, Floats]:
    """Compute covariances (m, 2, 2) of the residual noise, and of a bend of one per step."""
    fixed = found.fixed
    side = round(len(fixed.grid) ** 0.5)
    noise = compute_residual_variance(fixed, found.value, 8)
    own = fixed.by * fixed.weight
    other = _slopes(found.value.reshape(-1, side, side), fixed.grid)
    pull = noise / CHANGE_SIGMA**2
    # Sensitivity of the M-estimator: products of the slopes of both photos, and the prior of the
    # map.
    answer = own @ np.swapaxes(other, 1, 2) + pull[:, None, None] * MAP_PRIOR
    solved = found.linear @ np.linalg.inv(answer + 1e-12 * np.eye(6))[:, :2]
    gain = solved @ own
    # Noise of the fixed patch has no effect along its own slopes: sums of n (n+ - n-) vanish.
    both = 0.5 * (gain + solved @ (other * fixed.weight))
    of_noise = noise[:, None, None] * (gain @ np.swapaxes(_spread(both, found), 1, 2))
    # Effect of the prior, and of a bend with unit second derivatives.
    known = solved[:, :, 2:] * (pull * CHANGE_SIGMA)[:, None, None]
    u, v = fixed.grid.T
    second = np.stack([u * u, u * v, v * v])
    bent = np.concatenate([gain @ np.swapaxes(fixed.by[:, [i]] * second, 1, 2) for i in (0, 1)], 2)
    return (
        0.5 * (of_noise + np.swapaxes(of_noise, 1, 2)) + known @ np.swapaxes(known, 1, 2),
        bent @ np.swapaxes(bent, 1, 2),
    )


def _slopes(value: Floats, grid: Floats) -> Floats:
    """Compute derivatives (m, 6, k) of the moving patches' values (m, s, s) by the map."""
    down, across = np.gradient(value, axis=(1, 2))
    slope = np.stack([across, down], axis=1).reshape(len(value), 2, len(grid))
    return np.concatenate([slope, *(slope[:, [i]] * grid.T for i in range(2))], axis=1)


def _spread(gain: Floats, found: PatchFits) -> Floats:
    """Multiply gains (m, 2, k) by the correlations of the residuals in the pixels.

    These decay with each step along rows and columns by the neighbours' correlation: a first-order
    process is all that one patch can determine.
    """
    side = round(gain.shape[2] ** 0.5)
    root = np.sqrt(found.fixed.weight).reshape(side, side)
    rest = (found.value - found.fixed.value).reshape(-1, side, side) * root
    apart = np.abs(np.arange(side)[:, None] - np.arange(side))
    alike: Floats = estimate_neighbour_correlation(rest, root)[..., None, None, None] ** apart
    square: Floats = gain.reshape(len(gain), 2, side, side)
    return np.asarray((alike[1] @ square @ alike[0]).reshape(gain.shape))
