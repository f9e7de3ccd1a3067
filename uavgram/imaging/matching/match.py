"""Each sought point found in the target photo to hundredths of a pixel, or refused."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.stats import chi2

from uavgram.imaging.matching.least_squares import Fitted, fitted
from uavgram.imaging.matching.matched import Matched, Refused, Sought
from uavgram.imaging.matching.patches import Frames, Grey, common_frames, window, within
from uavgram.imaging.matching.search import best_place
from uavgram.imaging.raster import Image
from uavgram.model.arrays import Bools, Floats, Ints

REGION = float(chi2.ppf(0.999, 2))
"""Squared distance, in sigmas, of the edge of what is searched: 99.9 % of predictions."""

_MARGIN = 8  # steps about a patch in its window, for the patch to move and for interpolation


@dataclass(frozen=True, kw_only=True)
class MatchOptions:
    """What is asked of a match.

    Attributes
    ----------
    half, other_halves
        Of the sides of the patch that is matched, and of those that must agree with it [steps].
    search_half
        Of the side of the patch that is searched.
    search_likeness, likeness
        Least correlation after the search, and after matching.
    second_peak
        Most that 1 - correlation may be of that of the next best place.
    back_px, agree_px
        Most distance from the point after matching back, and between sizes [steps].
    change, shift, gain
        Most change of the map, most way from the search's place [steps], most change of contrast
        either way.
    contrast
        Least weighted standard deviation of a patch [grey values].
    sigma_px
        Most standard deviation in the worse direction.
    lsm_scale, floor_px
        sigma^2 = (scale * formal)^2 + floor^2: the floor is what rendering, JPEG and
        interpolation leave at best.
    farthest
        Most steps from the prediction that are searched.
    """

    half: int = 10
    other_halves: tuple[int, int] = (7, 15)
    search_half: int = 12
    search_likeness: float = 0.75
    likeness: float = 0.8
    second_peak: float = 0.75
    back_px: float = 0.3
    agree_px: float = 0.35
    change: float = 0.2
    shift: float = 2.0
    gain: float = 2.0
    contrast: float = 1.5
    sigma_px: float = 0.3
    lsm_scale: float = 0.85
    floor_px: float = 0.03
    farthest: int = 420


_DEFAULT = MatchOptions()


def matched(
    source: Image, target: Image, sought: Sought, options: MatchOptions = _DEFAULT
) -> Matched:
    """Where sought points lie in the target.

    Parameters
    ----------
    source, target
        (height, width) grey photos, uint8.
    sought
        Of n points.
    options
        What is asked of a match.
    """
    return _Search(source, target, sought, options).result()


class _Search:
    """One call: what is left of the points after each check."""

    def __init__(self, source: Image, target: Image, sought: Sought, options: MatchOptions) -> None:
        n = len(sought)
        self._source, self._target, self._sought, self._options = source, target, sought, options
        self._frames: Frames = common_frames(sought.affine)
        self._refused: Ints = np.full(n, Refused.NONE, np.int64)
        self._score: Floats = np.zeros(n)
        self._half = max(options.half, *options.other_halves)

    def result(self) -> Matched:
        """What was found."""
        n = len(self._sought)
        pixel, covariance = np.full((n, 2), np.nan), np.full((n, 2, 2), np.nan)
        at = self._searched()
        index = self._left()
        if len(index):
            found, spread = self._refined(index, at[index])
            pixel[index], covariance[index] = found, spread
            bad = self._refused != Refused.NONE
            pixel[bad], covariance[bad] = np.nan, np.nan
        return Matched(
            pixel_px=pixel,
            covariance_px2=covariance,
            sigma_px=np.sqrt(0.5 * np.trace(covariance, axis1=1, axis2=2)),
            score=self._score.clip(0.0, 1.0),
            refused=self._refused,
        )

    def _left(self) -> Ints:
        return np.flatnonzero(self._refused == Refused.NONE)

    def _refuse(self, index: Ints, bad: Bools, why: Refused) -> None:
        """Refuse those of some points that are bad and not refused yet."""
        bad = bad & (self._refused[index] == Refused.NONE)
        self._refused[index[bad]] = why

    def _searched(self) -> Floats:
        """(n, 2) pixels in the target that look most like the points, to some tenths."""
        n, options = len(self._sought), self._options
        into = np.linalg.inv(self._frames.target)
        spread = into @ self._sought.covariance_px2 @ np.swapaxes(into, 1, 2)
        far = np.sqrt(REGION * np.diagonal(spread, axis1=1, axis2=2)).max(axis=1, initial=0.0)
        reach = np.ceil(far).astype(int) + 2
        everyone = np.arange(n)
        half = options.search_half
        inside = within(self._source, self._sought.source_px, self._frames.source, half)
        self._refuse(everyone, ~inside, Refused.OUTSIDE)
        self._refuse(everyone, reach > options.farthest, Refused.TOO_FAR)
        at = np.full((n, 2), np.nan)
        for i in self._left():
            at[i] = self._search_one(int(i), int(reach[i]), spread[i])
        return at

    def _search_one(self, i: int, reach: int, spread: Floats) -> Floats:
        options, frame = self._options, self._frames.target[i]
        half, center = options.search_half, self._sought.target_px[i]
        patch = window(self._source, self._sought.source_px[i], self._frames.source[i], half)
        if patch.std() < options.contrast:
            self._refused[i] = Refused.WEAK
            return center
        allowed = _region(reach, spread)
        allowed &= self._in_target(center, frame, reach)
        if not allowed.any():
            self._refused[i] = Refused.OUTSIDE
            return center
        around = window(self._target, center, frame, half + reach, exact=False)
        peak = best_place(patch, around, allowed)
        self._score[i] = peak.likeness
        one = np.array([i])
        self._refuse(one, np.array([peak.likeness < options.search_likeness]), Refused.NOT_LIKE)
        near = 1 - peak.likeness > options.second_peak * (1 - peak.second)
        self._refuse(one, np.array([near or peak.at_edge]), Refused.NOT_UNIQUE)
        return np.asarray(center + frame @ peak.place)

    def _in_target(self, center: Floats, frame: Floats, reach: int) -> Bools:
        """(2 reach + 1, 2 reach + 1) whether a patch there is within the target."""
        step = np.arange(-reach, reach + 1.0)
        place = center + np.stack(np.meshgrid(step, step), axis=-1).reshape(-1, 2) @ frame.T
        half = self._options.search_half
        return within(self._target, place, frame[None], half).reshape(len(step), -1)

    def _windows(self, index: Ints, at: Floats) -> tuple[Grey, Grey]:
        half = self._half + _MARGIN
        sides = (
            (self._source, self._sought.source_px[index], self._frames.source[index]),
            (self._target, at, self._frames.target[index]),
        )
        first, second = (
            np.stack([window(photo, c, f, half) for c, f in zip(center, frame, strict=True)])
            for photo, center, frame in sides
        )
        return first, second

    def _refined(self, index: Ints, at: Floats) -> tuple[Floats, Floats]:
        """Pixels (m, 2) and covariances of the points that are left."""
        options = self._options
        near, far = self._windows(index, at)
        square = np.broadcast_to(np.eye(2), (len(index), 2, 2))
        there = fitted(near, far, np.zeros((len(index), 2)), square, options.half, 12)
        self._score[index] = there.likeness
        self._judge_fit(index, there)
        back_map = np.linalg.inv(there.linear)
        back_start = -(back_map @ there.place[..., None])[..., 0]
        back = fitted(far, near, np.zeros_like(back_start), square, options.half, 12)
        others = [
            fitted(near, far, there.place, there.linear, half, 5) for half in options.other_halves
        ]
        self._judge_back(index, there, back, others)
        into = self._frames.target[index]
        covariance = options.lsm_scale**2 * (into @ there.covariance @ np.swapaxes(into, 1, 2))
        covariance += options.floor_px**2 * np.eye(2)
        worst = np.sqrt(np.linalg.eigvalsh(covariance)[:, 1])
        self._refuse(index, ~(worst < options.sigma_px), Refused.WEAK)
        return at + (into @ there.place[..., None])[..., 0], covariance

    def _judge_fit(self, index: Ints, there: Fitted) -> None:
        options = self._options
        self._refuse(index, ~(there.contrast > options.contrast), Refused.WEAK)
        self._refuse(index, ~(there.likeness > options.likeness), Refused.NOT_LIKE)
        change = np.linalg.norm(there.linear - np.eye(2), ord=2, axis=(1, 2))
        far = np.hypot(*there.place.T) > options.shift
        gain = np.abs(np.log(there.gain)) > np.log(options.gain)
        self._refuse(index, ~(change < options.change) | far | gain, Refused.DISTORTED)

    def _judge_back(self, index: Ints, there: Fitted, back: Fitted, others: list[Fitted]) -> None:
        options = self._options
        home = back.place + (back.linear @ there.place[..., None])[..., 0]
        self._refuse(index, ~(np.hypot(*home.T) < options.back_px), Refused.NOT_BACK)
        apart = np.max([np.hypot(*(o.place - there.place).T) for o in others], axis=0)
        self._refuse(index, ~(apart < options.agree_px), Refused.UNSTABLE)


def _region(reach: int, covariance: Floats) -> Bools:
    """(2 reach + 1, 2 reach + 1) what lies within the region, and a step about it."""
    step = np.arange(-reach, reach + 1.0)
    x, y = np.meshgrid(step, step)
    weight = np.linalg.inv(covariance + np.eye(2) / REGION)
    return np.asarray(
        weight[0, 0] * x**2 + 2 * weight[0, 1] * x * y + weight[1, 1] * y**2 <= REGION
    )
