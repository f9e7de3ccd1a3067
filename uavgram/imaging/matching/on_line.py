"""A corner that stands off the ground, found along its line of sight in several photos at once.

What is seen beside such a corner is another thing in each photo, so a patch about it is nowhere
alike. But part of it lies on the thing itself, and its place has one unknown: how far along the
line it is. So small windows, the corner within or at their edges (shiftable windows: Kang, Szeliski
and Chai 2001, "Handling occlusions in dense multi-view stereo"), are compared in all photos at all
places of the line, and the place is the one where several photos are alike in the same window.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import cv2
import numpy as np

from uavgram.imaging.matching.least_squares import fitted
from uavgram.imaging.matching.matched import Refused
from uavgram.imaging.matching.options import MatchOptions
from uavgram.imaging.matching.patches import Grey, common_frames, window
from uavgram.imaging.matching.sureness import covariance_of
from uavgram.imaging.raster import Image
from uavgram.model.arrays import Bools, Floats, Ints

SUPPORT = 5
"""Half the side of a window [px of the source]."""

ASIDE = 4.0
"""How far the middles of windows lie from the corner in either direction [px of the source]."""

EVEN = 4.0
"""Standard deviation [grey values] up to which a window says nothing."""

ALIKE = 0.8
"""Correlation from which a photo speaks for a place."""

PHOTOS = 2
"""That must speak for it, besides the source: any one agrees with it somewhere on the line."""

SURE = 0.6, 1.5
"""Least support of the best window, and of all together, by a photo: 1 where it equals the source
in a window."""

NEXT_BEST = 0.75
"""Most support of another place, in that of the best."""

BEFORE = 0.78
"""Most support of a window for a higher place, in that of the best: what lies before hides what
lies behind, so a corner that is seen at two heights is likelier the higher thing's."""

ANOTHER_PX = 4.0
"""From which distance in some photo a place is another one."""

CORNERED_PX = 2.0
"""About a corner, that far, lies what is compared of its edges."""

AS_CORNERED = (0.75, 1.4), (0.65, 1.4)
"""How strong the weaker of two directions of edges is at the corner in other photos, and the
stronger, against the source, where the window has the same contrast. Beside the edge of a thing
that hides more in one photo than in the other, one of them is another."""

LEAST_EDGE = 1e-3
"""Of a place without any, as a share of the contrast."""

STRETCH = 0.25, 4.0
"""Of a photo against the source, beyond which it is not compared."""

FITTED_HALF, FITTED_STEPS = 9, 12
FARTHEST_PX = 1.5
"""How far the place in one photo may be from where all together have it: errors of poses."""

FITTED_SIGMA_PX = 0.5
"""Most of the matching in one photo: what is beside an edge says little, but all photos agree."""

_REACH = SUPPORT + int(ASIDE)
_SIDE = np.arange(-_REACH, _REACH + 1.0)
_GRID: Floats = np.stack(np.meshgrid(_SIDE, _SIDE), axis=-1).reshape(-1, 2)
_MIDDLES: Floats = ASIDE * np.stack(np.meshgrid([-1, 0, 1], [-1, 0, 1]), axis=-1).reshape(-1, 2)
_AWAY: Floats = _GRID - _MIDDLES[:, None]
_WINDOWS: Floats = np.where(
    (np.abs(_AWAY) <= SUPPORT).all(axis=2), np.exp(-2.0 * (_AWAY**2).sum(axis=2) / SUPPORT**2), 0.0
)
_WINDOWS = np.asarray(_WINDOWS / _WINDOWS.sum(axis=1, keepdims=True))
_NEAR: Floats = np.exp(-0.5 * (_GRID**2).sum(axis=1) / CORNERED_PX**2)
_NEAR = np.asarray(_NEAR / _NEAR.sum())
_MOST_ROWS = 30000  # of maps that OpenCV resamples by


class Line(NamedTuple):
    """A pixel's line of sight as t photos show it, from what lies lowest up.

    Attributes
    ----------
    source_px
        (2,) the pixel.
    pixel_px
        (k, t, 2) places of the line; NaN where a photo does not show one.
    affine
        (k, t, 2, 2) d pixel there / d pixel in the source, of what lies level.
    lowest
        Number of the first place that may be the corner's; those before it are the ground.
    """

    source_px: Floats
    pixel_px: Floats
    affine: Floats
    lowest: int


