"""Which of a camera's photos is which of an autopilot's events, when the clocks differ.

Monotone alignment with gaps on both sides: the offset between the clocks is the one under which
most photos fall on an event each. Every difference of a photo's and an event's time votes; the
densest windows of votes are the candidates, and only a clear winner counts. Evenly spaced events
fit at several offsets: that is seen, not guessed away.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.optimize import linear_sum_assignment

from uavgram.model.arrays import Bools, Floats, Ints

JITTER_LEVELS_S = (0.004, 0.03, 0.1)  # exposure against event; tried from strict to loose
DRIFT = 1e-4  # of the camera's clock against the autopilot's, at most
_CANDIDATES = 24


@dataclass(frozen=True)
class Candidate:
    """A clock offset [s] and how many photos fall on an event each under it."""

    offset_s: float
    matched: int


@dataclass(frozen=True, eq=False)
class Alignment:
    """The result for F photos.

    Attributes
    ----------
    unique
        Whether one offset is clearly better than every other.
    candidates
        Best first; at least one unless there is nothing to align.
    offset_s, offset_sigma_s
        Photo clock minus event clock by the best candidate.
    event_index
        (F,) the photo's event, -1 where it has none or where a neighbouring event fits too.
    residual_s
        (F,) photo time - offset - event time; NaN without an event.
    """

    unique: bool
    candidates: tuple[Candidate, ...]
    offset_s: float
    offset_sigma_s: float
    event_index: Ints
    residual_s: Floats


def align(
    photo_s: Floats,
    resolution_s: float,
    event_s: Floats,
    bounds_s: tuple[float, float] = (-np.inf, np.inf),
) -> Alignment:
    """Find the clock offset under which photos and events fit, and the pairs.

    Parameters
    ----------
    photo_s
        (F,) readings of the photos' clock, in any order.
    resolution_s
        Their step.
    event_s
        (E,) increasing.
    bounds_s
        Between which the offset must lie.
    """
    result = _none(len(photo_s))
    if not len(photo_s) or not len(event_s):
        return result
    span = float(np.ptp(photo_s))
    for jitter in JITTER_LEVELS_S:
        tolerance = resolution_s / 2 + jitter + DRIFT * span / 2
        candidates = _candidates(photo_s, event_s, tolerance, bounds_s)
        if not candidates:
            continue
        unique = _is_clear(candidates, len(photo_s))
        result = _result(photo_s, resolution_s, event_s, tolerance, candidates, unique=unique)
        if unique:
            return result
    return result


def _none(count: int) -> Alignment:
    nothing = np.full(count, np.nan)
    return Alignment(
        unique=False,
        candidates=(),
        offset_s=float("nan"),
        offset_sigma_s=float("nan"),
        event_index=np.full(count, -1, dtype=np.int64),
        residual_s=nothing,
    )


def _is_clear(candidates: list[Candidate], photos: int) -> bool:
    """Three pairs at least, most photos matched, and a lead that chance does not give."""
    best = candidates[0].matched
    second = candidates[1].matched if len(candidates) > 1 else 0
    return best >= 3 and best >= 0.75 * photos and best - second >= max(2, 0.15 * best)


def _candidates(
    photo_s: Floats, event_s: Floats, tolerance: float, bounds_s: tuple[float, float]
) -> list[Candidate]:
    """Offsets that differ by more than the tolerance, most matched photos first."""
    votes = np.sort((photo_s[:, None] - event_s[None, :]).ravel())
    votes = votes[(votes >= bounds_s[0]) & (votes <= bounds_s[1])]
    if not len(votes):
        return []
    last = np.searchsorted(votes, votes + 2 * tolerance, side="right")
    count = last - np.arange(len(votes))
    found: list[Candidate] = []
    for _ in range(_CANDIDATES):
        k = int(np.argmax(count))
        if count[k] <= 0:
            break
        offset = float(np.mean(votes[k : last[k]]))
        for _ in range(3):  # settle on the mean of its own pairs
            residual, index = _nearest(photo_s, event_s, offset)
            near = np.abs(residual) <= tolerance
            offset += float(residual[near].mean()) if near.any() else 0.0
        residual, index = _nearest(photo_s, event_s, offset)
        matched = len(np.unique(index[np.abs(residual) <= tolerance]))
        found.append(Candidate(offset, matched))
        middle = (votes[k] + votes[last[k] - 1]) / 2
        count[np.abs(votes + tolerance - middle) <= 2 * tolerance] = 0
    return sorted(_distinct(found, tolerance), key=lambda c: (-c.matched, abs(c.offset_s)))


def _distinct(found: list[Candidate], tolerance: float) -> list[Candidate]:
    """Candidates that did not settle on a better one."""
    kept: list[Candidate] = []
    for candidate in sorted(found, key=lambda c: -c.matched):
        if all(abs(candidate.offset_s - other.offset_s) > 2 * tolerance for other in kept):
            kept.append(candidate)
    return kept


def _nearest(photo_s: Floats, event_s: Floats, offset: float) -> tuple[Floats, Ints]:
    """(F,) photo time - offset - nearest event's time, and that event."""
    time = photo_s - offset
    right = np.clip(np.searchsorted(event_s, time), 1, max(len(event_s) - 1, 1))
    left = right - 1
    right = np.minimum(right, len(event_s) - 1)
    closer_left = np.abs(time - event_s[left]) <= np.abs(time - event_s[right])
    index = np.where(closer_left, left, right)
    return time - event_s[index], index.astype(np.int64)


