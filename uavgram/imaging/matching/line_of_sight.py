"""Matching of a corner off the ground along its line of sight, in several photos at once.

The background beside such a corner differs from photo to photo, so a patch around it does not
match. The directions of its edges do match. The place has one unknown, the distance along the line
of sight of the pick:

1. At each distance the edge directions around the pick are compared with those in the other photos.
   At the height of the corner, both edges that meet in it agree; at another height one may, but
   hardly both. Weak edges count nearly as much as strong ones, as the second edge of a corner is
   often weak.
2. The distance at which most photos share a corner at the pick is the place of the corner.
3. There, small windows with the corner inside or at their edges (`beside`) are matched by least
   squares in each photo in which one of them looks alike.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from uavgram.estimation.reliability.redundancy import compute_upper_tail
from uavgram.imaging.matching.least_squares import (
    MatchOptions,
    RefusalReason,
    estimate_match_covariance,
    fit_patches,
    is_precise,
)
from uavgram.imaging.matching.match import HALF_WINDOW, MIN_TEXTURE_SIGMA, make_shifted_windows
from uavgram.imaging.patches import (
    Grey,
    compute_common_frames,
    compute_slopes,
    make_grid,
    sample_grey,
    sample_window,
)
from uavgram.imaging.raster import Image
from uavgram.model.arrays import Bools, Floats, Ints

SCALE_BOUNDS = 0.25, 4.0
"""Least and largest scale of a photo against the source for a comparison."""

BLUR_SIGMA_PX = 2.5
"""Sigma of the Gaussian weights about the pick for edges [px of the source]."""

EDGE_STEP = 2.0
"""Slope [grey values a pixel] from which an edge counts at least 0.7; noise is below."""

CHANCE_CORRELATION = 0.2
"""Similarity of edges that unrelated places reach."""

MIN_STRENGTH_SHARE = 0.4
"""Similarity in all photos together, relative to the best place, from which corners are tested."""

MIN_AGREEING_SHARE = 0.7
"""Share of the photos in view that must agree on a pixel's edge.

Others may hide the corner; one always may, where there are enough photos.
"""

MIN_PHOTOS = 2
"""Least number of agreeing photos besides the source: a single one agrees somewhere on the line."""

CORNER_SIGMA_PX = 1.2
"""Standard deviation of a corner's place about its pick [px]."""

MIN_STRENGTH = 0.05, 0.125
"""Least strength of a corner, and an addition to it for few photos.

The addition is divided by (n - 1)^2 with the number n of photos that must agree: fewer photos agree
more often by chance. Measured on rendered streets.
"""

_CORNER_REACH = 6
_SAMPLED = _CORNER_REACH + 1  # slopes need one more on either side

_INNER: Grey = make_grid(_CORNER_REACH).astype(np.float32)
_BELL: Grey = np.exp(-0.5 * (_INNER**2).sum(axis=1) / BLUR_SIGMA_PX**2).astype(np.float32)
_BELL = np.asarray(_BELL / _BELL.sum())


class SightLine(NamedTuple):
    """Line of sight of a pixel in t photos, from the lowest place upwards.

    Attributes
    ----------
    source_px
        (2,) the pixel.
    pixel_px
        (k, t, 2) places of the line; NaN where a photo does not show one.
    affine
        (k, t, 2, 2) d pixel there / d pixel in the source, for a level surface.
    lowest
        Index of the first place that may be the corner's; those before it are the ground.
    """

    source_px: Floats
    pixel_px: Floats
    affine: Floats
    lowest: int


