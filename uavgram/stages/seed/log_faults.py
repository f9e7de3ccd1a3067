"""Detect contradictions in a flight's track before any adjustment.

Jumps of position that the stated velocity does not explain, jumps of attitude, repeated values
while the vehicle flies, gaps at an exposure, and a receiver whose path differs from the
estimator's. The track itself defines which changes are unusual: a change counts where it exceeds
the stated sigmas and is far larger than the changes around it. Only faults between the first and
the last exposure separate photos from each other.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from uavgram.geometry.motion.interpolation import (
    compute_running_median,
    compute_running_rank,
    make_running_windows,
)
from uavgram.geometry.motion.rotation import log_so3, matrix_from_xyzw
from uavgram.model.arrays import Bools, Floats, Ints
from uavgram.model.flight_log import FaultKind, FlightEvidence, LogFault, Track

MIN_ROWS = 8
FROZEN_STEPS = 4
"""Number of repetitions that are no standstill yet: some firmware logs faster than it estimates."""
_FROZEN_S = 1.0
_NEARLY = 0.2  # of a stated movement
# Undamaged logs (ArduPilot, PX4, real and simulated): a change departs from what explains it by at
# most 3.6 times the ninth decile of those about it.
_UNUSUAL, _ABOUT = 5.0, 61


def is_frozen(change: Floats, stated: Floats, least: Floats) -> Bools:
    """Mark steps (M,) without any change, or with hardly any of a movement that the log states.

    Parameters
    ----------
    change
        (M, 3) from sample to sample.
    stated
        (M, 3) stated change; NaN where the log has none.
    least
        (M,) stated change above which it counts as a movement.
    """
    moves = np.linalg.norm(np.nan_to_num(stated), axis=1)
    nearly = np.linalg.norm(change, axis=1) < _NEARLY * moves
    return np.asarray((change == 0).all(axis=1) | _close_gaps(nearly & (moves > least)))


def _close_gaps(still: Bools) -> Bools:
    """Close gaps of one or two noisy steps in a standstill: dilate, then erode by three steps."""
    wide = still.copy()
    wide[1:] |= still[:-1]
    wide[:-1] |= still[1:]
    closed = np.zeros_like(still)
    closed[1:-1] = wide[:-2] & wide[1:-1] & wide[2:]
    return closed


def find_frozen_runs(time: Floats, same: Bools) -> Sequence[tuple[int, int]]:
    """Return first and last row of each long standstill of steps (M,); none if most stand still."""
    if len(time) < MIN_ROWS:
        return []
    if same.mean() > 0.5:
        return []
    edges = np.flatnonzero(np.diff(np.r_[False, same, False].astype(np.int8)))
    runs: Ints = edges.reshape(-1, 2)
    long = (time[runs[:, 1]] - time[runs[:, 0]] >= _FROZEN_S) & (
        runs[:, 1] - runs[:, 0] >= FROZEN_STEPS
    )
    return [(int(a), int(b)) for a, b in runs[long]]


def compute_stated_way(known: Floats, velocity: Floats, time: Floats) -> Floats:
    """Integrate the stated velocity between instants (M, 3); NaN outside its samples.

    Parameters
    ----------
    known, velocity
        (V,) times [s] and (V, 3) velocities, or angular rates.
    time
        (M + 1,) instants [s].
    """
    if len(known) < 2:
        return np.full((len(time) - 1, 3), np.nan)
    step = np.diff(known)[:, None]
    travelled = np.vstack(
        [np.zeros(3), np.cumsum((velocity[1:] + velocity[:-1]) / 2 * step, axis=0)]
    )
    # Between samples the velocity is linear, the path a parabola.
    row = np.clip(np.searchsorted(known, time, side="right") - 1, 0, len(known) - 2)
    since = (time - known[row])[:, None]
    slope = (velocity[row + 1] - velocity[row]) / step[row]
    at = travelled[row] + velocity[row] * since + slope * since**2 / 2
    outside = (time < known[0]) | (time > known[-1])
    at[outside] = np.nan
    return np.diff(at, axis=0)


def spacing(known: Floats, time: Floats) -> Floats:
    """Return the spacing (M,) of the samples (V,) between instants (M + 1,); inf without any."""
    if len(known) < 2:
        return np.full(len(time) - 1, np.inf)
    row = np.clip(np.searchsorted(known, time[:-1], side="right") - 1, 0, len(known) - 2)
    return np.diff(known)[row]


def differs_from_neighbours(time: Floats, change: Floats) -> Floats:
    """Subtract the closest prediction by neighbouring rates from changes (M, 3)."""
    step_s = np.diff(time)[:, None]
    rate = change / step_s
    before, after = np.vstack([rate[1:2], rate[:-1]]), np.vstack([rate[1:], rate[-2:-1]])
    left = np.stack([change - r * step_s for r in (before, after, (before + after) / 2)])
    kindest = np.linalg.norm(left, axis=2).argmin(axis=0)
    return np.asarray(left[kindest, np.arange(len(change))])


def compute_stated_turn(
    evidence: FlightEvidence, time: Floats, rotation: Floats
) -> tuple[Floats, Floats]:
    """Integrate the stated rates between instants, NaN without them; and bound the error.

    Parameters
    ----------
    evidence
        Evidence with the rates of the gyroscopes.
    time
        (M + 1,).
    rotation
        (M + 1, 3, 3) world from body.

    Returns
    -------
    (M, 3) rotations about the world's axes, and (M,) the angle by which the rates differ between
    the sample before the interval and the one after it: between samples a rotation may be faster
    than both.
    """
    known, rate = evidence.turn_time_s, evidence.turn_body_rad_s
    step_s = np.diff(time)
    body = compute_stated_way(known, rate, time)
    body[spacing(known, time) > 2.0 * step_s] = np.nan
    if not len(known):
        return body, np.zeros(len(step_s))
    four = sliding_window_view(
        np.pad(interpolate(time, known, rate), ((1, 1), (0, 0)), "edge"), 4, axis=0
    )
    world = np.einsum("mij,mj->mi", rotation[:-1], body)
    return world, np.asarray(np.linalg.norm(np.ptp(four, axis=2), axis=1) * step_s)


def compute_usual_size(size: Floats) -> Floats:
    """Return the limits (M, K) above which sizes (M, K) are unusual among those around them."""
    about = min(_ABOUT, len(size))
    return np.asarray(_UNUSUAL * compute_running_rank(size, about, about * 9 // 10))


def interpolate(at: Floats | float, time: Floats, value: Floats) -> Floats:
    """Interpolate values (..., K) linearly at other times.

    Parameters
    ----------
    at
        (...) times.
    time, value
        (N,) and (N, K) samples.
    """
    return np.stack([np.interp(at, time, column) for column in value.T], axis=-1)


MARGIN_S = 15.0
"""Time before the first exposure and after the last one that is examined."""
_SMALLEST_M, _SMALLEST_RAD = 0.1, np.radians(3.0)
_ACCELERATION_M_S2 = 6.0
# A multicopter tilts by up to 30 degrees within a quarter of a second.
_TURN_RAD_S2 = np.radians(500.0)
_GAP_S, _UNUSUAL_GAP = 1.0, 3.0  # as the longest steady turn
_GUST_M_S2 = 2.0  # of the way between two samples, on which nothing is known
_TURNING_RAD_S, _SLOW_M_S = np.radians(5.0), 1.0
_UNEVEN = 1.0  # times the change of the stated rates; 0.4 is the most that clean flights need
_CALM = 3.0  # times the largest turn beside it, which a jump of attitude exceeds
_RESET_S = 1.0
_APART_SIGMAS, _SMOOTH_S = 6.0, 5.0


class _Steps(NamedTuple):
    """Set of M unexplained changes from sample to sample, and their usual limits.

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
    """Find faults of a track between the first and the last exposure, in the order of time.

    Parameters
    ----------
    track
        Track of the seed poses.
    evidence
        Independent data for comparison.
    exposure_s
        (N,) UTC instants of the photos.
    """
    if not len(exposure_s):
        return ()
    first, last = float(exposure_s.min()), float(exposure_s.max())
    frozen, place = _places(track, evidence, first, last)
    still, turns = _attitudes(track, evidence, first, last)
    jumps = [*_jumps(place, "position-jump", first, last)]
    found = [*frozen, *jumps, *still, *_jumps(turns, "attitude-jump", first, last)]
    found += _gaps(track, exposure_s)
    if not jumps and not frozen:
        found += _receiver_apart(track, evidence, first, last)
    reasons = [_add_resets(fault, evidence) for fault in found]
    return tuple(sorted(reasons, key=lambda fault: fault.start_s))


