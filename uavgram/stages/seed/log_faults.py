"""Where a flight's track contradicts itself, found before any adjustment.

Jumps of place that the stated velocity does not explain, jumps of attitude, values that stand
still while the vehicle flies, silence at an exposure, and a receiver that goes another way than
the estimator. What is unusual the track itself says: a change counts where it exceeds the stated
sigmas and is far out of the changes about it. Only what lies between the first and the last
exposure parts photos from each other.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
from scipy.ndimage import median_filter, percentile_filter

from uavgram.geometry.motion.rotation import log_so3, matrix_from_xyzw
from uavgram.model.arrays import Bools, Floats, Ints
from uavgram.model.flight.log import Track
from uavgram.model.flight.second_opinions import FaultKind, FlightEvidence, LogFault

MARGIN_S = 15.0
"""Of the track looked at before the first exposure and after the last one."""
# Undamaged logs (ArduPilot, PX4, real and simulated): between neighbouring samples the place
# departs from the stated velocity by at most 2.6 times the ninth decile of the changes about it.
_UNUSUAL, _ABOUT = 5.0, 61
_SMALLEST_M, _SMALLEST_RAD = 0.1, np.radians(5.0)
_ACCELERATION_M_S2 = 6.0
# A multicopter tilts by up to 30 degrees within a quarter of a second.
_TURN_RAD_S2 = np.radians(500.0)
_FEWEST = 8
_FROZEN_S, _FROZEN_STEPS = 1.0, 4
_GAP_S, _UNUSUAL_GAP = 1.0, 3.0  # as the longest steady turn
_GUST_M_S2 = 2.0  # of the way between two samples, on which nothing is known
_TURNING_RAD_S = np.radians(5.0)
_RESET_S = 1.0
_APART_SIGMAS, _SMOOTH_S = 6.0, 5.0


class _Steps(NamedTuple):
    """M changes from sample to sample that nothing explains, and what is usual.

    Attributes
    ----------
    time_s
        (M + 1,) of the samples.
    change
        (M, 3).
    allowed
        (M, 2) horizontal and vertical.
    """

    time_s: Floats
    change: Floats
    allowed: Floats


def find_faults(track: Track, evidence: FlightEvidence, exposure_s: Floats) -> tuple[LogFault, ...]:
    """Faults of a track between the first and the last exposure, in the order of time.

    Parameters
    ----------
    track
        As it goes into the seed poses.
    evidence
        What it can be held against.
    exposure_s
        (N,) UTC instants of the photos.
    """
    if not len(exposure_s):
        return ()
    first, last = float(exposure_s.min()), float(exposure_s.max())
    frozen, place = _places(track, evidence, first, last)
    still, turns = _attitudes(track, first, last)
    jumps = [*_jumps(place, "position-jump", first, last)]
    found = [*frozen, *jumps, *still, *_jumps(turns, "attitude-jump", first, last)]
    found += _gaps(track, exposure_s)
    if not jumps and not frozen:
        found += _receiver_apart(track, evidence, first, last)
    reasons = [_explained(fault, evidence) for fault in found]
    return tuple(sorted(reasons, key=lambda fault: fault.start_s))


def _places(
    track: Track, evidence: FlightEvidence, first: float, last: float
) -> tuple[list[LogFault], _Steps]:
    """Runs of one place, and the changes of place less the way that the velocity makes."""
    rows = _within(track.position_time_s, first, last)
    time, place = track.position_time_s[rows], track.position_world_m[rows]
    frozen = []
    keep = np.ones(len(time), dtype=np.bool_)
    for start, end in _still_runs(time, place):
        way = _way(evidence, time[[start, end]])[0]
        if np.isnan(way).any():  # as fast as before
            before = max(start - _FROZEN_STEPS, 0)
            share = (time[end] - time[start]) / max(time[start] - time[before], 1e-9)
            way = (place[start] - place[before]) * share
        if np.hypot(*way[:2]) > max(1.0, _sigma(track, time[start])[0]):
            keep[start + 1 : end + 1] = False
            if time[end] >= first and time[start] <= last:
                frozen.append(_fault("position-frozen", time[start], time[end], way))
    time, place = time[keep], place[keep]
    if len(time) < _FEWEST:
        return frozen, _no_steps()
    change = np.diff(place, axis=0)
    way = _way(evidence, time)
    stated = np.isfinite(way).all(axis=1)
    change = np.where(stated[:, None], change - np.nan_to_num(way), _unlike(time, change))
    step_s = np.diff(time)
    spacing = np.where(stated, np.minimum(step_s, _spacing(evidence, time)), step_s)
    floor = np.maximum(_SMALLEST_M, 0.5 * _ACCELERATION_M_S2 * spacing**2)
    sigma = _sigma(track, time[1:])
    size = np.stack([np.hypot(*change[:, :2].T), np.abs(change[:, 2])], axis=1)
    usual = np.stack([_usual(column) for column in size.T], axis=1)
    return frozen, _Steps(time, change, np.maximum(np.maximum(floor[:, None], sigma), usual))


def _attitudes(track: Track, first: float, last: float) -> tuple[list[LogFault], _Steps]:
    """Runs of one attitude, and turns that differ from those before and after."""
    rows = _within(track.attitude_time_s, first, last)
    time, xyzw = track.attitude_time_s[rows], track.world_from_body_xyzw[rows]
    if len(time) < _FEWEST:
        return [], _no_steps()
    rotation = matrix_from_xyzw(xyzw)
    # about the world's axes: R' = exp(turn) R
    turn = log_so3(rotation[1:] @ np.swapaxes(rotation[:-1], 1, 2))
    step_s = np.diff(time)
    frozen = []
    keep = np.ones(len(time), dtype=np.bool_)
    for start, end in _still_runs(time, xyzw):
        keep[start + 1 : end + 1] = False
        if time[end] >= first and time[start] <= last:
            caught_up = np.abs(turn[min(end, len(turn) - 1)])
            may_turn = caught_up + _TURNING_RAD_S * (time[end] - time[start])
            frozen.append(_fault("attitude-frozen", time[start], time[end], may_turn))
    # The turn that ends a standstill is no jump of its own.
    moving = keep[1:] & keep[:-1]
    change = np.where(moving[:, None], _unlike(time, turn), 0.0)
    size = np.stack([np.hypot(*change[:, :2].T), np.abs(change[:, 2])], axis=1)
    usual = np.stack([_usual(column) for column in size.T], axis=1)
    floor = np.maximum(_SMALLEST_RAD, _TURN_RAD_S2 * step_s**2 / 2)
    return frozen, _Steps(time, change, np.maximum(floor[:, None], usual))


def _jumps(steps: _Steps, kind: FaultKind, first: float, last: float) -> Iterator[LogFault]:
    """One fault for every run of neighbouring unusual changes."""
    size = np.stack([np.hypot(*steps.change[:, :2].T), np.abs(steps.change[:, 2])], axis=1)
    rows = np.flatnonzero((size > steps.allowed).any(axis=1))
    for run in np.split(rows, np.flatnonzero(np.diff(rows) > 2) + 1):
        if not len(run):
            continue
        start, end = steps.time_s[run[0]], steps.time_s[run[-1] + 1]
        change = steps.change[run[0] : run[-1] + 1].sum(axis=0)
        total = np.hypot(*change[:2]), abs(change[2])
        stays = (np.array(total) > steps.allowed[run].max(axis=0)).any()
        if stays and end > first and start < last:
            yield _fault(kind, start, end, change)


def _gaps(track: Track, exposure_s: Floats) -> Iterator[LogFault]:
    """Exposures between two samples that lie far apart."""
    for kind, time in (
        ("position-gap", track.position_time_s),
        ("attitude-gap", track.attitude_time_s),
    ):
        if len(time) < 3:
            continue
        step = np.diff(time)
        longest = max(_GAP_S, _UNUSUAL_GAP * float(np.median(step)))
        after = np.clip(np.searchsorted(time, exposure_s), 1, len(time) - 1) - 1
        for row in np.unique(after[step[after] > longest]).tolist():
            width = float(step[row])
            if kind == "position-gap":
                # midway between two places with known speeds (Hermite: a quarter of a parabola)
                unknown = np.full(3, _GUST_M_S2 * width**2 / 16)
                yield _fault("position-gap", time[row], time[row + 1], unknown)
            else:
                turned = np.full(3, min(_TURNING_RAD_S * width, np.pi / 2))
                yield _fault("attitude-gap", time[row], time[row + 1], turned)


def _receiver_apart(
    track: Track, evidence: FlightEvidence, first: float, last: float
) -> Iterator[LogFault]:
    """Stretches over which estimator and receiver lie apart, less lag and common distance."""
    inside = _within(evidence.receiver_time_s, first, last)
    span = track.position_time_s[[0, -1]]
    time = evidence.receiver_time_s[inside]
    known = (time >= span[0]) & (time <= span[1])
    time, other = time[known], evidence.receiver_world_m[inside][known]
    if len(time) < 2 * _FEWEST:
        return
    here = _interpolated(time, track.position_time_s, track.position_world_m)
    apart = (here - other)[:, :2]
    way = np.gradient(here[:, :2], time, axis=0)
    apart = apart - np.median(apart, axis=0)
    lag_s = float(np.vdot(way, apart) / max(np.vdot(way, way), 1e-9))
    apart = apart - np.clip(lag_s, -1.0, 1.0) * way
    apart = apart - np.median(apart, axis=0)
    width = 2 * int(_SMOOTH_S / 2 / max(float(np.median(np.diff(time))), 1e-3)) + 1
    smooth = median_filter(apart, size=(width, 1), mode="nearest")
    scatter = 1.48 * float(np.median(np.linalg.norm(apart - smooth, axis=1)))
    allowed = _APART_SIGMAS * np.maximum(_sigma(track, time)[:, 0], scatter)
    size = np.linalg.norm(smooth, axis=1)
    rows = np.flatnonzero(size > allowed)
    for run in np.split(rows, np.flatnonzero(np.diff(rows) > width) + 1):
        if len(run) and time[run[-1]] >= first and time[run[0]] <= last:
            worst = smooth[run[size[run].argmax()]]
            yield _fault("receiver-apart", time[run[0]], time[run[-1]], np.append(worst, 0.0))


def _explained(fault: LogFault, evidence: FlightEvidence) -> LogFault:
    """The fault with what the autopilot says of that moment."""
    said = [
        what
        for time, what in evidence.resets
        if fault.start_s - _RESET_S <= time <= fault.end_s + _RESET_S
    ]
    return _fault(
        fault.kind,
        fault.start_s,
        fault.end_s,
        np.array(fault.change),
        " and ".join(dict.fromkeys(said)),
    )


def _fault(kind: FaultKind, start: float, end: float, change: Floats, why: str = "") -> LogFault:
    east, north, up = (float(part) for part in change)
    return LogFault(
        kind=kind, start_s=float(start), end_s=float(end), change=(east, north, up), why=why
    )


def _within(time: Floats, first: float, last: float) -> Bools:
    return np.asarray((time >= first - MARGIN_S) & (time <= last + MARGIN_S))


def _no_steps() -> _Steps:
    return _Steps(np.zeros(1), np.zeros((0, 3)), np.zeros((0, 2)))


def _still_runs(time: Floats, value: Floats) -> Sequence[tuple[int, int]]:
    """First and last row of every run of equal rows that is long; none where most rows are."""
    if len(time) < _FEWEST:
        return []
    same = (np.diff(value, axis=0) == 0).all(axis=1)
    if same.mean() > 0.5:
        return []
    edges = np.flatnonzero(np.diff(np.r_[False, same, False].astype(np.int8)))
    runs: Ints = edges.reshape(-1, 2)
    long = (time[runs[:, 1]] - time[runs[:, 0]] >= _FROZEN_S) & (
        runs[:, 1] - runs[:, 0] >= _FROZEN_STEPS
    )
    return [(int(a), int(b)) for a, b in runs[long]]


def _way(evidence: FlightEvidence, time: Floats) -> Floats:
    """(M, 3) way between instants (M + 1,) by the stated velocity; NaN where it is silent."""
    known, velocity = evidence.velocity_time_s, evidence.velocity_world_m_s
    if len(known) < 2:
        return np.full((len(time) - 1, 3), np.nan)
    step = np.diff(known)[:, None]
    travelled = np.vstack(
        [np.zeros(3), np.cumsum((velocity[1:] + velocity[:-1]) / 2 * step, axis=0)]
    )
    # Between its samples the velocity is a line, the way a parabola.
    row = np.clip(np.searchsorted(known, time, side="right") - 1, 0, len(known) - 2)
    since = (time - known[row])[:, None]
    slope = (velocity[row + 1] - velocity[row]) / step[row]
    at = travelled[row] + velocity[row] * since + slope * since**2 / 2
    outside = (time < known[0]) | (time > known[-1])
    at[outside] = np.nan
    return np.diff(at, axis=0)


def _spacing(evidence: FlightEvidence, time: Floats) -> Floats:
    """(M,) how far apart the velocity's samples are between instants (M + 1,); inf without any."""
    known = evidence.velocity_time_s
    if len(known) < 2:
        return np.full(len(time) - 1, np.inf)
    row = np.clip(np.searchsorted(known, time[:-1], side="right") - 1, 0, len(known) - 2)
    return np.diff(known)[row]


def _unlike(time: Floats, change: Floats) -> Floats:
    """(M, 3) changes less what the neighbouring rates make of them, the kindest of these."""
    step_s = np.diff(time)[:, None]
    rate = change / step_s
    before, after = np.vstack([rate[1:2], rate[:-1]]), np.vstack([rate[1:], rate[-2:-1]])
    left = np.stack([change - r * step_s for r in (before, after, (before + after) / 2)])
    kindest = np.linalg.norm(left, axis=2).argmin(axis=0)
    return np.asarray(left[kindest, np.arange(len(change))])


def _usual(size: Floats) -> Floats:
    """(M,) above which a change is unusual among those about it."""
    decile = percentile_filter(size, 90, size=min(_ABOUT, len(size)), mode="nearest")
    return np.asarray(_UNUSUAL * decile)


def _sigma(track: Track, time: Floats | float) -> Floats:
    """Stated sigmas of a place, horizontal and vertical, (..., 2)."""
    columns = [np.interp(time, track.sigma_time_s, c) for c in track.sigma_position_m.T]
    return np.stack(columns, axis=-1)


def _interpolated(at: Floats, time: Floats, value: Floats) -> Floats:
    return np.stack([np.interp(at, time, column) for column in value.T], axis=1)