class OnLine(NamedTuple):
    """Where a corner is.

    Attributes
    ----------
    refused
        (t,) for each photo, a `Refused` as a number.
    pixel_px, covariance_px2
        (t, 2), (t, 2, 2) of the matching in each photo; NaN where refused.
    score
        (t,) likeness in the window that is most alike.
    """

    refused: Ints
    pixel_px: Floats
    covariance_px2: Floats
    score: Floats


def found_on_line(
    source: Image, targets: Sequence[Image], line: Line, options: MatchOptions | None = None
) -> OnLine:
    """The corner in each photo.

    Parameters
    ----------
    source
        (height, width) grey photo, uint8.
    targets
        t others.
    line
        Where it may be.
    options
        What is asked of a match.
    """
    t = len(targets)
    refused = np.full(t, int(Refused.NOT_LIKE))
    pixel, covariance = np.full((t, 2), np.nan), np.full((t, 2, 2), np.nan)
    score = np.zeros(t)
    if not _shown(source, line.source_px[None], np.eye(2)[None]).all():
        refused[:] = Refused.OUTSIDE
        return OnLine(refused, pixel, covariance, score)
    like = _likeness(source, targets, line)
    place, support, why = best_of(like, line)
    if why != Refused.NONE:
        refused[:] = why
        return OnLine(refused, pixel, covariance, score)
    score = like[_about(place, len(like)), :, support].max(axis=0).clip(0.0, 1.0)
    for i in np.flatnonzero(score > ALIKE).tolist():
        one = _fitted(source, targets[i], line, (place, i, support), options or MatchOptions())
        if one is None:
            refused[i] = Refused.UNSTABLE
        else:
            refused[i] = Refused.NONE
            pixel[i], covariance[i] = one
    some = np.flatnonzero(refused == Refused.NONE).tolist()
    here = edges_at(source, line.source_px, np.eye(2), support)
    there = [edges_at(targets[i], pixel[i], line.affine[place, i], support) for i in some]
    if len(some) < PHOTOS or not is_as_cornered(np.array(there) / np.maximum(here, LEAST_EDGE)):
        refused[some] = Refused.UNSTABLE
        pixel[some], covariance[some] = np.nan, np.nan
    return OnLine(refused, pixel, covariance, score)


def _likeness(source: Image, targets: Sequence[Image], line: Line) -> Floats:
    """(k, t, windows) correlation of each window at each place; -1 where it says nothing."""
    own = _sampled(source, line.source_px[None], np.eye(2)[None])[0]
    mean = _WINDOWS @ own
    variance = _WINDOWS @ own**2 - mean**2
    tells = variance > EVEN**2
    like = np.full((*line.pixel_px.shape[:2], len(_WINDOWS)), -1.0)
    for i, photo in enumerate(targets):
        rows = np.flatnonzero(_shown(photo, line.pixel_px[:, i], line.affine[:, i]))
        there = _sampled(photo, line.pixel_px[rows, i], line.affine[rows, i])
        middle = there @ _WINDOWS.T
        spread = np.maximum(there**2 @ _WINDOWS.T - middle**2, 1.0)
        both = (there * own) @ _WINDOWS.T - middle * mean
        like[rows, i] = np.where(tells, both / np.sqrt(spread * np.maximum(variance, 1.0)), -1.0)
    return like


def edges_at(photo: Image, pixel: Floats, affine: Floats, support: int) -> Floats:
    """(2,) the weaker and the stronger of two directions of edges at a place.

    The roots of the structure tensor's eigenvalues (Foerstner and Guelch 1987), in steps of the
    source's pixels, as shares of the contrast of a window.

    Parameters
    ----------
    photo
        Grey.
    pixel, affine
        (2,) the place, and (2, 2) d pixel there / d pixel in the source.
    support
        Number of the window.
    """
    grey = _sampled(photo, pixel[None], affine[None])[0].astype(np.float64)
    contrast = np.sqrt(max(_WINDOWS[support] @ grey**2 - (_WINDOWS[support] @ grey) ** 2, 1.0))
    slope = np.stack(np.gradient(grey.reshape(len(_SIDE), -1)), axis=-1).reshape(-1, 2) / contrast
    return np.asarray(np.sqrt(np.linalg.eigvalsh((_NEAR[:, None] * slope).T @ slope).clip(0.0)))


def is_as_cornered(ratio: Floats) -> bool:
    """Whether most photos show as much of a corner as the source, by (n, 2) ratios of edges."""
    usual = np.median(ratio, axis=0)
    low, high = np.array(AS_CORNERED).T
    return bool(((usual >= low) & (usual <= high)).all())