def _places(
    track: Track, evidence: FlightEvidence, first: float, last: float
) -> tuple[list[LogFault], _Steps]:
    """Find standstills, and changes of position less the path by the velocity."""
    rows = _within(track.position_time_s, first, last)
    time, place = track.position_time_s[rows], track.position_world_m[rows]
    known = evidence.velocity_time_s, evidence.velocity_world_m_s
    frozen = []
    keep = np.ones(len(time), dtype=np.bool_)
    step_s = np.diff(time)
    still = is_frozen(np.diff(place, axis=0), compute_stated_way(*known, time), _SLOW_M_S * step_s)
    for start, end in find_frozen_runs(time, still):
        flown = compute_stated_way(*known, time[[start, end]])[0]
        if np.isnan(flown).any():  # extrapolate the previous speed
            before = max(start - FROZEN_STEPS, 0)
            share = (time[end] - time[start]) / max(time[start] - time[before], 1e-9)
            flown = (place[start] - place[before]) * share
        if np.hypot(*flown[:2]) > max(1.0, _sigma(track, time[start])[0]):
            keep[start + 1 : end + 1] = False
            if time[end] >= first and time[start] <= last:
                frozen.append(_make_fault("position-frozen", time[start], time[end], flown))
    return frozen, _place_steps(track, evidence, time[keep], place[keep])


