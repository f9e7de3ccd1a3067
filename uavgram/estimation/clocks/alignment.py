"""Alignment of a camera's photos with an autopilot's events when their clocks differ.

1. Each difference between the time of a photo and the time of an event is a vote for an offset. The
   offsets with most votes are the candidates.
2. For each candidate, photos and events are paired in their order, and offset and drift are fitted
   to the pairs. The candidate with most paired photos is the best one.
3. The best offset is unique if no other candidate explains nearly as many photos. A photo without
   an event does not count against another candidate where the log may lack the event (in a gap of
   twice the spacing, or beyond the ends): evenly spaced events also fit after a shift by one
   interval. Then the ambiguity is reported, and nothing is guessed.
4. The camera's clock, with its drift, is fitted to the pairs of the best offset. Each pair is
   tested: could another event explain the photo as well?
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.special import bdtrc

from uavgram.estimation.clocks.clock_line import (
    CAMERA_DRIFT_SIGMA,
    COARSE_STEP_S,
    ClockLine,
    fit_camera_clock,
    fit_line,
)
from uavgram.geometry.motion.interpolation import compute_running_median, make_running_windows
from uavgram.model.arrays import Bools, Floats, Ints
from uavgram.model.frames import PairStatus

# Scatter of shutters about their events: behind a feedback pin a few milliseconds, behind a command
# some 30 ms (86 to 147 ms of lag in ArduPilot's simulator). Estimated for each hypothesis between
# these.
MIN_SCATTER_S, MAX_SCATTER_S = 0.0005, 0.03
COARSE_SCATTER_S = 0.01  # used where the readings' step hides it
_TOLERANCE_SCATTERS = 4.0  # largest difference of a photo from its event
_RIVAL_TOLERANCE_FACTOR = 1.15  # factor of that tolerance for rivals
_MAX_PEAKS = 32
_MIN_SHARE = 0.6  # share of photos with an event: some logs lack a third of the events
_MIN_LEAD, _MIN_LEAD_SHARE = 3, 0.05  # lead over the best rival, in photos
_MIN_LOG_ODDS = 12.0  # log odds by which the best must lead its rivals
_PAIR_ODDS = 5.7  # odds that a photo's event is logged: 0.85 / 0.15
_CHANCE_PROBABILITY = 1e-5  # probability of as many pairs by chance at any offset tried
_MAX_LOST_SHARE = 0.3  # share of a rival's pairs that may be excused as lost events


@dataclass(frozen=True, eq=False)
class Fit:
    """One hypothesis about the clock.

    Attributes
    ----------
    clock
        Clock fitted to its own pairs.
    event_index
        (F,) nearest event within the tolerance, -1 for none.
    matched
        Number of events that have a photo.
    excused
        Number of photos without an event where one may be missing from the log.
    """

    clock: ClockLine
    event_index: Ints
    matched: int
    excused: int

    @property
    def explained(self) -> int:
        """Number of photos that do not contradict it."""
        return self.matched + self.excused


@dataclass(frozen=True, eq=False)
class Search:
    """Fits at the tolerance that suits the best one, most pairs first.

    Attributes
    ----------
    fits
        Fits, no two with the same pairs.
    tolerance_s
        Largest difference between a photo and its event.
    unique
        Whether the first one has no rival.
    """

    fits: tuple[Fit, ...]
    tolerance_s: float
    unique: bool


def search_offsets(
    photo_s: Floats, resolution_s: float, event_s: Floats, bounds_s: tuple[float, float]
) -> Search:
    """Find the best hypothesis, and whether any other is nearly as good.

    Parameters
    ----------
    photo_s
        (F,) readings, F >= 1.
    resolution_s
        Step of the readings.
    event_s
        (E,) increasing, E >= 1.
    bounds_s
        Range of the offset.
    """
    loose = resolution_s / 2 + _TOLERANCE_SCATTERS * MAX_SCATTER_S
    wide = loose + 1.5 * CAMERA_DRIFT_SIGMA * float(np.ptp(photo_s)) / 2
    start = float(event_s[0])
    # Candidates by votes, each fitted to its pairs with decreasing tolerance.
    peaks = [ClockLine(p, 0.0, start) for p in _find_peaks(photo_s, event_s, wide, bounds_s)]
    rough = [_settle(photo_s, event_s, c, (wide, max(wide / 2, loose), loose)) for c in peaks]
    clocks = [c for c in rough if c is not None]
    # Fit and judge again, within the tolerance of the likeliest candidate.
    tolerance = _best_tolerance(photo_s, resolution_s, event_s, clocks)
    usual = _usual_spacing(event_s)
    settled = [_settle(photo_s, event_s, c, (tolerance,) * 3) for c in clocks]
    inside = [c for c in settled if c is not None and bounds_s[0] <= c.offset_s <= bounds_s[1]]
    fits = _rank([_count_pairs(photo_s, event_s, usual, c, tolerance) for c in inside])
    if not fits:
        return Search((), tolerance, unique=False)
    # Unique: beyond chance, and ahead of rivals that are judged with a wider tolerance.
    generous = resolution_s / 2 + _RIVAL_TOLERANCE_FACTOR * (tolerance - resolution_s / 2)
    rivals = [_count_pairs(photo_s, event_s, usual, f.clock, generous) for f in fits[1:]]
    unique = _is_beyond_chance(fits[0], photo_s, event_s, tolerance, bounds_s) and _leads(
        fits[0], rivals, _chance_probability(event_s, tolerance)
    )
    return Search(tuple(fits), tolerance, unique=unique)


def _best_tolerance(
    photo_s: Floats, resolution_s: float, event_s: Floats, clocks: list[ClockLine]
) -> float:
    """Compute the tolerance that suits the hypothesis with the highest likelihood.

    The scatter of each is that of all its pairs, reduced from the largest: a few pairs that happen
    to fit closely do not make a hypothesis good.
    """
    best, tolerance = -np.inf, resolution_s / 2 + _TOLERANCE_SCATTERS * COARSE_SCATTER_S
    if resolution_s > COARSE_STEP_S:
        return tolerance
    for clock in clocks:
        residual, index = find_nearest(clock.to_time(photo_s), event_s)
        reach = resolution_s / 2 + _TOLERANCE_SCATTERS * MAX_SCATTER_S
        for _ in range(4):
            near = np.abs(residual) <= reach
            middle = float(residual[near].mean()) if near.any() else 0.0
            scatter = float(np.std(residual[near])) if near.sum() > 2 else MAX_SCATTER_S
            scatter = float(np.clip(scatter, MIN_SCATTER_S, MAX_SCATTER_S))
            residual, reach = residual - middle, resolution_s / 2 + _TOLERANCE_SCATTERS * scatter
        pairs = len(np.unique(index[np.abs(residual) <= reach]))
        score = pairs * np.log(_PAIR_ODDS / _chance_probability(event_s, reach))
        if score > best:
            best, tolerance = score, reach
    return tolerance


def find_nearest(time_s: Floats, event_s: Floats) -> tuple[Floats, Ints]:
    """Return (F,) time minus nearest event's time, and the index of that event."""
    after = np.searchsorted(event_s, time_s)
    left = np.maximum(after - 1, 0)
    right = np.minimum(after, len(event_s) - 1)
    closer_left = np.abs(time_s - event_s[left]) <= np.abs(time_s - event_s[right])
    index = np.where(closer_left, left, right)
    return time_s - event_s[index], index.astype(np.int64)