def compute_corner_strength(source: Image, targets: Sequence[Image], line: SightLine) -> Floats:
    """Compute the strength (k,) of the corner that most photos share with the source.

    It is the smaller eigenvalue of the structure tensor of the shared edges (Foerstner and Guelch
    1987), reduced where the edges do not meet at the pick, relative to the required strength: 1 or
    more is a corner.

    Parameters
    ----------
    source
        (height, width) grey photo, uint8.
    targets
        t others.
    line
        Line of sight of the corner.
    """
    slope, own = _edges(_resample_windows(source, line.source_px[None], np.eye(2)[None], _SAMPLED))
    like = _alike(targets, line, own[0])
    beside = np.pad(like, ((1, 1), (0, 0)), constant_values=-1.0)
    steps = np.stack([beside[1:-1], beside[:-2], beside[2:]])  # neighbours, too: poses have errors
    together = np.clip(steps.max(axis=0) - CHANCE_CORRELATION, 0.0, None).sum(axis=1)
    in_view = np.count_nonzero(like > -1.0, axis=1)
    together[in_view < MIN_PHOTOS] = 0.0
    strength = np.zeros(len(like))
    rows = np.flatnonzero(together > MIN_STRENGTH_SHARE * together.max(initial=0.0))
    if rows.size:
        best = np.array([0, -1, 1])[steps.argmax(axis=0)] + np.arange(len(like))[:, None]
        agree = _agreement(targets, line, own[0], (best[rows], like[rows] > -1.0))
        # For each pixel, the agreement that the required number of photos reach.
        need = np.minimum(
            np.ceil(MIN_AGREEING_SHARE * in_view[rows]).astype(int), in_view[rows] - 1
        )
        need = np.maximum(need, MIN_PHOTOS)
        agree.sort(axis=1)
        most = agree[np.arange(len(agree)), agree.shape[1] - need].clip(0.0)
        always, alone = MIN_STRENGTH
        strength[rows] = _measure_corner_strength(most, slope[0]) / (
            always + alone / (need - 1) ** 2
        )
    return strength


def sample_windows(photo: Image, pixel: Floats, affine: Floats, reach: int) -> tuple[Ints, Grey]:
    """Resample the windows that a photo shows whole and at a similar scale.

    Parameters
    ----------
    photo
        Grey photo.
    pixel, affine
        (k, 2) their middles, and (k, 2, 2) d pixel there / d pixel in the source.
    reach
        Half their side [px of the source].

    Returns
    -------
    Their indices (n,), and grey values (n, s).
    """
    far = np.abs(affine).sum(axis=2) * reach + 2.0
    with np.errstate(invalid="ignore"):
        inside = (pixel >= far) & (pixel <= np.array(photo.shape[1::-1]) - 1 - far)
    size = np.linalg.svd(np.nan_to_num(affine), compute_uv=False)
    as_large = (size[:, 1] > SCALE_BOUNDS[0]) & (size[:, 0] < SCALE_BOUNDS[1])
    shown = np.flatnonzero(inside.all(axis=1) & as_large)
    return shown, _resample_windows(photo, pixel[shown], affine[shown], reach)


def _resample_windows(photo: Image, pixel: Floats, affine: Floats, reach: int) -> Grey:
    """Resample grey values (n, s) about pixels, as in `sample_windows`."""
    u, v = np.moveaxis(pixel[:, None] + make_grid(reach) @ np.swapaxes(affine, 1, 2), -1, 0)
    return sample_grey(photo, u, v)


def _edges(grey: Grey) -> tuple[Grey, Grey]:
    """Compute slopes (n, 2, s) of grey values, and the direction of the edges there.

    A direction is that of twice the angle, so that an edge from dark to light and one from light to
    dark agree; its length is 0 on even ground to 1 at a clear edge.
    """
    side = 2 * _CORNER_REACH + 3
    field = grey.reshape(-1, side, side)
    u, v = (one.reshape(len(grey), len(_BELL)) for one in compute_slopes(field))
    square = u**2 + v**2
    weight = 1.0 / np.sqrt(np.maximum(square * (square + EDGE_STEP**2), 1e-12))
    return np.stack([u, v], axis=1), np.stack([(u**2 - v**2) * weight, 2 * u * v * weight], axis=1)