def _result(
    photo_s: Floats,
    resolution_s: float,
    event_s: Floats,
    tolerance: float,
    candidates: list[Candidate],
    *,
    unique: bool,
) -> Alignment:
    offset, sigma = _refined(photo_s, resolution_s, event_s, tolerance, candidates[0].offset_s)
    index = _assigned(photo_s, event_s, offset, tolerance)
    residual = np.where(index >= 0, photo_s - offset - event_s[index], np.nan)
    alone = _is_alone_both_ways(photo_s - offset, event_s, index, tolerance)
    return Alignment(
        unique=unique,
        candidates=tuple(candidates),
        offset_s=offset,
        offset_sigma_s=sigma,
        event_index=np.where(alone, index, -1),
        residual_s=np.where(alone, residual, np.nan),
    )


def _refined(
    photo_s: Floats, resolution_s: float, event_s: Floats, tolerance: float, offset: float
) -> tuple[float, float]:
    """Offset and its sigma from all pairs.

    Of a coarse clock the reading's error is uniform over its step, and the middle between the
    extremes is far better than the mean: sigma = step / sqrt(2 (n + 1) (n + 2)).
    """
    coarse = resolution_s > 0.1
    reach = 1.2 * tolerance if coarse else tolerance
    residual, index = _nearest(photo_s, event_s, offset)
    near = np.abs(residual) <= reach
    certain = near & _is_alone_both_ways(photo_s - offset, event_s, index, reach)
    pairs = residual[certain if certain.sum() >= 3 else near]
    n = len(pairs)
    if n == 0:
        return offset, tolerance
    if coarse:
        middle = float(pairs.min() + pairs.max()) / 2
        return offset + middle, float(resolution_s / np.sqrt(2 * (n + 1) * (n + 2)))
    spread = max(float(np.std(pairs)), resolution_s / np.sqrt(12))
    return offset + float(np.mean(pairs)), float(spread / np.sqrt(n))


def _assigned(photo_s: Floats, event_s: Floats, offset: float, tolerance: float) -> Ints:
    """(F,) one event for one photo: most pairs within the tolerance, then least squares.

    On a line the cheapest assignment with a convex cost never crosses: it is monotone.
    """
    residual = photo_s[:, None] - offset - event_s[None, :]
    inside = np.abs(residual) <= tolerance
    far = 1e3 * (len(photo_s) + 1) * tolerance**2  # one pair more outweighs any residuals
    rows, columns = linear_sum_assignment(np.where(inside, residual**2, far))
    index = np.full(len(photo_s), -1, dtype=np.int64)
    kept = inside[rows, columns]
    index[rows[kept]] = columns[kept]
    return index


def _is_alone_both_ways(time_s: Floats, event_s: Floats, index: Ints, tolerance: float) -> Bools:
    """(F,) whether photo and event have no other partner within the tolerance.

    An event that two photos could claim is nobody's for certain: one photo's own may be lost.
    """
    claimed_once = _is_alone(event_s, np.sort(time_s), tolerance)
    return np.asarray(_is_alone(time_s, event_s, tolerance) & claimed_once[index])


def _is_alone(time_s: Floats, event_s: Floats, tolerance: float) -> Bools:
    """(F,) whether one event only lies within the tolerance."""
    first = np.searchsorted(event_s, time_s - tolerance, side="left")
    last = np.searchsorted(event_s, time_s + tolerance, side="right")
    return np.asarray(last - first == 1)