def _place_steps(track: Track, evidence: FlightEvidence, time: Floats, place: Floats) -> _Steps:
    """Compute changes between positions (N, 3) less the stated velocity, or neighbouring rates."""
    if len(time) < MIN_ROWS:
        return _no_steps()
    change, step_s = np.diff(place, axis=0), np.diff(time)
    known = evidence.velocity_time_s
    flown = compute_stated_way(known, evidence.velocity_world_m_s, time)
    stated = np.asarray(np.isfinite(flown).all(axis=1))
    by_rates = differs_from_neighbours(time, change)
    change = np.where(stated[:, None], change - np.nan_to_num(flown), by_rates)
    known_s = np.where(stated, np.minimum(step_s, spacing(known, time)), step_s)
    floor = np.maximum(_SMALLEST_M, 0.5 * _ACCELERATION_M_S2 * known_s**2)
    allowed = np.maximum(floor[:, None], _sigma(track, time[1:]))
    return _Steps(time, change, np.maximum(allowed, compute_usual_size(_sizes(change))))


def _attitudes(
    track: Track, evidence: FlightEvidence, first: float, last: float
) -> tuple[list[LogFault], _Steps]:
    """Find constant attitudes, and rotations that stated and neighbouring rates do not explain."""
    rows = _within(track.attitude_time_s, first, last)
    time, xyzw = track.attitude_time_s[rows], track.world_from_body_xyzw[rows]
    if len(time) < MIN_ROWS:
        return [], _no_steps()
    rotation = matrix_from_xyzw(xyzw)
    # about the world's axes: R' = exp(turn) R
    turn = log_so3(rotation[1:] @ np.swapaxes(rotation[:-1], 1, 2))
    frozen = []
    keep = np.ones(len(time), dtype=np.bool_)
    turn[(np.diff(xyzw, axis=0) == 0).all(axis=1)] = 0.0  # exact, without rounding errors
    stated = compute_stated_turn(evidence, time, rotation)
    still = is_frozen(turn, stated[0], _TURNING_RAD_S * np.diff(time))
    for start, end in find_frozen_runs(time, still):
        keep[start + 1 : end + 1] = False
        if time[end] >= first and time[start] <= last:
            caught_up = np.abs(turn[min(end, len(turn) - 1)])
            may_turn = caught_up + _TURNING_RAD_S * (time[end] - time[start])
            frozen.append(_make_fault("attitude-frozen", time[start], time[end], may_turn))
    # The rotation at the end of a standstill is not a jump.
    moving = keep[1:] & keep[:-1]
    return frozen, _turn_steps(time, stated, np.where(moving[:, None], turn, np.nan))