def _alike(targets: Sequence[Image], line: SightLine, own: Grey) -> Grey:
    """Correlate edges about each place with those at the pick (2, s); -1 where not shown.

    The result is (k, t).
    """
    like = np.full(line.pixel_px.shape[:2], -1.0, np.float32)
    weighted = (own * _BELL).ravel()
    size = float(weighted @ own.ravel())
    for i, photo in enumerate(targets):
        rows, grey = sample_windows(photo, line.pixel_px[:, i], line.affine[:, i], _SAMPLED)
        _, there = _edges(grey)
        both = there.reshape(len(rows), weighted.size) @ weighted
        sizes = (there**2).sum(axis=1) @ _BELL * size
        like[rows, i] = both / np.sqrt(np.maximum(sizes, 1e-9))
    return like


def _agreement(
    targets: Sequence[Image], line: SightLine, own: Grey, places: tuple[Ints, Bools]
) -> Grey:
    """Compute the agreement (n, t, s) of each photo's edges with those about the pick, at most 1.

    Parameters
    ----------
    targets, line
        As for `compute_corner_strength`.
    own
        (2, s) directions about the pick.
    places
        (n, t) indices of places, and flags whether photos show them; the agreement is -1 where not.
    """
    place, seen = places
    agree = np.full((*place.shape, len(_BELL)), -1.0, np.float32)
    for i, photo in enumerate(targets):
        rows = np.flatnonzero(seen[:, i])
        at = place[rows, i]
        grey = _resample_windows(photo, line.pixel_px[at, i], line.affine[at, i], _SAMPLED)
        agree[rows, i] = (_edges(grey)[1] * own).sum(axis=1)
    return agree


def _measure_corner_strength(agreed: Grey, slope: Grey) -> Floats:
    """Compute the strength (n,) of the corner that shared edges (n, s) form.

    `slope` is (2, s) of the source.
    """
    ahead = slope / np.maximum(np.hypot(*slope), 1e-6)
    weight = agreed * _BELL
    along = (ahead.T * _INNER).sum(axis=1)
    uu, uv, vv = weight @ ahead[0] ** 2, weight @ (ahead[0] * ahead[1]), weight @ ahead[1] ** 2
    u, v = weight @ (ahead[0] * along), weight @ (ahead[1] * along)
    # Smaller eigenvalue of the weighted structure tensor.
    weaker = 0.5 * (uu + vv) - np.hypot(0.5 * (uu - vv), uv)
    size = uu * vv - uv**2 + 1e-7
    off = np.stack([vv * u - uv * v, uu * v - uv * u]) / size  # intersection of the edges
    return np.asarray(weaker * np.exp(-0.5 * (off**2).sum(axis=0) / CORNER_SIGMA_PX**2), np.float64)


WINDOW_SHIFT = 4
"""Distance of the windows' centres from the corner in either direction [px of the source]."""

MIN_CORRELATION = 0.8
"""Correlation from which a window shows the same in a photo."""

SHARED_CORRELATION = 0.7
"""Correlation about the pick, in most photos, from which half of the variance is of one thing."""

MAX_NEXT_BEST_SHARE = 0.95
"""Largest strength of a corner at another place, relative to the best."""

OTHER_PLACE_PX = 10.0
"""Distance in some photo from which a place counts as another one."""

AROUND_PX = 2.5 * CORNER_SIGMA_PX
"""Distance [px of the source] of other pixels that are compared with the pick: no corner there
counts as one at the pick."""

AROUND = 8
"""Number of these pixels."""

AS_STRONG_AROUND = 3
"""Number of neighbouring pixels as strong as the pick from which it is no corner, but a point of an
edge or of a texture: these go on in two directions at least, and a corner beside the pick is near
two of the pixels."""

FITTED_HALF, FITTED_STEPS = 9, 12
MAX_OFF_LINE_PX = 1.5
"""Largest distance in one photo from the common place: errors of poses."""

POSE_SIGMA_PX, SIGNIFICANCE = 0.5, 0.01
"""Standard deviation of a coordinate of this distance, and least probability over all photos.

Less likely distances mean that the line of sight passes another corner, such as that of a roof's
edge before a wall.
"""

FITTED_SIGMA_PX = 0.5
"""Largest sigma of the matching in one photo: single photos are weak at an edge, but all agree."""