def _find_peaks(
    photo_s: Floats, event_s: Floats, tolerance_s: float, bounds_s: tuple[float, float]
) -> list[float]:
    """Return offsets with the most votes within the tolerance, the densest first."""
    votes = np.sort((photo_s[:, None] - event_s[None, :]).ravel())
    votes = votes[(votes >= bounds_s[0] - tolerance_s) & (votes <= bounds_s[1] + tolerance_s)]
    if not len(votes):
        return []
    count = np.searchsorted(votes, votes + 2 * tolerance_s, side="right") - np.arange(len(votes))
    # Offsets that differ by more than this may pair other events: both are kept.
    apart = 2 * tolerance_s
    if len(event_s) > 1:
        apart = min(apart, 0.4 * float(np.quantile(np.diff(event_s), 0.05)))
    apart = max(apart, 1e-3)
    found: list[float] = []
    for _ in range(_MAX_PEAKS):
        k = int(np.argmax(count))
        if count[k] <= 0:
            break
        found.append(float(np.mean(votes[k : k + count[k]])))
        first, last = np.searchsorted(votes, [votes[k] - apart, votes[k] + apart])
        count[first : max(last, k + 1)] = 0
    return found


def _settle(
    photo_s: Floats, event_s: Floats, clock: ClockLine, tolerances_s: tuple[float, ...]
) -> ClockLine | None:
    """Fit the clock to its pairs with decreasing tolerance; None if no pairs are left."""
    for tolerance in tolerances_s:
        residual, index = find_nearest(clock.to_time(photo_s), event_s)
        near = np.abs(residual) <= tolerance
        if not near.any():
            return None
        clock = fit_line(
            event_s[index[near]],
            photo_s[near],
            CAMERA_DRIFT_SIGMA,
            tolerance / np.sqrt(3.0),
        )
    return clock


