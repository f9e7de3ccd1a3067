"""Under which offsets of a camera's clock its photos fall on an autopilot's events.

Every difference of a photo's and an event's time votes; the densest windows of votes are the
candidates. Each is settled on its own pairs, drift included, and judged by how many photos fall on
an event each. What speaks for a rival is counted generously: a photo without an event does not
speak against it where an event may just be missing from the log (a gap of twice the spacing, or
beyond the ends), because that is how a shift by one interval looks in evenly spaced events.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.special import bdtrc

from uavgram.estimation.clocks.clock_line import (
    CAMERA_DRIFT_SIGMA,
    COARSE_S,
    ClockLine,
    fit_line,
)
from uavgram.geometry.motion.running import running_median
from uavgram.model.arrays import Bools, Floats, Ints

# Of shutters about their events: behind a feedback pin a few milliseconds, behind a command some
# 30 ms (86 to 147 ms of lag in ArduPilot's simulator). Found for each hypothesis between these.
LEAST_SCATTER_S, MOST_SCATTER_S = 0.0005, 0.03
COARSE_SCATTER_S = 0.01  # taken where the readings' step hides it
_SCATTERS = 4.0  # that a photo may be from its event
_GENEROSITY = 1.15  # rivals are given that much more of them
_PEAKS = 32
_LEAST_PAIRS = 3
_LEAST_SHARE = 0.6  # of the photos on an event: a third of the events were seen to be missing
_LEAST_LEAD, _LEAST_LEAD_SHARE = 3, 0.05  # in photos, before the best of the rivals
_LEAD_NATS = 12.0  # log odds that a rival has to trail by
_PAIR_ODDS = 5.7  # a photo's event is logged rather than lost: 0.85 / 0.15
_CHANCE = 1e-5  # that chance makes as many pairs at one of the offsets tried
_LOST_SHARE = 0.3  # of a rival's pairs that may be excused as lost events


@dataclass(frozen=True, eq=False)
class Fit:
    """One hypothesis about the clock.

    Attributes
    ----------
    clock
        Settled on its own pairs.
    event_index
        (F,) nearest event within the tolerance, -1 for none.
    matched
        Events that have a photo.
    excused
        Photos without an event where one may be missing from the log.
    """

    clock: ClockLine
    event_index: Ints
    matched: int
    excused: int

    @property
    def explained(self) -> int:
        """Photos that do not speak against it."""
        return self.matched + self.excused


@dataclass(frozen=True, eq=False)
class Search:
    """The fits at the tolerance that suits the best one, most pairs first.

    Attributes
    ----------
    fits
        No two of them pair the same.
    tolerance_s
        Within which a photo is on an event.
    unique
        Whether the first one stands alone.
    """

    fits: tuple[Fit, ...]
    tolerance_s: float
    unique: bool


def search_offsets(
    photo_s: Floats, resolution_s: float, event_s: Floats, bounds_s: tuple[float, float]
) -> Search:
    """Find the best hypothesis, and whether any other comes near it.

    Parameters
    ----------
    photo_s
        (F,) readings, F >= 1.
    resolution_s
        Their step.
    event_s
        (E,) increasing, E >= 1.
    bounds_s
        Between which the offset must lie.
    """
    loose = resolution_s / 2 + _SCATTERS * MOST_SCATTER_S
    wide = loose + 1.5 * CAMERA_DRIFT_SIGMA * float(np.ptp(photo_s)) / 2
    start = float(event_s[0])
    peaks = [ClockLine(p, 0.0, start) for p in _peaks(photo_s, event_s, wide, bounds_s)]
    rough = [_settle(photo_s, event_s, c, (wide, max(wide / 2, loose), loose)) for c in peaks]
    clocks = [c for c in rough if c is not None]
    tolerance = _best_tolerance(photo_s, resolution_s, event_s, clocks)
    usual = _usual_spacing(event_s)
    settled = [_settle(photo_s, event_s, c, (tolerance,) * 3) for c in clocks]
    inside = [c for c in settled if c is not None and bounds_s[0] <= c.offset_s <= bounds_s[1]]
    fits = _ranked([_judged(photo_s, event_s, usual, c, tolerance) for c in inside])
    if not fits:
        return Search((), tolerance, unique=False)
    generous = resolution_s / 2 + _GENEROSITY * (tolerance - resolution_s / 2)
    rivals = [_judged(photo_s, event_s, usual, f.clock, generous) for f in fits[1:]]
    unique = _is_beyond_chance(fits[0], photo_s, event_s, tolerance, bounds_s) and _leads(
        fits[0], rivals, _by_chance(event_s, tolerance)
    )
    return Search(tuple(fits), tolerance, unique=unique)


def _best_tolerance(
    photo_s: Floats, resolution_s: float, event_s: Floats, clocks: list[ClockLine]
) -> float:
    """The tolerance that suits the hypothesis with the highest likelihood.

    Each one's scatter is that of all its pairs, drawn in from the loosest: a hypothesis is not
    made good by the few pairs that happen to fit it closely.
    """
    best, tolerance = -np.inf, resolution_s / 2 + _SCATTERS * COARSE_SCATTER_S
    if resolution_s > COARSE_S:
        return tolerance
    for clock in clocks:
        residual, index = nearest(clock.to_time(photo_s), event_s)
        reach = resolution_s / 2 + _SCATTERS * MOST_SCATTER_S
        for _ in range(4):
            near = np.abs(residual) <= reach
            middle = float(residual[near].mean()) if near.any() else 0.0
            scatter = float(np.std(residual[near])) if near.sum() > 2 else MOST_SCATTER_S
            scatter = float(np.clip(scatter, LEAST_SCATTER_S, MOST_SCATTER_S))
            residual, reach = residual - middle, resolution_s / 2 + _SCATTERS * scatter
        pairs = len(np.unique(index[np.abs(residual) <= reach]))
        score = pairs * np.log(_PAIR_ODDS / _by_chance(event_s, reach))
        if score > best:
            best, tolerance = score, reach
    return tolerance


def nearest(time_s: Floats, event_s: Floats) -> tuple[Floats, Ints]:
    """(F,) time - nearest event's time, and that event."""
    after = np.searchsorted(event_s, time_s)
    left = np.maximum(after - 1, 0)
    right = np.minimum(after, len(event_s) - 1)
    closer_left = np.abs(time_s - event_s[left]) <= np.abs(time_s - event_s[right])
    index = np.where(closer_left, left, right)
    return time_s - event_s[index], index.astype(np.int64)