def _turn_steps(time: Floats, stated: tuple[Floats, Floats], turn: Floats) -> _Steps:
    """Subtract the better explanation from rotations (M, 3): stated or neighbouring rates.

    Parameters
    ----------
    time
        (M + 1,).
    stated
        Result of `stated_turn`.
    turn
        Rotations about the world's axes; NaN for none.
    """
    by_gyroscopes, uneven = stated
    known = np.isfinite(by_gyroscopes).all(axis=1)
    change = differs_from_neighbours(time, np.nan_to_num(turn))
    by_rates = np.nan_to_num(turn - by_gyroscopes)
    better = known & (np.linalg.norm(by_rates, axis=1) < np.linalg.norm(change, axis=1))
    change = np.where(better[:, None], by_rates, change)
    change[np.isnan(turn).any(axis=1)] = 0.0
    # Between two known rates a rotation has half its otherwise possible deviation.
    agility = np.where(known, _TURN_RAD_S2 / 4, _TURN_RAD_S2 / 2)
    floor = np.maximum(_SMALLEST_RAD, agility * np.diff(time) ** 2)
    # A jump is isolated: next to other fast rotations it is a rotation.
    turning = np.delete(make_running_windows(_sizes(np.nan_to_num(turn)), 5), 2, axis=-1).max(
        axis=-1
    )
    slack = np.where(known, _UNEVEN * uneven, _CALM * turning.max(axis=1))
    allowed = np.maximum(floor[:, None], compute_usual_size(_sizes(change))) + slack[:, None]
    return _Steps(time, change, allowed)


def _jumps(steps: _Steps, kind: FaultKind, first: float, last: float) -> Iterator[LogFault]:
    """Yield one fault for every run of neighbouring unusual changes."""
    rows = np.flatnonzero((_sizes(steps.change) > steps.allowed).any(axis=1))
    for run in np.split(rows, np.flatnonzero(np.diff(rows) > 2) + 1):
        if not len(run):
            continue
        start, end = steps.time_s[run[0]], steps.time_s[run[-1] + 1]
        change = steps.change[run[0] : run[-1] + 1].sum(axis=0)
        stays = (_sizes(change[None])[0] > steps.allowed[run].max(axis=0)).any()
        if stays and end > first and start < last:
            yield _make_fault(kind, start, end, change)