def _count_pairs(
    photo_s: Floats, event_s: Floats, usual_s: Floats, clock: ClockLine, tolerance_s: float
) -> Fit:
    """Count the pairs of a fitted clock, and the photos without one that are excused."""
    time = clock.to_time(photo_s)
    residual, index = find_nearest(time, event_s)
    near = np.abs(residual) <= tolerance_s
    matched = len(np.unique(index[near]))
    excused = int(_may_be_missing(time[~near], event_s, usual_s, tolerance_s).sum())
    # Any offset pairs one photo: more may be excused only where more are paired.
    allowed = min(max(2, int(_MAX_LOST_SHARE * matched)), matched // 2)
    return Fit(clock, np.where(near, index, -1), matched, min(excused, allowed))


def _chance_probability(event_s: Floats, tolerance_s: float) -> float:
    """Compute the probability that any instant is within the tolerance of an event."""
    density = (len(event_s) - 1) / max(float(np.ptp(event_s)), 1e-9)
    return float(np.clip(2 * tolerance_s * density, 1e-6, 0.95))


def _usual_spacing(event_s: Floats) -> Floats:
    """Compute the (E - 1,) median spacing about each interval between events."""
    spacing = np.diff(event_s)
    if not len(spacing):
        return spacing
    return compute_running_median(spacing, min(11, len(spacing)))


def _may_be_missing(time_s: Floats, event_s: Floats, usual_s: Floats, tolerance_s: float) -> Bools:
    """Mark (F,) instants at which an additional event would keep the usual spacing."""
    if not len(usual_s):
        return np.ones(len(time_s), dtype=bool)
    right = np.searchsorted(event_s, time_s)
    least = 0.7 * usual_s[np.minimum(np.maximum(right - 1, 0), len(usual_s) - 1)]
    padded = np.concatenate([[-np.inf], event_s, [np.inf]])
    first = np.maximum(time_s - tolerance_s, padded[right] + least)
    last = np.minimum(time_s + tolerance_s, padded[right + 1] - least)
    return np.asarray(first <= last)


def _rank(fits: list[Fit]) -> list[Fit]:
    """Sort by number of pairs, without those that converged to the pairs of a better one."""
    kept: list[Fit] = []
    pairs = np.full((len(fits), len(fits[0].event_index) if fits else 0), -1, dtype=np.int64)
    for fit in sorted(fits, key=lambda f: (-f.matched, abs(f.clock.offset_s))):
        paired = fit.event_index >= 0
        same = (pairs[: len(kept)] == fit.event_index) & paired
        if fit.matched and not (same.sum(axis=1) > 0.5 * paired.sum()).any():
            pairs[len(kept)] = fit.event_index
            kept.append(fit)
    return kept


def _is_beyond_chance(
    best: Fit,
    photo_s: Floats,
    event_s: Floats,
    tolerance_s: float,
    bounds_s: tuple[float, float],
) -> bool:
    """Return whether most photos, and at least three, are paired, and more than by chance."""
    count = len(photo_s)
    if best.matched < max(_MIN_PAIRS, _MIN_SHARE * count):
        return False
    if np.isfinite(bounds_s).all():
        return True
    tried = (np.ptp(photo_s) + np.ptp(event_s)) / tolerance_s
    by_luck = float(bdtrc(best.matched - 1, count, _chance_probability(event_s, tolerance_s)))
    return bool(tried * by_luck < _CHANCE_PROBABILITY)


def _leads(best: Fit, rivals: list[Fit], by_chance: float) -> bool:
    """Return whether the rivals leave so many photos unexplained that they are excluded.

    Evidence of one photo with an event for a hypothesis: the odds that its event is logged, times
    the density of a reading about its event (one over the window) against that of events anywhere.
    """
    gain_nats = float(np.log(_PAIR_ODDS / by_chance))
    needed = max(_MIN_LEAD, _MIN_LEAD_SHARE * len(best.event_index), _MIN_LOG_ODDS / gain_nats)
    return best.explained - max((fit.explained for fit in rivals), default=-np.inf) >= needed


_STATUS: tuple[PairStatus, ...] = ("certain", "hidden", "crowded", "none")
_CERTAIN_INDEX = 0
_MIN_PAIRS = 3

_GATE_SIGMAS = 5.0
_GATE_FLOOR_S, _GATE_LIMIT_S = 0.03, 0.25
_LINE_SIGMAS = 4.0
# Smallest spacing of events, as a share of the least spacing around, and of any camera [s]: if the
# log lost one, its neighbours still show how fast the camera was triggered.
_SPACING_SHARE = 0.6
_MIN_SPACING_S = 0.1
_SPACING_COUNT = 21


@dataclass(frozen=True, eq=False)
class Alignment:
    """Alignment of F photos.

    Attributes
    ----------
    unique
        Whether one offset is clearly better than every other; otherwise pairs have no meaning.
    candidates
        Best first; at least one unless there is nothing to align.
    clock
        Clock of the camera, by the best candidate: offset and drift with their sigmas.
    event_index
        (F,) the photo's event, -1 if it has none; each event at most once.
    status
        (F,) ``certain``: no other event and no other photo is possible. ``crowded``: one is.
        ``hidden``: the photo's own event and the paired event's own photo may both be lost.
        ``none``: no event.
    residual_s
        (F,) photo time on the events' clock - event time; NaN without an event.
    photo_event_s
        (F,) the photos' own times on the events' clock.
    """

    unique: bool
    candidates: tuple[Fit, ...]
    clock: ClockLine
    event_index: Ints
    status: tuple[PairStatus, ...]
    residual_s: Floats
    photo_event_s: Floats

    @property
    def certain(self) -> Bools:
        """(F,) whether the pair is reliable."""
        return np.array([status == "certain" for status in self.status], dtype=bool)


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
        Step of the readings.
    event_s
        (E,) increasing.
    bounds_s
        Range of the offset.
    """
    photo = np.asarray(photo_s, dtype=np.float64)
    event = np.asarray(event_s, dtype=np.float64)
    if not len(photo) or not len(event):
        return _none(len(photo))
    search = search_offsets(photo, resolution_s, event, bounds_s)
    if not search.fits:
        return _none(len(photo))
    clock = _fit_camera(photo, resolution_s, event, search)
    time = clock.to_time(photo)
    tolerance = resolution_s / 2 + _gate_s(clock) + _LINE_SIGMAS * clock.sigma_at(time)
    index = _assign(time, event, tolerance)
    return Alignment(
        unique=search.unique,
        candidates=search.fits,
        clock=clock,
        event_index=index,
        status=_make_candidates(_determine_status(time, event, index, tolerance)),
        residual_s=np.where(index >= 0, time - event[index], np.nan),
        photo_event_s=time,
    )


def _none(count: int) -> Alignment:
    nothing = np.full(count, np.nan)
    return Alignment(
        unique=False,
        candidates=(),
        clock=ClockLine(float("nan"), 0.0, 0.0),
        event_index=np.full(count, -1, dtype=np.int64),
        status=_make_candidates(np.full(count, 3)),
        residual_s=nothing,
        photo_event_s=nothing,
    )


def _gate_s(clock: ClockLine) -> float:
    """Return the largest difference of a shutter from its event beside the readings' step."""
    return float(np.clip(_GATE_SIGMAS * clock.scatter_s, _GATE_FLOOR_S, _GATE_LIMIT_S))


def _fit_camera(photo_s: Floats, resolution_s: float, event_s: Floats, search: Search) -> ClockLine:
    """Fit the camera's clock to its unambiguous pairs, whose scatter replaces the search's."""
    clock = search.fits[0].clock
    reach = max(search.tolerance_s, resolution_s / 2 + _GATE_FLOOR_S)
    for _ in range(3):
        time = clock.to_time(photo_s)
        tolerance = np.full(len(time), reach)
        index = _assign(time, event_s, tolerance)
        if not (index >= 0).any():
            return clock
        used = _is_alone_both_ways(time, event_s, index, tolerance)
        if used.sum() < _MIN_PAIRS:
            used = index >= 0
        clock = fit_camera_clock(event_s[index[used]], photo_s[used], resolution_s)
        reach = resolution_s / 2 + _gate_s(clock)
    return clock


def _assign(time_s: Floats, event_s: Floats, tolerance_s: Floats) -> Ints:
    """Assign (F,) one event to one photo: most pairs within the tolerance, then least squares.

    On a line the cheapest assignment with a convex cost never crosses: it is monotone.
    """
    residual = time_s[:, None] - event_s[None, :]
    inside = np.abs(residual) <= tolerance_s[:, None]
    index = np.full(len(time_s), -1, dtype=np.int64)
    if inside.sum(axis=1).max() <= 1 and inside.sum(axis=0).max() <= 1:  # no ambiguity
        rows, columns = np.nonzero(inside)
        index[rows] = columns
        return index
    from scipy.optimize import linear_sum_assignment  # noqa: PLC0415 - slow to load

    # One more pair outweighs any residuals.
    far = 1e3 * (len(time_s) + 1) * float(np.max(tolerance_s)) ** 2
    rows, columns = linear_sum_assignment(np.where(inside, residual**2, far))
    kept = inside[rows, columns]
    index[rows[kept]] = columns[kept]
    return index


def _make_candidates(codes: Ints) -> tuple[PairStatus, ...]:
    names: list[PairStatus] = [_STATUS[code] for code in codes]
    return tuple(names)


def _determine_status(time_s: Floats, event_s: Floats, index: Ints, tolerance_s: Floats) -> Ints:
    """Return (F,) indices into `_STATUS`."""
    alone = _is_alone_both_ways(time_s, event_s, index, tolerance_s)
    hidden = _could_hide_its_own(time_s, event_s, index, tolerance_s)
    return np.where(index < 0, 3, np.where(~alone, 2, np.where(hidden, 1, _CERTAIN_INDEX)))


def _is_alone_both_ways(time_s: Floats, event_s: Floats, index: Ints, tolerance_s: Floats) -> Bools:
    """Mark (F,) pairs whose photo and event have no other partner within the tolerance.

    An event that two photos could claim is certain for neither: the own event of one may be lost.
    """
    claims = np.abs(time_s[:, None] - event_s[None, :]) <= tolerance_s[:, None]
    return np.asarray((claims.sum(axis=1) == 1) & (claims.sum(axis=0)[index] == 1) & (index >= 0))


def _could_hide_its_own(time_s: Floats, event_s: Floats, index: Ints, tolerance_s: Floats) -> Bools:
    """Mark (F,) photos whose own event could be lost from the log, beside the paired one.

    It would be within the photo's tolerance, and keep a camera's spacing to its neighbours.
    """
    if len(event_s) < 2:
        return np.ones(len(time_s), dtype=bool)
    spacing = make_running_windows(np.diff(event_s), _SPACING_COUNT).min(axis=1)
    padded = np.concatenate([[-np.inf], event_s, [np.inf]])
    k = np.maximum(index, 0)
    least = np.maximum(_SPACING_SHARE * spacing[np.minimum(k, len(spacing) - 1)], _MIN_SPACING_S)
    own = event_s[k]
    after = own + least < np.minimum(time_s + tolerance_s, padded[k + 2] - least)
    before = own - least > np.maximum(time_s - tolerance_s, padded[k] + least)
    return np.asarray(after | before)