_REACH = HALF_WINDOW + WINDOW_SHIFT
_WINDOWS = make_shifted_windows(WINDOW_SHIFT)
_CENTRE = len(_WINDOWS.middle) // 2  # the window about the pick itself


class LineMatches(NamedTuple):
    """Matches of a corner.

    Attributes
    ----------
    refused
        (t,) for each photo, a `RefusalReason` as a number.
    pixel_px, covariance_px2
        (t, 2), (t, 2, 2) of the matching in each photo; NaN where refused.
    score
        (t,) correlation in the most similar window.
    """

    refused: Ints
    pixel_px: Floats
    covariance_px2: Floats
    score: Floats


def match_along_line(
    source: Image, targets: Sequence[Image], line: SightLine, options: MatchOptions | None = None
) -> LineMatches:
    """Find the corner in each photo.

    Parameters
    ----------
    source
        (height, width) grey photo, uint8.
    targets
        t others.
    line
        Line of sight of the corner.
    options
        Requirements on a match.
    """
    t = len(targets)
    refused = np.full(t, int(RefusalReason.NOT_LIKE))
    pixel, covariance = np.full((t, 2), np.nan), np.full((t, 2, 2), np.nan)
    score = np.zeros(t)
    _, own = sample_windows(source, line.source_px[None], np.eye(2)[None], _REACH)
    if not len(own):
        refused[:] = RefusalReason.OUTSIDE
        return LineMatches(refused, pixel, covariance, score)
    # Find the place on the line where most photos share the corner.
    strength = compute_corner_strength(source, targets, line)
    place, why = choose_line_place(strength, line)
    if why == RefusalReason.NONE and not _is_corner_at_pick(
        source, targets, line, (place, strength[place])
    ):
        why = RefusalReason.NOT_UNIQUE
    if why != RefusalReason.NONE:
        refused[:] = why
        return LineMatches(refused, pixel, covariance, score)
    near = slice(place - 1, place + 2)  # neighbours, too: poses have errors
    beside = line._replace(pixel_px=line.pixel_px[near], affine=line.affine[near])
    like = _likeness(own[0], targets, beside).max(axis=0)
    # Choose the window with the most correlation in all photos; match it in each photo.
    support = int(np.clip(like - MIN_CORRELATION, 0.0, None).sum(axis=0).argmax())
    score = like[:, support].clip(0.0, 1.0)
    for i in np.flatnonzero(score > MIN_CORRELATION).tolist():
        one = _fit_match(source, targets[i], line, (place, i, support), options or MatchOptions())
        if one is None:
            refused[i] = RefusalReason.UNSTABLE
        else:
            refused[i] = RefusalReason.NONE
            pixel[i], covariance[i] = one
    some = refused == RefusalReason.NONE
    # Chi-square test of the distances from the common place.
    moved = pixel[some] - line.pixel_px[place, some]
    passed = (
        compute_upper_tail(float(np.sum(moved**2)) / POSE_SIGMA_PX**2, moved.size) < SIGNIFICANCE
    )
    shown = [
        _likeness_at_click(own[0], targets[i], pixel[i], line.affine[place, i])
        for i in np.flatnonzero(some).tolist()
    ]
    if len(shown) < MIN_PHOTOS or passed or np.median(shown) < SHARED_CORRELATION:
        refused[some] = RefusalReason.UNSTABLE
        pixel[some], covariance[some] = np.nan, np.nan
    return LineMatches(refused, pixel, covariance, score)


def _is_corner_at_pick(
    source: Image, targets: Sequence[Image], line: SightLine, found: tuple[int, float]
) -> bool:
    """Return whether the shared corner is at the pick, and not as strong all around it.

    A click a pixel beside a corner may be on the edge of another thing before it. That edge, with
    the texture beside it, is the same in all photos, but so are its neighbouring points.

    Parameters
    ----------
    source, targets, line
        As for `match_along_line`.
    found
        Place of the corner on the line, and its strength.
    """
    place, strength = found
    near = slice(max(place - 2, 0), place + 3)
    affine = line.affine[near]
    count = 0
    for turn in 2.0 * np.pi * np.arange(AROUND) / AROUND:
        step = AROUND_PX * np.array([np.cos(turn), np.sin(turn)])
        beside = line._replace(
            source_px=line.source_px + step,
            pixel_px=line.pixel_px[near] + affine @ step,
            affine=affine,
        )
        count += bool(compute_corner_strength(source, targets, beside).max() >= strength)
    return count < AS_STRONG_AROUND


