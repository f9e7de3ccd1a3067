"""Matching of points in a target photo to hundredths of a pixel, refusing doubtful matches.

Around a corner off the ground, one part of a window shows the object and another the background
behind it. From photo to photo these two parts move differently, so windows with the corner at
different places are tried (shiftable windows: Kang, Szeliski and Chai 2001, "Handling occlusions in
dense multi-view stereo"). The background may match by itself, at a place where the corner is not. A
match is therefore refused if one quarter of its patch matches and another does not.
"""

from __future__ import annotations

from dataclasses import fields, replace
from typing import NamedTuple

import cv2
import numpy as np
from scipy.special import chdtri

from uavgram.imaging.matching.least_squares import (
    Matches,
    MatchOptions,
    Patch,
    PatchFits,
    RefusalReason,
    SoughtPoints,
    estimate_match_covariance,
    fit_patches,
    is_precise,
)
from uavgram.imaging.patches import (
    Frames,
    Grey,
    compute_common_frames,
    is_within_photo,
    make_grid,
    sample_grey,
    sample_window,
)
from uavgram.imaging.raster import Image
from uavgram.model.arrays import Bools, Floats, Ints, rows_of

HALF_WINDOW = 5
"""Half the side of a window [steps]."""

MIN_TEXTURE_SIGMA = 4.0
"""Standard deviation [grey values] up to which a window has too little texture to be used."""


class ShiftedWindows(NamedTuple):
    """Set of w windows about a point.

    Attributes
    ----------
    grid
        (s, 2) places that they cover together, about the point.
    middle
        (w, 2) centre of each window.
    weight
        (w, s) weights of the places; each window's sum is 1.
    """

    grid: Floats
    middle: Floats
    weight: Floats

    def likeness(self, own: Grey, there: Grey) -> tuple[Floats, Floats]:
        """Correlate values (..., s) with the source's values (s,) in each window.

        Returns
        -------
        The correlations (..., w), and the variances (w,) of the source's values.
        """
        mean, middle = self.weight @ own, there @ self.weight.T
        variance = self.weight @ own**2 - mean**2
        spread = np.maximum(there**2 @ self.weight.T - middle**2, 1.0)
        both = (there * own) @ self.weight.T - middle * mean
        return both / np.sqrt(spread * np.maximum(variance, 1.0)), variance


def make_shifted_windows(aside: int) -> ShiftedWindows:
    """Create windows centred on the point, and `aside` steps from it in either direction."""
    places, middle = make_grid(HALF_WINDOW + aside), aside * make_grid(1)
    away = places - middle[:, None]
    within = (np.abs(away) <= HALF_WINDOW).all(axis=2)
    weight = np.where(within, np.exp(-2.0 * (away**2).sum(axis=2) / HALF_WINDOW**2), 0.0)
    return ShiftedWindows(places, middle, weight / weight.sum(axis=1, keepdims=True))


_SHIFT = 3  # steps: the edges at the point are in every window
_SHIFTED = make_shifted_windows(_SHIFT)
_OTHER_STEPS: Floats = np.array([0.0, -4.0, -3.0, 3.0, 4.0])  # steps along the line of sight
_CLICK_STEPS = 1.5  # sigma of the Gaussian window that holds only what was clicked
_CLICK: Floats = np.exp(-0.5 * (_SHIFTED.grid**2).sum(axis=1) / _CLICK_STEPS**2)
_CLICK = np.asarray(_CLICK / _CLICK.sum())
_RECOGNISED = 0.85  # correlation in it from which it shows the same; rendered streets
_STRUCTURE = 3.0  # variance in it, relative to one photo's noise, from which it shows something
_LEAST_NOISE = 0.25  # least variance of the difference of two windows [grey values squared]


