"""Positions and rotations between the samples of a log, with their rates."""

from __future__ import annotations

import numpy as np

from uavgram.geometry.rotation import (
    exp_so3,
    log_so3,
    matrix_from_xyzw,
    right_jacobian,
    right_jacobian_inverse,
)
from uavgram.model.arrays import Floats, Ints


def smooth_position(time_s: Floats, position: Floats, at_s: Floats) -> tuple[Floats, Floats]:
    """Interpolate positions by cubic Hermite pieces: through the samples, with steady velocity.

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
        [m/s], the exact derivative.

    Raises
    ------
    ValueError
        An instant lies outside the span, or the times do not increase.

    Notes
    -----
    Velocities at the samples are those of the parabola through each and its neighbours
    (Catmull and Rom 1974, for uneven spacing). Piecewise linear interpolation has kinks at the
    samples, on which an adjustment of the clock cannot come to rest.
    """
    around, width, fraction = _around(time_s, at_s)
    sample = np.asarray(position, np.float64)[around]
    start, end = _end_rates(np.diff(sample, axis=1), width)
    middle = width[:, 1:2]
    moved, rate = _hermite(fraction, sample[:, 2] - sample[:, 1], start * middle, end * middle)
    return sample[:, 1] + moved, rate / middle


def smooth_rotation(time_s: Floats, xyzw: Floats, at_s: Floats) -> tuple[Floats, Floats]:
    """Interpolate rotations by cubic Hermite pieces of the rotation vector from sample to sample.

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
        Angular velocity in body axes [rad/s], the exact derivative: R(t + dt) = R(t) exp(rate dt).

    Raises
    ------
    ValueError
        An instant lies outside the span, or the times do not increase.

    Notes
    -----
    Within a piece R = R0 exp(phi), the rate is Jr(phi) dphi/dt (Sola et al. 2018, eq. 67); the
    rates at the samples are those of `smooth_position`'s rule, so they are steady from piece to
    piece.
    """
    around, width, fraction = _around(time_s, at_s)
    rotation = matrix_from_xyzw(np.asarray(xyzw, np.float64)[around])
    turn = log_so3(np.swapaxes(rotation[:, :-1], -1, -2) @ rotation[:, 1:])
    start, end = _end_rates(turn, width)
    # dphi/dt at the far end, where phi is the whole turn.
    end = np.einsum("nij,nj->ni", right_jacobian_inverse(turn[:, 1]), end)
    middle = width[:, 1:2]
    phi, slope = _hermite(fraction, turn[:, 1], start * middle, end * middle)
    rate_body = np.einsum("nij,nj->ni", right_jacobian(phi), slope) / middle
    return rotation[:, 1] @ exp_so3(phi), rate_body


def _around(time_s: Floats, at_s: Floats) -> tuple[Ints, Floats, Floats]:
    """Samples before, at both ends of, and after the piece of each instant.

    Returns
    -------
    around : (M, 4)
        Their indices; at the ends of the span the outer ones are repeated.
    width : (M, 3)
        Of the three pieces between them [s]; 0 where there is none.
    fraction : (M,)
        Place in the middle piece, 0 to 1.
    """
    index, fraction, _ = _locate(time_s, at_s)
    time = np.asarray(time_s, np.float64)
    around = np.clip(index[:, None] + np.arange(-1, 3), 0, len(time) - 1)
    return around, np.diff(time[around], axis=1), fraction


def _end_rates(change: Floats, width: Floats) -> tuple[Floats, Floats]:
    """Rates (M, 3) at both ends of the middle piece from the changes (M, 3, 3) over all three.

    The slope of the parabola through three samples; the piece's own where a neighbour is missing.
    """
    before, middle, after = (width[:, i : i + 1] for i in range(3))
    slope = change / np.where(width > 0, width, 1.0)[:, :, None]
    start = (slope[:, 0] * middle + slope[:, 1] * before) / (before + middle)
    end = (slope[:, 1] * after + slope[:, 2] * middle) / (middle + after)
    return np.where(before > 0, start, slope[:, 1]), np.where(after > 0, end, slope[:, 1])


def _hermite(s: Floats, change: Floats, start: Floats, end: Floats) -> tuple[Floats, Floats]:
    """Cubic from 0 to `change`, with these slopes at its ends, and its derivative; s in [0, 1]."""
    s = s[:, None]
    value = s * (1 - s) ** 2 * start + s**2 * (3 - 2 * s) * change + s**2 * (s - 1) * end
    slope = (1 - s) * (1 - 3 * s) * start + 6 * s * (1 - s) * change + s * (3 * s - 2) * end
    return value, slope


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