def _likeness(own: Grey, targets: Sequence[Image], line: SightLine) -> Floats:
    """Correlate each window at each place, (k, t, windows); -1 where it has too little texture."""
    like = np.full((*line.pixel_px.shape[:2], len(_WINDOWS.middle)), -1.0)
    for i, photo in enumerate(targets):
        rows, there = sample_windows(photo, line.pixel_px[:, i], line.affine[:, i], _REACH)
        alike, variance = _WINDOWS.likeness(own, there)
        like[rows, i] = np.where(variance > MIN_TEXTURE_SIGMA**2, alike, -1.0)
    return like


def _likeness_at_click(own: Grey, target: Image, pixel: Floats, affine: Floats) -> float:
    """Correlate the window centred on the click with a pixel's in a photo; -1 if not shown."""
    _, there = sample_windows(target, pixel[None], affine[None], _REACH)
    return float(_WINDOWS.likeness(own, there)[0][:, _CENTRE].max(initial=-1.0))


def choose_line_place(strength: Floats, line: SightLine) -> tuple[int, RefusalReason]:
    """Choose the place of the corner on the line, or give the reason why there is none.

    Parameters
    ----------
    strength
        (k,) strength of the corner that photos share at each place of the line; 1 or more is a
        corner.
    line
        Line of sight.
    """
    place = int(strength.argmax())
    gap = np.linalg.norm(line.pixel_px - line.pixel_px[place], axis=2)
    apart = np.nan_to_num(gap).max(axis=1) > OTHER_PLACE_PX
    if strength[apart].max(initial=0.0) > MAX_NEXT_BEST_SHARE * strength[place]:
        return place, RefusalReason.NOT_UNIQUE
    if strength[place] < 1.0:
        return place, RefusalReason.NOT_LIKE
    if place <= line.lowest or place >= len(strength) - 2:
        return place, RefusalReason.NOT_UNIQUE
    return place, RefusalReason.NONE


def _fit_match(
    source: Image,
    target: Image,
    line: SightLine,
    which: tuple[int, int, int],
    options: MatchOptions,
) -> tuple[Floats, Floats] | None:
    """Match one photo by least squares in the most similar window: pixel and covariance.

    Parameters
    ----------
    source, target
        Grey photos.
    line
        Line of sight of the corner.
    which
        Place, photo and window.
    options
        Requirements on a match.
    """
    place, photo, support = which
    start = line.pixel_px[place, photo]
    frames = compute_common_frames(line.affine[place, photo][None])
    near = sample_window(source, line.source_px, frames.source[0], FITTED_HALF + 4)
    far = sample_window(target, start, frames.target[0], FITTED_HALF + 4)
    # Match with the weights centred on the chosen window.
    middle = np.linalg.solve(frames.source[0], _WINDOWS.middle[support])
    found = fit_patches(
        near[None],
        far[None],
        np.zeros((1, 2)),
        np.eye(2)[None],
        FITTED_HALF,
        FITTED_STEPS,
        bell=(middle, float(HALF_WINDOW)),
    )
    into = frames.target[0]
    moved = into @ found.place[0]
    spread = into @ estimate_match_covariance(found, options)[0] @ into.T
    change = np.linalg.norm(found.linear[0] - np.eye(2), ord=2)
    # Accept only near the common place, well correlated, undistorted and precise.
    right = (
        np.hypot(*moved) < MAX_OFF_LINE_PX
        and found.likeness[0] > MIN_CORRELATION
        and change < options.change
        and bool(is_precise(spread[None], FITTED_SIGMA_PX)[0])
    )
    return (start + moved, spread) if right else None