def find_unoccluded(
    near: Grey, far: Grey, there: PatchFits, along: Floats, is_confirmed: Bools
) -> Bools:
    """Mark the points (m,) whose surroundings all match at one place along the line of sight.

    Beside the corner of a dark thing in its own shadow, larger windows match by the edge of that
    shadow on the ground. So structure at the click, beyond noise, must be recognised by itself.
    Without any, no corner was clicked. A click in another photo shows the height as well.

    Parameters
    ----------
    near, far
        (m, s, s) windows about the point, and about the searched place.
    there
        Match of the first in the second.
    along
        (m, 2) direction of the line of sight there; 0 where the place along it is known.
    is_confirmed
        (m,) whether the point was clicked in another photo, too.
    """
    edge = near.shape[1] // 2 - HALF_WINDOW - _SHIFT
    fixed = np.ones(len(near), np.bool_)
    for i in np.flatnonzero(along.any(axis=1)).tolist():
        start = _SHIFTED.grid @ there.linear[i].T + there.place[i] + far.shape[1] // 2
        aside = _OTHER_STEPS[:, None, None] * along[i] / np.hypot(*along[i])
        u, v = np.moveaxis(start + aside, -1, 0)
        seen = sample_grey(far[i], u, v)
        own = near[i, edge:-edge, edge:-edge].ravel()
        like, variance = _SHIFTED.likeness(own, seen)
        unlike = variance * (1.0 - like)
        clicked = ShiftedWindows(_SHIFTED.grid, np.zeros((1, 2)), _CLICK[None])
        same, structure = clicked.likeness(own, seen[0])
        here, *others = unlike[:, variance > MIN_TEXTURE_SIGMA**2]
        other = np.maximum(np.min(others, axis=0), _LEAST_NOISE)
        noise = np.clip(np.median(unlike[0]), _LEAST_NOISE, other)  # of both photos
        # The difference of each textured window is noise, or that of another place. Both are normal
        # and of known variance; up to `even`, noise is the likelier.
        ratio = other / noise
        even = other * np.log(ratio) / np.maximum(ratio - 1.0, 1e-9)
        is_even = structure[0] < _STRUCTURE * np.median(unlike[0])
        is_shown = is_confirmed[i] or is_even or same[0] > _RECOGNISED
        fixed[i] = (here <= even).all() and is_shown
    return fixed


HALF_SQUARE = 15
"""Half side of the compared square [steps]: the largest that is matched at first."""

MIN_QUARTER_SIGMA = 4.0
"""Deviation of grey values below which a quarter has too little texture to be compared."""


def compute_worst_quarter_correlation(
    source: Image, target: Image, source_px: Floats, target_px: Floats, affine: Floats
) -> float:
    """Compute the correlation of the least similar quarter, -1 to 1; -1 where all lack texture.

    Parameters
    ----------
    source, target
        (height, width) grey photos.
    source_px, target_px
        (2,) the same point in both.
    affine
        (2, 2) d target pixel / d source pixel.
    """
    frames = compute_common_frames(affine[None])
    one = sample_window(source, source_px, frames.source[0], HALF_SQUARE)
    other = sample_window(target, target_px, frames.target[0], HALF_SQUARE)
    found = []
    for rows in (slice(HALF_SQUARE + 1), slice(HALF_SQUARE, None)):
        for columns in (slice(HALF_SQUARE + 1), slice(HALF_SQUARE, None)):
            a, b = (part[rows, columns].ravel() for part in (one, other))
            if a.std() >= MIN_QUARTER_SIGMA and b.std() > 0.0:
                found.append(float(np.corrcoef(a, b)[0, 1]))
    return min(found, default=-1.0)


REGION = float(chdtri(2, 0.001))
"""Squared distance [sigma] of the edge of the search region, which holds 99.9 % of predictions."""

_LARGE_REGION = 40.0  # steps: larger regions are searched at every other step first
_MAX_OUTSIDE = (
    0.15  # of the probability: with more, a similar place within could be taken for the point
)
_CORRELATION_TOLERANCE = 0.005  # in correlation: an insignificant difference
_BETWEEN = 1.5  # steps: a true place between steps is about this far from the best step
_ABOUT = 4.0  # steps: half the region of the second search
_MARGIN = 8  # steps about a patch in its window, for its motion and for interpolation


_DEFAULT = MatchOptions()


