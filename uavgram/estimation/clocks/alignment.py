"""Which of a camera's photos is which of an autopilot's events, when the clocks differ.

Monotone alignment with gaps on both sides. The search for the offset (offset_search.py) says
whether only one fits; here its pairs are drawn, the camera's clock is fitted to them with its
drift, and every pair is asked whether another one could explain the photo as well. Evenly spaced
events fit at several offsets: that is seen, not guessed away.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from uavgram.estimation.clocks.clock_line import ClockLine, fit_camera_clock
from uavgram.estimation.clocks.offset_search import Fit, Search, search_offsets
from uavgram.geometry.motion.running import windows
from uavgram.model.arrays import Bools, Floats, Ints
from uavgram.model.flight.pairing import PairStatus

_STATUS: tuple[PairStatus, ...] = ("certain", "hidden", "crowded", "none")
_CERTAIN = 0
_LEAST_PAIRS = 3

_GATE_SIGMAS = 5.0
_GATE_FLOOR_S, _GATE_LIMIT_S = 0.03, 0.25
_LINE_SIGMAS = 4.0
# No event closer to another than this share of the least spacing around it, nor than any camera
# shoots: where the log lost one, its neighbours still show how fast the camera was triggered.
_SPACING_SHARE = 0.6
_FASTEST_S = 0.1
_SPACINGS_AROUND = 21


@dataclass(frozen=True, eq=False)
class Alignment:
    """The result for F photos.

    Attributes
    ----------
    unique
        Whether one offset is clearly better than every other; pairs mean nothing without it.
    candidates
        Best first; at least one unless there is nothing to align.
    clock
        Of the camera, by the best candidate: offset and drift with their sigmas.
    event_index
        (F,) the photo's event, -1 where it has none; each event at most once.
    status
        (F,) ``certain``: no other event and no other photo comes into question. ``crowded``: one
        does. ``hidden``: the photo's own event and the paired event's own photo may both be lost.
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
        """(F,) whether the pair can be relied on."""
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
        Their step.
    event_s
        (E,) increasing.
    bounds_s
        Between which the offset must lie.
    """
    photo = np.asarray(photo_s, dtype=np.float64)
    event = np.asarray(event_s, dtype=np.float64)
    if not len(photo) or not len(event):
        return _none(len(photo))
    search = search_offsets(photo, resolution_s, event, bounds_s)
    if not search.fits:
        return _none(len(photo))
    clock = _fitted(photo, resolution_s, event, search)
    time = clock.to_time(photo)
    tolerance = resolution_s / 2 + _gate_s(clock) + _LINE_SIGMAS * clock.sigma_at(time)
    index = _assigned(time, event, tolerance)
    return Alignment(
        unique=search.unique,
        candidates=search.fits,
        clock=clock,
        event_index=index,
        status=_named(_status(time, event, index, tolerance)),
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
        status=_named(np.full(count, 3)),
        residual_s=nothing,
        photo_event_s=nothing,
    )


def _gate_s(clock: ClockLine) -> float:
    """How far a shutter may be from its event beside the readings' step."""
    return float(np.clip(_GATE_SIGMAS * clock.scatter_s, _GATE_FLOOR_S, _GATE_LIMIT_S))


def _fitted(photo_s: Floats, resolution_s: float, event_s: Floats, search: Search) -> ClockLine:
    """The camera's clock from its unmistakable pairs; the scatter is theirs, not the search's."""
    clock = search.fits[0].clock
    reach = max(search.tolerance_s, resolution_s / 2 + _GATE_FLOOR_S)
    for _ in range(3):
        time = clock.to_time(photo_s)
        tolerance = np.full(len(time), reach)
        index = _assigned(time, event_s, tolerance)
        if not (index >= 0).any():
            return clock
        used = _is_alone_both_ways(time, event_s, index, tolerance)
        if used.sum() < _LEAST_PAIRS:
            used = index >= 0
        clock = fit_camera_clock(event_s[index[used]], photo_s[used], resolution_s)
        reach = resolution_s / 2 + _gate_s(clock)
    return clock


def _assigned(time_s: Floats, event_s: Floats, tolerance_s: Floats) -> Ints:
    """(F,) one event for one photo: most pairs within the tolerance, then least squares.

    On a line the cheapest assignment with a convex cost never crosses: it is monotone.
    """
    residual = time_s[:, None] - event_s[None, :]
    inside = np.abs(residual) <= tolerance_s[:, None]
    index = np.full(len(time_s), -1, dtype=np.int64)
    if inside.sum(axis=1).max() <= 1 and inside.sum(axis=0).max() <= 1:  # nothing to choose
        rows, columns = np.nonzero(inside)
        index[rows] = columns
        return index
    from scipy.optimize import linear_sum_assignment  # noqa: PLC0415 - slow to load

    # one pair more outweighs any residuals
    far = 1e3 * (len(time_s) + 1) * float(np.max(tolerance_s)) ** 2
    rows, columns = linear_sum_assignment(np.where(inside, residual**2, far))
    kept = inside[rows, columns]
    index[rows[kept]] = columns[kept]
    return index


def _named(codes: Ints) -> tuple[PairStatus, ...]:
    names: list[PairStatus] = [_STATUS[code] for code in codes]
    return tuple(names)


def _status(time_s: Floats, event_s: Floats, index: Ints, tolerance_s: Floats) -> Ints:
    """(F,) index into `_STATUS`."""
    alone = _is_alone_both_ways(time_s, event_s, index, tolerance_s)
    hidden = _could_hide_its_own(time_s, event_s, index, tolerance_s)
    return np.where(index < 0, 3, np.where(~alone, 2, np.where(hidden, 1, _CERTAIN)))


def _is_alone_both_ways(time_s: Floats, event_s: Floats, index: Ints, tolerance_s: Floats) -> Bools:
    """(F,) whether photo and event have no other partner within the tolerance.

    An event that two photos could claim is nobody's for certain: one photo's own may be lost.
    """
    claims = np.abs(time_s[:, None] - event_s[None, :]) <= tolerance_s[:, None]
    return np.asarray((claims.sum(axis=1) == 1) & (claims.sum(axis=0)[index] == 1) & (index >= 0))


def _could_hide_its_own(time_s: Floats, event_s: Floats, index: Ints, tolerance_s: Floats) -> Bools:
    """(F,) whether an event that the log lost could be the photo's, beside the paired one.

    It would lie within the photo's tolerance, and keep a camera's spacing to its neighbours.
    """
    if len(event_s) < 2:
        return np.ones(len(time_s), dtype=bool)
    spacing = windows(np.diff(event_s), _SPACINGS_AROUND).min(axis=1)
    padded = np.concatenate([[-np.inf], event_s, [np.inf]])
    k = np.maximum(index, 0)
    least = np.maximum(_SPACING_SHARE * spacing[np.minimum(k, len(spacing) - 1)], _FASTEST_S)
    own = event_s[k]
    after = own + least < np.minimum(time_s + tolerance_s, padded[k + 2] - least)
    before = own - least > np.maximum(time_s - tolerance_s, padded[k] + least)
    return np.asarray(after | before)
