"""Positions and rotations between the samples of a log, with their rates."""

from __future__ import annotations

import numpy as np

from uavgram.geometry.rotation import exp_so3, log_so3, matrix_from_xyzw
from uavgram.model.arrays import Floats, Ints


def interpolate_position(time_s: Floats, position: Floats, at_s: Floats) -> tuple[Floats, Floats]:
    """Interpolate positions linearly.

    Parameters
    ----------
    time_s
        (N,) strictly increasing, N >= 2.
    position
        (N, 3) [m].
    at_s
        (M,) instants within the span.

    Returns
    -------
    position : (M, 3)
    velocity : (M, 3)
        [m/s]; on a sample, that of the interval which starts there (at the end: which ends).

    Raises
    ------
    ValueError
        An instant lies outside the span, or the times do not increase.
    """
    index, fraction, width = _locate(time_s, at_s)
    position = np.asarray(position, np.float64)
    start, change = position[index], position[index + 1] - position[index]
    return start + fraction[:, None] * change, change / width[:, None]


def interpolate_rotation(time_s: Floats, xyzw: Floats, at_s: Floats) -> tuple[Floats, Floats]:
    """Interpolate rotations along the shortest arc between neighbours (slerp).

    Parameters
    ----------
    time_s
        (N,) strictly increasing, N >= 2.
    xyzw
        (N, 4) quaternions world_from_body; q and -q are the same rotation.
    at_s
        (M,) instants within the span.

    Returns
    -------
    world_from_body : (M, 3, 3)
    rate_body : (M, 3)
        Angular velocity in body axes [rad/s]: ``R(t + dt) = R(t) exp(rate dt)``; on a sample, that
        of the interval which starts there (at the end: which ends).

    Raises
    ------
    ValueError
        An instant lies outside the span, or the times do not increase.
    """
    index, fraction, width = _locate(time_s, at_s)
    xyzw = np.asarray(xyzw, np.float64)
    start, end = matrix_from_xyzw(xyzw[index]), matrix_from_xyzw(xyzw[index + 1])
    turn = log_so3(np.swapaxes(start, -1, -2) @ end)  # at most pi: the shortest way, any signs
    return start @ exp_so3(fraction[:, None] * turn), turn / width[:, None]


def _locate(time_s: Floats, at_s: Floats) -> tuple[Ints, Floats, Floats]:
    """(M,) each: interval, place in it (0 to 1), and its width [s]."""
    time = np.asarray(time_s, np.float64)
    at = np.asarray(at_s, np.float64)
    if len(time) < 2:
        raise ValueError(f"interpolation needs at least two samples, got {len(time)}")
    if not (np.diff(time) > 0).all():
        raise ValueError("interpolation needs strictly increasing times")
    outside = ~((at >= time[0]) & (at <= time[-1]))
    if outside.any():
        raise ValueError(
            f"{int(outside.sum())} of {len(at)} instants lie outside the samples' span "
            f"{time[0]:.6f} to {time[-1]:.6f} s, the first at {at[outside][0]:.6f} s"
        )
    index = np.minimum(np.searchsorted(time, at, side="right") - 1, len(time) - 2)
    width = time[index + 1] - time[index]
    return index, (at - time[index]) / width, width