def match_points(
    source: Image, target: Image, sought: SoughtPoints, options: MatchOptions = _DEFAULT
) -> Matches:
    """Find points of a source photo in a target photo.

    Parameters
    ----------
    source, target
        (height, width) grey photos, uint8.
    sought
        n points.
    options
        Requirements on a match.
    """
    n = len(sought)
    found = Matches(
        pixel_px=np.full((n, 2), np.nan),
        covariance_px2=np.full((n, 2, 2), np.nan),
        sigma_px=np.full(n, np.nan),
        score=np.zeros(n),
        refused=np.full(n, RefusalReason.OUTSIDE),
    )
    for number, patch in enumerate(options.patches):
        index = np.flatnonzero(np.isin(found.refused, patch.after)) if number else np.arange(n)
        if not len(index):
            break
        part = replace(sought, **rows_of(sought, index))
        again = _Search(source, target, part, options, patch).result()
        # Keep the first patch's reason where no other patch finds the point.
        use = (again.refused == RefusalReason.NONE) | (number == 0)
        found = _replace_rows(
            found, index[use], replace(again, **rows_of(again, np.flatnonzero(use)))
        )
    return found


def _replace_rows(found: Matches, index: Ints, rows: Matches) -> Matches:
    columns = {}
    for field in fields(Matches):
        column = getattr(found, field.name).copy()
        column[index] = getattr(rows, field.name)
        columns[field.name] = column
    return Matches(**columns)


