"""Matching of a corner off the ground along its line of sight, in several photos at once.

The background beside such a corner differs from photo to photo, so no patch about it matches. But
its edges do match, and its place has one unknown: the distance along the line. The place is
therefore the one where most photos share the corner (`shared_corner`). There, small windows with
the corner inside or at their edges (`beside`) are matched in each photo that shows the same in one
of them.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from uavgram.estimation.reliability.redundancy import compute_upper_tail
from uavgram.imaging.matching.least_squares import fit_patches
from uavgram.imaging.matching.match_covariance import estimate_match_covariance, is_precise
from uavgram.imaging.matching.matches import MatchOptions, RefusalReason
from uavgram.imaging.matching.occlusion import HALF_WINDOW, MIN_TEXTURE_SIGMA, make_shifted_windows
from uavgram.imaging.matching.shared_corner import (
    MIN_PHOTOS,
    SightLine,
    compute_corner_strength,
    sample_windows,
)
from uavgram.imaging.patches import Grey, compute_common_frames, sample_window
from uavgram.imaging.raster import Image
from uavgram.model.arrays import Floats, Ints

WINDOW_SHIFT = 4
"""Distance of the windows' centres from the corner in either direction [px of the source]."""

MIN_CORRELATION = 0.8
"""Correlation from which a window shows the same in a photo."""

MAX_NEXT_BEST_SHARE = 0.95
"""Largest strength of a corner at another place, relative to the best."""

OTHER_PLACE_PX = 10.0
"""Distance in some photo from which a place counts as another one."""

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
    place, why = choose_line_place(compute_corner_strength(source, targets, line), line)
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
        one = _fitted(source, targets[i], line, (place, i, support), options or MatchOptions())
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
    if np.count_nonzero(some) < MIN_PHOTOS or passed:
        refused[some] = RefusalReason.UNSTABLE
        pixel[some], covariance[some] = np.nan, np.nan
    return LineMatches(refused, pixel, covariance, score)


def _likeness(own: Grey, targets: Sequence[Image], line: SightLine) -> Floats:
    """Correlate each window at each place, (k, t, windows); -1 where it has too little texture."""
    like = np.full((*line.pixel_px.shape[:2], len(_WINDOWS.middle)), -1.0)
    for i, photo in enumerate(targets):
        rows, there = sample_windows(photo, line.pixel_px[:, i], line.affine[:, i], _REACH)
        alike, variance = _WINDOWS.likeness(own, there)
        like[rows, i] = np.where(variance > MIN_TEXTURE_SIGMA**2, alike, -1.0)
    return like


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


def _fitted(
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
