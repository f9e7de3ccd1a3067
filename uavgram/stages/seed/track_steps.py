"""Changes from sample to sample of a track, and what is usual among them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from uavgram.geometry.motion.running import running_rank
from uavgram.model.arrays import Bools, Floats, Ints
from uavgram.model.flight.second_opinions import FlightEvidence

FEWEST_ROWS = 8
FROZEN_STEPS = 4
"""Repetitions that are no standstill yet: some firmware logs faster than it estimates."""
_FROZEN_S = 1.0
_NEARLY = 0.2  # of a stated movement
# Undamaged logs (ArduPilot, PX4, real and simulated): a change departs from what explains it by at
# most 3.6 times the ninth decile of those about it.
_UNUSUAL, _ABOUT = 5.0, 61


def stands_still(change: Floats, stated: Floats, least: Floats) -> Bools:
    """(M,) where nothing changes, or hardly anything of a movement that the log states.

    Parameters
    ----------
    change
        (M, 3) from sample to sample.
    stated
        (M, 3) how much it should be; NaN where the log is silent.
    least
        (M,) of what is stated that counts as a movement.
    """
    moves = np.linalg.norm(np.nan_to_num(stated), axis=1)
    nearly = np.linalg.norm(change, axis=1) < _NEARLY * moves
    return np.asarray((change == 0).all(axis=1) | _closed(nearly & (moves > least)))


def _closed(still: Bools) -> Bools:
    """One or two noisy steps in a standstill do not end it: dilated, then eroded by three steps."""
    wide = still.copy()
    wide[1:] |= still[:-1]
    wide[:-1] |= still[1:]
    closed = np.zeros_like(still)
    closed[1:-1] = wide[:-2] & wide[1:-1] & wide[2:]
    return closed


def still_runs(time: Floats, same: Bools) -> Sequence[tuple[int, int]]:
    """First and last row of every long run of steps (M,) that stand still; none where most do."""
    if len(time) < FEWEST_ROWS:
        return []
    if same.mean() > 0.5:
        return []
    edges = np.flatnonzero(np.diff(np.r_[False, same, False].astype(np.int8)))
    runs: Ints = edges.reshape(-1, 2)
    long = (time[runs[:, 1]] - time[runs[:, 0]] >= _FROZEN_S) & (
        runs[:, 1] - runs[:, 0] >= FROZEN_STEPS
    )
    return [(int(a), int(b)) for a, b in runs[long]]


def stated_way(known: Floats, velocity: Floats, time: Floats) -> Floats:
    """(M, 3) way between instants by what is stated of the velocity; NaN outside of that.

    Parameters
    ----------
    known, velocity
        (V,) times [s] and (V, 3) velocities, or rates of turn.
    time
        (M + 1,) instants [s].
    """
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


def spacing(known: Floats, time: Floats) -> Floats:
    """(M,) how far apart the samples (V,) are between instants (M + 1,); inf without any."""
    if len(known) < 2:
        return np.full(len(time) - 1, np.inf)
    row = np.clip(np.searchsorted(known, time[:-1], side="right") - 1, 0, len(known) - 2)
    return np.diff(known)[row]


def unlike_neighbours(time: Floats, change: Floats) -> Floats:
    """(M, 3) changes less what the neighbouring rates make of them, the kindest of these."""
    step_s = np.diff(time)[:, None]
    rate = change / step_s
    before, after = np.vstack([rate[1:2], rate[:-1]]), np.vstack([rate[1:], rate[-2:-1]])
    left = np.stack([change - r * step_s for r in (before, after, (before + after) / 2)])
    kindest = np.linalg.norm(left, axis=2).argmin(axis=0)
    return np.asarray(left[kindest, np.arange(len(change))])


def stated_turn(evidence: FlightEvidence, time: Floats, rotation: Floats) -> tuple[Floats, Floats]:
    """Turns between instants by the stated rates, NaN where these are silent; how far to trust it.

    Parameters
    ----------
    evidence
        Whose rates are those of the gyroscopes.
    time
        (M + 1,).
    rotation
        (M + 1, 3, 3) world from body.

    Returns
    -------
    (M, 3) about the world's axes, and (M,) the angle by which the rates differ from the sample
    before the interval to the one behind it: between samples a turn may be faster than both.
    """
    known, rate = evidence.turn_time_s, evidence.turn_body_rad_s
    step_s = np.diff(time)
    body = stated_way(known, rate, time)
    body[spacing(known, time) > 2.0 * step_s] = np.nan
    if not len(known):
        return body, np.zeros(len(step_s))
    four = sliding_window_view(
        np.pad(interpolated(time, known, rate), ((1, 1), (0, 0)), "edge"), 4, axis=0
    )
    world = np.einsum("mij,mj->mi", rotation[:-1], body)
    return world, np.asarray(np.linalg.norm(np.ptp(four, axis=2), axis=1) * step_s)


def usual_size(size: Floats) -> Floats:
    """(M, K) above which sizes (M, K) are unusual among those about them."""
    about = min(_ABOUT, len(size))
    return np.asarray(_UNUSUAL * running_rank(size, about, about * 9 // 10))


def interpolated(at: Floats | float, time: Floats, value: Floats) -> Floats:
    """(..., K) values at other times, on straight lines between those that are known.

    Parameters
    ----------
    at
        (...) times.
    time, value
        (N,) and (N, K) what is known.
    """
    return np.stack([np.interp(at, time, column) for column in value.T], axis=-1)