class _Search:
    """Matching of points with one patch size; points are rejected by one check after the other."""

    def __init__(
        self,
        source: Image,
        target: Image,
        sought: SoughtPoints,
        options: MatchOptions,
        patch: Patch,
    ) -> None:
        n = len(sought)
        self._source, self._target, self._sought, self._options = source, target, sought, options
        self._patch = patch
        frames = compute_common_frames(sought.affine)
        self._frames = Frames(frames.source * patch.step, frames.target * patch.step)
        self._refused: Ints = np.full(n, RefusalReason.NONE, np.int64)
        self._score: Floats = np.zeros(n)

    def result(self) -> Matches:
        """Search and refine the points; return the matches."""
        n = len(self._sought)
        pixel, covariance = np.full((n, 2), np.nan), np.full((n, 2, 2), np.nan)
        at = self._search_pixels()
        index = self._left()
        if len(index):
            found, spread = self._refine_pixels(index, at[index])
            pixel[index], covariance[index] = found, spread
            bad = self._refused != RefusalReason.NONE
            pixel[bad], covariance[bad] = np.nan, np.nan
        return Matches(
            pixel_px=pixel,
            covariance_px2=covariance,
            sigma_px=np.sqrt(0.5 * np.trace(covariance, axis1=1, axis2=2)),
            score=self._score.clip(0.0, 1.0),
            refused=self._refused,
        )

    def _left(self) -> Ints:
        return np.flatnonzero(self._refused == RefusalReason.NONE)

    def _refuse(self, index: Ints, bad: Bools, why: RefusalReason) -> None:
        """Refuse those of the indexed points that are bad and not refused yet."""
        bad = bad & (self._refused[index] == RefusalReason.NONE)
        self._refused[index[bad]] = why

    def _search_pixels(self) -> Floats:
        """Find the pixels (n, 2) in the target that look most like the points, to some tenths."""
        n, options = len(self._sought), self._options
        half = self._patch.search_half
        inside = is_within_photo(self._source, self._sought.source_px, self._frames.source, half)
        self._refuse(np.arange(n), ~inside, RefusalReason.OUTSIDE)
        into = np.linalg.inv(self._frames.target)
        spread = into @ self._sought.covariance_px2 @ np.swapaxes(into, 1, 2)
        far = np.sqrt(REGION * np.diagonal(spread, axis1=1, axis2=2)).max(axis=1, initial=0.0)
        self._refuse(np.arange(n), far > options.farthest, RefusalReason.TOO_FAR)
        at = np.full((n, 2), np.nan)
        for i in self._left():
            at[i] = self._search_one(int(i), self._sought.covariance_px2[i], float(far[i]))
        return at

    def _search_one(self, i: int, covariance: Floats, far: float) -> Floats:
        """Search one point; in a large region at every other step first."""
        at: Floats = self._sought.target_px[i]
        if far > _LARGE_REGION:
            at = self._best(i, at, covariance, 2.0, alone=True)
            covariance = self._frames.target[i] @ self._frames.target[i].T * _ABOUT**2 / REGION
        if self._refused[i] == RefusalReason.NONE:
            at = self._best(i, at, covariance, 1.0, alone=far <= _LARGE_REGION)
        return at

    def _best(
        self, i: int, center: Floats, covariance: Floats, coarse: float, *, alone: bool
    ) -> Floats:
        """Find the pixel in the target with the best correlation about a centre, to some tenths.

        Parameters
        ----------
        i
            Index of the point.
        center, covariance
            (2,), (2, 2) of its predicted place.
        coarse
            Sampling interval in steps.
        alone
            Whether the place must be unique, and most of its region inside the photo.
        """
        options, half = self._options, self._patch.search_half
        near, frame = self._frames.source[i] * coarse, self._frames.target[i] * coarse
        patch = sample_window(self._source, self._sought.source_px[i], near, half)
        if patch.std() < options.contrast / self._patch.step**2:
            self._refused[i] = RefusalReason.WEAK
            return center
        into = np.linalg.inv(frame)
        spread = into @ covariance @ into.T
        # Allowed places: inside the photo and inside the 99.9 % region.
        distance = _squared_distance(spread)
        reach = len(distance) // 2
        inside = self._in_photo(self._target, center, frame, reach)
        allowed = inside & (distance <= REGION)
        if not allowed.any():
            self._refused[i] = RefusalReason.OUTSIDE
            return center
        around = sample_window(self._target, center, frame, half + reach, exact=False)
        peak = find_best_place(patch, around, allowed)
        self._score[i] = peak.likeness
        likely = np.exp(-0.5 * distance)
        cut = likely[~inside].sum() > _MAX_OUTSIDE * likely.sum()
        near_second = alone and self._is_like_others(i, coarse, patch, (center, distance, peak))
        one = np.array([i])
        unlike = np.array([peak.likeness < options.search_likeness])
        self._refuse(one, unlike & (patch.std() < options.noisy_contrast), RefusalReason.WEAK)
        self._refuse(one, unlike, RefusalReason.NOT_LIKE)
        self._refuse(one, np.array([alone and cut]), RefusalReason.OUTSIDE)
        self._refuse(one, np.array([near_second]), RefusalReason.NOT_UNIQUE)
        self._refuse(one, np.array([peak.at_edge]), RefusalReason.NOT_UNIQUE)
        return np.asarray(center + frame @ peak.place)

    def _is_like_others(
        self, i: int, coarse: float, patch: Grey, found: tuple[Floats, Floats, Peak]
    ) -> bool:
        """Return whether another place is about as similar, in the target or in the source.

        In the target, the true one of two similar places may be hidden; the source shows both. If
        the true place is q and p was found, the object at p is at p - q from the point in the
        source: this gives the region in the source to search. Each place is compared at its best
        match, to a fraction of a step, since sharp edges correlate less half a step away.

        Parameters
        ----------
        i
            Index of the point.
        coarse
            Sampling interval in steps.
        patch
            Patch about the point.
        found
            Middle (2,) of the region, squared distances in sigmas by steps, and the best place.
        """
        center, distance, peak = found
        options, half = self._options, self._patch.search_half
        near, frame = self._frames.source[i] * coarse, self._frames.target[i] * coarse
        # Round to whole steps, so that the point itself is on the grid.
        behind = self._sought.source_px[i] + near @ np.round(peak.place)
        reach = len(distance) // 2
        allowed = self._in_photo(self._source, behind, near, reach) & (distance <= REGION)
        around = sample_window(self._source, behind, near, half + reach, exact=False)
        own = find_best_place(patch, around, allowed)
        second = max(peak.second, own.second)
        most = options.second_peak_far if coarse > 1 else options.second_peak
        alike = _is_ambiguous(peak.likeness, second, most)
        if alike or second < options.search_likeness:
            return alike
        # Compare the candidates after least-squares matching, to the subpixel.
        wide = half + _MARGIN
        place = center + frame @ peak.place, center + frame @ peak.next_place
        moving = [sample_window(self._target, pixel, frame, wide) for pixel in place]
        moving.append(sample_window(self._source, behind + near @ own.next_place, near, wide))
        fixed = np.stack(3 * [sample_window(self._source, self._sought.source_px[i], near, wide)])
        square = np.tile(np.eye(2), (3, 1, 1))
        there = fit_patches(fixed, np.stack(moving), np.zeros((3, 2)), square, half, 12)
        stayed = np.hypot(*there.place.T) < _BETWEEN  # otherwise it is the slope of another peak
        like = np.where(stayed, there.likeness, -1.0)
        return _is_ambiguous(max(like[0], peak.likeness), max(*like[1:], second), most)

    def _in_photo(self, photo: Image, center: Floats, frame: Floats, reach: int) -> Bools:
        """Mark the steps (2 reach + 1, 2 reach + 1) at which a patch is within a photo."""
        step = np.arange(-reach, reach + 1.0, dtype=np.float32)
        far = np.abs(frame).sum(axis=1) * self._patch.search_half + 1.0
        inside: Bools = np.ones((len(step), len(step)), bool)
        for axis, size in enumerate(photo.shape[1::-1]):
            first, second = frame[axis].astype(np.float32)
            place = (first * step + np.float32(center[axis])) + (second * step)[:, None]
            inside &= (place >= far[axis]) & (place <= size - 1 - far[axis])
        return inside

    def _windows(self, index: Ints, at: Floats) -> tuple[Grey, Grey]:
        half = max(self._patch.half, *self._patch.other_halves) + _MARGIN
        sides = (
            (self._source, self._sought.source_px[index], self._frames.source[index]),
            (self._target, at, self._frames.target[index]),
        )
        first, second = (
            np.stack([sample_window(photo, c, f, half) for c, f in zip(center, frame, strict=True)])
            for photo, center, frame in sides
        )
        return first, second

    def _refine_pixels(self, index: Ints, at: Floats) -> tuple[Floats, Floats]:
        """Refine the remaining points by least squares: pixels (m, 2) and covariances."""
        options, patch = self._options, self._patch
        near, far = self._windows(index, at)
        square = np.broadcast_to(np.eye(2), (len(index), 2, 2))
        there = fit_patches(near, far, np.zeros((len(index), 2)), square, patch.half, 12)
        self._score[index] = there.likeness
        self._judge_fit(index, there)
        # Match back from the target, and with patches of other sizes.
        back_map = np.linalg.inv(there.linear)
        back_start = -(back_map @ there.place[..., None])[..., 0]
        back = fit_patches(far, near, np.zeros_like(back_start), square, patch.half, 12)
        others = [
            fit_patches(near, far, there.place, there.linear, half, 5)
            for half in patch.other_halves
        ]
        self._judge_back(index, there, back, others)
        # Test the surroundings along the line of sight, then the covariance.
        into = self._frames.target[index]
        rise = np.where(
            self._refused[index, None] == RefusalReason.NONE, self._sought.rise[index], 0.0
        )
        along = np.linalg.solve(into, rise[..., None])[..., 0].astype(np.float64)
        is_confirmed = self._sought.is_confirmed[index]
        is_free = find_unoccluded(near, far, there, along, is_confirmed)
        self._refuse(index, ~is_free, RefusalReason.OFF_GROUND)
        left, spread = (
            self._refused[index] == RefusalReason.NONE,
            np.full((len(index), 2, 2), np.nan),
        )
        sure = estimate_match_covariance(there.some(left), options, patch.step)
        spread[left] = into[left] @ sure @ np.swapaxes(into[left], 1, 2)
        self._refuse(index[left], ~is_precise(spread[left], options.sigma_px), RefusalReason.WEAK)
        return at + (into @ there.place[..., None])[..., 0], spread

    def _judge_fit(self, index: Ints, there: PatchFits) -> None:
        options = self._options
        self._refuse(
            index, ~(there.contrast > options.contrast / self._patch.step**2), RefusalReason.WEAK
        )
        self._refuse(index, ~(there.likeness > self._patch.likeness), RefusalReason.NOT_LIKE)
        change = np.linalg.norm(there.linear - np.eye(2), ord=2, axis=(1, 2))
        far = np.hypot(*there.place.T) > options.shift
        gain = np.abs(np.log(there.gain)) > np.log(options.gain)
        self._refuse(index, ~(change < options.change) | far | gain, RefusalReason.DISTORTED)

    def _judge_back(
        self, index: Ints, there: PatchFits, back: PatchFits, others: list[PatchFits]
    ) -> None:
        options = self._options
        home = back.place + (back.linear @ there.place[..., None])[..., 0]
        self._refuse(index, ~(np.hypot(*home.T) < options.back), RefusalReason.NOT_BACK)
        apart = np.max([np.hypot(*(o.place - there.place).T) for o in others], axis=0)
        self._refuse(index, ~(apart < options.agree), RefusalReason.UNSTABLE)