def _shown(photo: Image, pixel: Floats, affine: Floats) -> Bools:
    """(k,) whether the windows lie in a photo, and it shows them about as large."""
    far = np.abs(affine).sum(axis=2) * _REACH + 2.0
    with np.errstate(invalid="ignore"):
        inside = (pixel >= far) & (pixel <= np.array(photo.shape[1::-1]) - 1 - far)
    size = np.linalg.svd(np.nan_to_num(affine), compute_uv=False)
    return np.asarray(inside.all(axis=1) & (size[:, 1] > STRETCH[0]) & (size[:, 0] < STRETCH[1]))


def _sampled(photo: Image, pixel: Floats, affine: Floats) -> Grey:
    """(n, grid) grey values about pixels (n, 2)."""
    at = (pixel[:, None] + _GRID @ np.swapaxes(affine, 1, 2)).astype(np.float32)
    out = np.empty(at.shape[:2], np.float32)
    for first in range(0, len(at), _MOST_ROWS):
        some = slice(first, first + _MOST_ROWS)
        out[some] = cv2.remap(photo, at[some, :, 0], at[some, :, 1], cv2.INTER_CUBIC)
    return out


def _about(place: int, count: int) -> slice:
    return slice(max(place - 1, 0), min(place + 2, count))


def best_of(like: Floats, line: Line) -> tuple[int, int, Refused]:
    """Number of the place, and of the window that most photos are alike in, or why there is none.

    Parameters
    ----------
    like
        (k, t, windows) correlation at each place of the line in each photo; -1 where not compared.
    line
        The line.
    """
    beside = np.pad(like, ((1, 1), (0, 0), (0, 0)), constant_values=-1.0)
    near = np.maximum(np.maximum(beside[:-2], beside[2:]), like)  # poses err
    votes = np.clip((near - ALIKE) / (1.0 - ALIKE), 0.0, None)
    speak = np.count_nonzero(votes > 0, axis=1)
    in_view = np.count_nonzero((like > -1.0).any(axis=2), axis=1)
    most = np.where((speak >= PHOTOS) & (2 * speak >= in_view[:, None]), votes.sum(axis=1), 0.0)
    total = most.sum(axis=1)
    raised = np.where(np.arange(len(total)) >= line.lowest, total, 0.0)
    place = int(raised.argmax())
    support = int(most[place].argmax())
    enough, together = np.array(SURE) * max(int(speak[place, support]), 1)
    if most[place, support] < enough or raised[place] < together:
        return place, support, Refused.NOT_LIKE
    ends = place <= line.lowest or place >= len(total) - 2
    gap = np.linalg.norm(line.pixel_px - line.pixel_px[place], axis=2)
    apart = np.nan_to_num(gap).max(axis=1) > ANOTHER_PX
    second = raised[apart].max(initial=0.0)
    before = most[place:][apart[place:]].max(initial=0.0)
    hides = before > BEFORE * most[place, support]
    if ends or hides or second > NEXT_BEST * raised[place]:
        return place, support, Refused.NOT_UNIQUE
    return place, support, Refused.NONE


def _fitted(
    source: Image,
    target: Image,
    line: Line,
    which: tuple[int, int, int],
    options: MatchOptions,
) -> tuple[Floats, Floats] | None:
    """Pixel and covariance in one photo, by least squares in the window that is most alike.

    Parameters
    ----------
    source, target
        Grey photos.
    line
        Where the corner may be.
    which
        Place, photo and window.
    options
        What is asked of a match.
    """
    place, photo, support = which
    start = line.pixel_px[place, photo]
    frames = common_frames(line.affine[place, photo][None])
    near = window(source, line.source_px, frames.source[0], FITTED_HALF + 4)
    far = window(target, start, frames.target[0], FITTED_HALF + 4)
    middle = np.linalg.solve(frames.source[0], _MIDDLES[support])
    found = fitted(
        near[None],
        far[None],
        np.zeros((1, 2)),
        np.eye(2)[None],
        FITTED_HALF,
        FITTED_STEPS,
        bell=(middle, float(SUPPORT)),
    )
    into = frames.target[0]
    moved = into @ found.place[0]
    spread = into @ covariance_of(found, options)[0] @ into.T
    change = np.linalg.norm(found.linear[0] - np.eye(2), ord=2)
    right = (
        np.hypot(*moved) < FARTHEST_PX
        and found.likeness[0] > ALIKE
        and change < options.change
        and np.sqrt(np.linalg.eigvalsh(spread)[1]) < FITTED_SIGMA_PX
    )
    return (start + moved, spread) if right else None