def _peaks(
    photo_s: Floats, event_s: Floats, tolerance_s: float, bounds_s: tuple[float, float]
) -> list[float]:
    """Offsets with the most votes within the tolerance, the densest first."""
    votes = np.sort((photo_s[:, None] - event_s[None, :]).ravel())
    votes = votes[(votes >= bounds_s[0] - tolerance_s) & (votes <= bounds_s[1] + tolerance_s)]
    if not len(votes):
        return []
    count = np.searchsorted(votes, votes + 2 * tolerance_s, side="right") - np.arange(len(votes))
    # Offsets further apart than this may pair other events: both are kept.
    apart = 2 * tolerance_s
    if len(event_s) > 1:
        apart = min(apart, 0.4 * float(np.quantile(np.diff(event_s), 0.05)))
    apart = max(apart, 1e-3)
    found: list[float] = []
    for _ in range(_PEAKS):
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
    """Draw the tolerance in about the pairs; None where none are left."""
    for tolerance in tolerances_s:
        residual, index = nearest(clock.to_time(photo_s), event_s)
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


def _judged(
    photo_s: Floats, event_s: Floats, usual_s: Floats, clock: ClockLine, tolerance_s: float
) -> Fit:
    """Pairs of a settled clock, and which photos without one are excused."""
    time = clock.to_time(photo_s)
    residual, index = nearest(time, event_s)
    near = np.abs(residual) <= tolerance_s
    matched = len(np.unique(index[near]))
    excused = int(_may_be_missing(time[~near], event_s, usual_s, tolerance_s).sum())
    allowed = max(2, int(_LOST_SHARE * matched))
    return Fit(clock, np.where(near, index, -1), matched, min(excused, allowed))


def _by_chance(event_s: Floats, tolerance_s: float) -> float:
    """Probability that any instant lies within the tolerance of an event."""
    density = (len(event_s) - 1) / max(float(np.ptp(event_s)), 1e-9)
    return float(np.clip(2 * tolerance_s * density, 1e-6, 0.95))


def _usual_spacing(event_s: Floats) -> Floats:
    """(E - 1,) median spacing about each interval between events."""
    spacing = np.diff(event_s)
    if not len(spacing):
        return spacing
    return running_median(spacing, min(11, len(spacing)))


def _may_be_missing(time_s: Floats, event_s: Floats, usual_s: Floats, tolerance_s: float) -> Bools:
    """(F,) whether an event about these instants would keep the usual spacing to its neighbours."""
    if not len(usual_s):
        return np.ones(len(time_s), dtype=bool)
    right = np.searchsorted(event_s, time_s)
    least = 0.7 * usual_s[np.minimum(np.maximum(right - 1, 0), len(usual_s) - 1)]
    padded = np.concatenate([[-np.inf], event_s, [np.inf]])
    first = np.maximum(time_s - tolerance_s, padded[right] + least)
    last = np.minimum(time_s + tolerance_s, padded[right + 1] - least)
    return np.asarray(first <= last)


def _ranked(fits: list[Fit]) -> list[Fit]:
    """Most pairs first, without those that settled on the pairs of a better one."""
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
    """Three pairs at least, most photos paired, and more than one of all offsets gives by luck."""
    count = len(photo_s)
    if best.matched < max(_LEAST_PAIRS, _LEAST_SHARE * count):
        return False
    if np.isfinite(bounds_s).all():
        return True
    tried = (np.ptp(photo_s) + np.ptp(event_s)) / tolerance_s
    by_luck = float(bdtrc(best.matched - 1, count, _by_chance(event_s, tolerance_s)))
    return bool(tried * by_luck < _CHANCE)


def _leads(best: Fit, rivals: list[Fit], by_chance: float) -> bool:
    """Whether the rivals leave so many photos unexplained that they are out of the question.

    What one photo on an event speaks for a hypothesis: the odds that its event is logged, times
    the density of a reading about its event (one over the window) against that of events anywhere.
    """
    gain_nats = float(np.log(_PAIR_ODDS / by_chance))
    needed = max(_LEAST_LEAD, _LEAST_LEAD_SHARE * len(best.event_index), _LEAD_NATS / gain_nats)
    return best.explained - max((fit.explained for fit in rivals), default=-np.inf) >= needed