def _is_ambiguous(best: float, other: float, most: float) -> bool:
    """Return whether another place is about as likely as the best one."""
    return 1 - best + _CORRELATION_TOLERANCE > most * (1 - other)


def _squared_distance(covariance: Floats) -> Floats:
    """Compute squared distances [sigma] of places by steps, (2 r + 1, 2 r + 1).

    They reach to the region's edge, which is at least one step away, also for a sure prediction.
    """
    spread = covariance + np.eye(2) / REGION
    reach = int(np.ceil(np.sqrt(REGION * np.diagonal(spread).max()))) + 1
    step = np.arange(-reach, reach + 1.0, dtype=np.float32)
    weight = np.linalg.inv(spread).astype(np.float32)
    along = weight[0, 0] * step**2 + (weight[1, 1] * step**2)[:, None]
    return np.asarray(along + (2 * weight[0, 1] * step) * step[:, None])


SAME_PEAK = 4
"""Steps about the best place within which other places belong to the same peak."""


class Peak(NamedTuple):
    """Best place (x, y) from the middle of the searched region, in steps.

    Attributes
    ----------
    place
        (2,) to some tenths of a step.
    likeness
        Normalised correlation there.
    next_place, second
        (2,) the best place elsewhere in the region, to a step, and its correlation; -1: none.
    at_edge
        Whether the place is on the edge of the region: the true place may be outside.
    """

    place: Floats
    likeness: float
    next_place: Floats
    second: float
    at_edge: bool