def _gaps(track: Track, exposure_s: Floats) -> Iterator[LogFault]:
    """Yield exposures between distant samples; each direction of a camera once."""
    kinds: tuple[tuple[FaultKind, Floats], ...] = (
        ("position-gap", track.position_time_s),
        ("attitude-gap", track.attitude_time_s),
        ("gimbal-gap", track.gimbal_time_s),
    )
    for kind, time in kinds:
        if len(time) < 3:
            continue
        step = np.diff(time)
        longest = max(_GAP_S, _UNUSUAL_GAP * float(np.median(step)))
        after = np.clip(np.searchsorted(time, exposure_s), 1, len(time) - 1) - 1
        far = step[after] > longest
        for row in np.unique(after[far]).tolist():
            width = float(step[row])
            if kind == "position-gap":
                # midway between two places with known speeds (Hermite: a quarter of a parabola)
                unknown = np.full(3, _GUST_M_S2 * width**2 / 16)
                yield _make_fault("position-gap", time[row], time[row + 1], unknown)
            else:
                turned = np.full(3, min(_TURNING_RAD_S * width, np.pi / 2))
                yield _make_fault(kind, time[row], time[row + 1], turned)
        if kind == "attitude-gap":
            exposure_s = exposure_s[~far]


def _receiver_apart(
    track: Track, evidence: FlightEvidence, first: float, last: float
) -> Iterator[LogFault]:
    """Yield periods in which estimator and receiver differ, less lag and common distance."""
    inside = _within(evidence.receiver_time_s, first, last)
    span = track.position_time_s[[0, -1]]
    time = evidence.receiver_time_s[inside]
    known = (time >= span[0]) & (time <= span[1])
    time, other = time[known], evidence.receiver_world_m[inside][known]
    if len(time) < 2 * MIN_ROWS:
        return
    here = interpolate(time, track.position_time_s, track.position_world_m)
    apart = (here - other)[:, :2]
    way = np.gradient(here[:, :2], time, axis=0)
    apart = apart - np.median(apart, axis=0)
    # Remove the time lag (regression on the velocity) and the common offset.
    lag_s = float(np.vdot(way, apart) / max(np.vdot(way, way), 1e-9))
    apart = apart - np.clip(lag_s, -1.0, 1.0) * way
    apart = apart - np.median(apart, axis=0)
    width = 2 * int(_SMOOTH_S / 2 / max(float(np.median(np.diff(time))), 1e-3)) + 1
    smooth = compute_running_median(apart, width)
    scatter = 1.48 * float(np.median(np.linalg.norm(apart - smooth, axis=1)))
    allowed = _APART_SIGMAS * np.maximum(_sigma(track, time)[:, 0], scatter)
    size = np.linalg.norm(smooth, axis=1)
    rows = np.flatnonzero(size > allowed)
    for run in np.split(rows, np.flatnonzero(np.diff(rows) > width) + 1):
        if len(run) and time[run[-1]] >= first and time[run[0]] <= last:
            worst = smooth[run[size[run].argmax()]]
            yield _make_fault("receiver-apart", time[run[0]], time[run[-1]], np.append(worst, 0.0))


def _add_resets(fault: LogFault, evidence: FlightEvidence) -> LogFault:
    """Add the resets that the autopilot states at that moment."""
    noted = [
        what
        for time, what in evidence.resets
        if fault.start_s - _RESET_S <= time <= fault.end_s + _RESET_S
    ]
    return replace(fault, resets=tuple(dict.fromkeys(noted)))


def _make_fault(kind: FaultKind, start: float, end: float, change: Floats) -> LogFault:
    east, north, up = (float(part) for part in change)
    return LogFault(kind=kind, start_s=float(start), end_s=float(end), change=(east, north, up))


def _within(time: Floats, first: float, last: float) -> Bools:
    return np.asarray((time >= first - MARGIN_S) & (time <= last + MARGIN_S))


def _sizes(change: Floats) -> Floats:
    """Return horizontal and vertical sizes (M, 2) of changes (M, 3)."""
    return np.stack([np.hypot(*change[:, :2].T), np.abs(change[:, 2])], axis=1)


def _no_steps() -> _Steps:
    return _Steps(np.zeros(1), np.zeros((0, 3)), np.zeros((0, 2)))


def _sigma(track: Track, time: Floats | float) -> Floats:
    """Interpolate stated sigmas of positions, horizontal and vertical, (..., 2)."""
    return interpolate(time, track.sigma_time_s, track.sigma_position_m)
