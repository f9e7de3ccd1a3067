"""Detect contradictions in a flight's track before any adjustment, and find the affected frames.

Jumps of position that the stated velocity does not explain, jumps of attitude, repeated values
while the vehicle flies, gaps at an exposure, and a receiver whose path differs from the
estimator's. The track itself defines which changes are unusual: a change counts where it exceeds
the stated sigmas and is far larger than the changes around it. Only faults between the first and
the last exposure separate photos from each other.

A jump does not show which side of it is right. The side with the most photos keeps its sigmas; for
every other side the size of the jump is added to each frame's own variance. The common errors of
all frames (the biases of the flight) have to cover the other case, so their sigmas are enlarged by
as much.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from datetime import UTC, datetime
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
from uavgram.model.frames import Frames
from uavgram.model.message import Message, MessagePlural
from uavgram.model.naming import join_names

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


Faults = Sequence[LogFault]
_UNKNOWN_RAD = np.pi


class FreedPriors(NamedTuple):
    """Variances to add.

    Attributes
    ----------
    position
        (N, 3) of each frame, east, north, up [m²].
    attitude
        (N, 3) of each frame, about east, north, up [rad²].
    position_bias
        (3,) of the flight [m²].
    heading_bias
        Of the flight [rad²].
    """

    position: Floats
    attitude: Floats
    position_bias: Floats
    heading_bias: float

    @property
    def frames(self) -> Bools:
        """Mask (N,) of frames with added variances."""
        return np.asarray((self.position > 0).any(axis=1) | (self.attitude > 0).any(axis=1))


def free_priors(faults: Faults, time_s: Floats, unsure_s: Floats) -> FreedPriors:
    """Compute the variances that faults of a log add to N frames.

    Horizontal directions are treated alike: the size of a jump is known, but not which of the
    places before and after it is right.

    Parameters
    ----------
    faults
        Faults in the order of time.
    time_s
        (N,) instants of the frames.
    unsure_s
        (N,) possible errors of the instants: so near a jump, a frame may be on its other side.
    """
    jumps, turns = (
        [f for f in faults if f.kind == kind] for kind in ("position-jump", "attitude-jump")
    )
    position, position_bias = _compute_jump_variances(jumps, time_s, unsure_s)
    turned, turned_bias = _compute_jump_variances(turns, time_s, unsure_s)
    for fault in faults:
        if fault.is_jump:
            continue
        inside = (time_s >= fault.start_s - unsure_s) & (time_s <= fault.end_s + unsure_s)
        part = turned if fault.is_of_attitude else position
        part[inside] += _square(np.array(fault.change))
    turned = np.minimum(turned, _UNKNOWN_RAD**2)
    return FreedPriors(position, turned, position_bias, float(min(turned_bias[2], _UNKNOWN_RAD**2)))


def find_unsure_s(frames: Frames) -> Floats:
    """Return possible errors (N,) of the instants of the matched frames: three sigmas."""
    own_s = np.nan_to_num(frames.sigma_time_s[frames.matched], nan=0.0)
    return np.asarray(3.0 * np.hypot(own_s, frames.clock_offset_sigma_s))


def _compute_jump_variances(
    jumps: Faults, time_s: Floats, unsure_s: Floats
) -> tuple[Floats, Floats]:
    """Return variances (N, 3) of frames off the most common level, and the largest (3,)."""
    level = np.zeros((len(time_s), 3))
    between = np.zeros((len(time_s), 3))
    side = np.zeros(len(time_s), dtype=np.int64)
    for jump in jumps:
        behind = time_s >= jump.end_s
        level[behind] += jump.change
        side[behind] += 1
        # During the jump the interpolated path may be wrong by the whole jump.
        during = (time_s > jump.start_s - unsure_s) & (time_s < jump.end_s + unsure_s)
        between[during] += _square(np.array(jump.change))
    if not len(time_s) or not jumps:
        return between, np.zeros(3)
    most = int(np.bincount(side).argmax())
    off = _square(level - level[side == most][0])
    return off + between, (off + between).max(axis=0)


def _square(change: Floats) -> Floats:
    """Compute squares (..., 3), with that of the horizontal size for both horizontal axes."""
    horizontal = np.sum(change[..., :2] ** 2, axis=-1)
    return np.stack([horizontal, horizontal, change[..., 2] ** 2], axis=-1)


_RESET = "estimator-reset"
_LOOK = (
    "Pick points that these photos share with the others, and known lengths or points in them, or "
    "leave them out."
)


def report_faults(faults: Faults, evidence: FlightEvidence, frames: Frames) -> Iterator[Message]:
    """Report each fault, with the photos whose log prior it weakens.

    Also report resets by the autopilot amid the photos without any trace in the track.

    Parameters
    ----------
    faults
        Faults in the order of time.
    evidence
        Evidence with the stated resets.
    frames
        Frames; those that are matched have an instant.
    """
    for code in dict.fromkeys(fault.kind for fault in faults):
        alike = [fault for fault in faults if fault.kind == code]
        freed = _list_freed_frames(alike, frames)
        for k, fault in enumerate(alike):
            # Photos affected by jumps follow from all jumps together.
            last = k == len(alike) - 1
            own = freed if fault.is_jump else _list_freed_frames([fault], frames)
            effect = _effect(own) if last or not fault.is_jump else ""
            where = _where(fault.start_s, fault.end_s, frames)
            several = MessagePlural(
                _OPENINGS[code], f"{_size(fault)} {where}", ending=_effect(freed).strip()
            )
            text = f"{_describe_fault(fault)} {where}.{_describe_resets(fault)}{effect}"
            yield Message("warning", f"log-{code}", text, frames=own, several=several)
    yield from _report_untraced_resets(faults, evidence, frames)


_OPENINGS: dict[FaultKind, str] = {
    "position-jump": "The log's position jumps {count} times",
    "attitude-jump": "The log's attitude jumps {count} times",
    "position-frozen": "The log's position is frozen {count} times while the vehicle flies on",
    "attitude-frozen": "The log repeats one and the same attitude {count} times",
    "position-gap": "The log states no position {count} times while photos were taken",
    "attitude-gap": "The log states no attitude {count} times while photos were taken",
    "gimbal-gap": "The log states no gimbal direction {count} times while photos were taken",
    "receiver-apart": ("The log's position differs from the GPS receiver's own, {count} times"),
}
"""Opening of the message on several faults of a kind."""


def _describe_fault(fault: LogFault) -> str:
    """Describe the fault, as the beginning of a sentence."""
    size = _size(fault)
    return {
        "position-jump": f"The log's position jumps {size}",
        "attitude-jump": f"The log's attitude jumps {size}",
        "position-frozen": (
            f"The log's position is frozen {size} while the vehicle flies on by "
            f"{fault.horizontal:.1f} m"
        ),
        "attitude-frozen": f"The log repeats one and the same attitude {size}",
        "position-gap": f"The log states no position {size} while photos were taken",
        "attitude-gap": f"The log states no attitude {size} while photos were taken",
        "gimbal-gap": f"The log states no gimbal direction {size} while photos were taken",
        "receiver-apart": (f"The log's position differs {size} from the GPS receiver's own"),
    }[fault.kind]


def _size(fault: LogFault) -> str:
    """Return ``by 3.0 m``, ``for 2.6 s``."""
    along, up = fault.horizontal, abs(fault.change[2])
    tilt, yaw = np.degrees([along, up])
    if fault.kind == "position-jump":
        return "by " + _larger_part((along, "{:.1f} m"), (up, "{:.1f} m in height"))
    if fault.kind == "attitude-jump":
        return "by " + _larger_part(
            (tilt, "{:.0f} degrees of tilt"), (yaw, "{:.0f} degrees of heading")
        )
    if fault.kind == "receiver-apart":
        return f"by up to {along:.1f} m"
    return f"for {fault.end_s - fault.start_s:.1f} s"


def _larger_part(one: tuple[float, str], other: tuple[float, str]) -> str:
    """Join two parts of a jump, each with its format; omit a part below a fifth of the other."""
    largest = max(one[0], other[0])
    return " and ".join(form.format(size) for size, form in (one, other) if size >= 0.2 * largest)


def _where(start_s: float, end_s: float, frames: Frames) -> str:
    """Return ``between photo a.jpg and b.jpg (10:03:12 UTC)``."""
    order = [k for k in np.argsort(frames.time_utc_s) if frames.matched[k]]
    before = [frames.frame_id[k] for k in order if frames.time_utc_s[k] <= start_s]
    after = [frames.frame_id[k] for k in order if frames.time_utc_s[k] >= end_s]
    if before and after:
        place = f"between photo {before[-1]} and {after[0]}"
    elif after or before:
        place = f"before photo {after[0]}" if after else f"after photo {before[-1]}"
    else:
        place = "around all photos"
    return f"{place} ({_clock(start_s)} UTC)"


def _clock(time_s: float) -> str:
    return f"{datetime.fromtimestamp(time_s, UTC):%H:%M:%S}"


def _describe_resets(fault: LogFault) -> str:
    noted = " and ".join(fault.resets)
    return f" The autopilot itself noted then: {noted}." if noted else ""


def _list_freed_frames(faults: list[LogFault], frames: Frames) -> tuple[str, ...]:
    matched = np.flatnonzero(frames.matched)
    freed = free_priors(faults, frames.time_utc_s[matched], find_unsure_s(frames)).frames
    return tuple(frames.frame_id[k] for k in matched[freed])


def _effect(names: tuple[str, ...]) -> str:
    """Describe the effect on photos, and the action."""
    if not names:
        return " No photo depends on that, so nothing was changed."
    return (
        f" So the log's sigmas are larger in {len(names)} of the photos ({join_names(names)}), "
        f"and their picks place them. {_LOOK}"
    )


def _report_untraced_resets(
    faults: Faults, evidence: FlightEvidence, frames: Frames
) -> Iterator[Message]:
    times = frames.time_utc_s[frames.matched]
    traced = {what for fault in faults for what in fault.resets}
    untraced: dict[str, float] = {}
    for time, what in evidence.resets:
        if len(times) and times.min() < time < times.max() and what not in traced:
            untraced.setdefault(what, time)
    for what, time in untraced.items():
        text = (
            f"The autopilot noted a {what} {_where(time, time, frames)}; positions and attitudes "
            "in the log show no jump there, so nothing was changed."
        )
        yield Message("info", _RESET, text)