def find_best_place(patch: Grey, searched: Grey, allowed: Bools) -> Peak:
    """Find the place of a patch within a larger window.

    Parameters
    ----------
    patch
        (p, p), p odd.
    searched
        (p + 2 r, p + 2 r).
    allowed
        (2 r + 1, 2 r + 1) mask of places allowed for its middle.
    """
    like = cv2.matchTemplate(searched, patch, cv2.TM_CCOEFF_NORMED)
    like[~(np.abs(like) < 1.01)] = -1.0  # not finite where there is no texture
    inside = np.where(allowed, like, np.float32(-1.0))
    y, x = np.unravel_index(int(inside.argmax()), inside.shape)
    reach = like.shape[0] // 2
    if not 0 < x < 2 * reach or not 0 < y < 2 * reach:
        off = np.array([x - reach, y - reach], np.float64)
        return Peak(off, float(inside[y, x]), off, second=-1.0, at_edge=True)
    around = like[y - 1 : y + 2, x - 1 : x + 2].astype(np.float64)
    at_edge = bool(around.max() > like[y, x])
    rest = inside.copy()
    rest[max(y - SAME_PEAK, 0) : y + SAME_PEAK + 1, max(x - SAME_PEAK, 0) : x + SAME_PEAK + 1] = -1
    next_y, next_x = np.unravel_index(int(rest.argmax()), rest.shape)
    next_place = np.array([next_x - reach, next_y - reach], np.float64)
    offset = np.array([_top(around[1]), _top(around[:, 1])])
    place = np.array([x - reach, y - reach]) + offset
    return Peak(place, float(like[y, x]), next_place, float(rest[next_y, next_x]), at_edge)


def _top(three: Floats) -> float:
    """Find the maximum of the parabola through three values, the middle one largest."""
    bend = 2 * three[1] - three[0] - three[2]
    return float(np.clip(0.5 * (three[2] - three[0]) / bend, -0.5, 0.5)) if bend > 0 else 0.0
