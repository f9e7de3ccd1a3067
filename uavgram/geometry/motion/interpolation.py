"""Interpolation of positions and rotations between log samples, with rates; running ranks."""

from __future__ import annotations

from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from uavgram.geometry.motion.rotation import (
    exp_so3,
    exp_with_right_jacobian,
    log_so3,
    matrix_from_xyzw,
    right_jacobian_inverse,
)
from uavgram.model.arrays import Floats, Ints

_BLOCK = 4096  # windows copied at a time: they fit into the processor's cache


def make_running_windows(values: NDArray[Any], size: int) -> NDArray[Any]:
    """Return the window about each value, the ends repeated; (N, ...) to (N, ..., size), N >= 1.

    A window of even size has one more value before the centre than after it.
    """
    beside = [(size // 2, size - 1 - size // 2)] + [(0, 0)] * (values.ndim - 1)
    return sliding_window_view(np.pad(values, beside, "edge"), size, axis=0)


def compute_running_rank(values: NDArray[np.floating[Any]], size: int, rank: int) -> Floats:
    """Compute the value of the given rank in the window about each value.

    Parameters
    ----------
    values
        (N, ...), N >= 1.
    size
        Size of the windows, see `make_running_windows`.
    rank
        Rank from 0, less than `size`; half the size is the median of an odd size.

    Returns
    -------
    (N, ...)
    """
    about = make_running_windows(values, size)
    starts = range(0, len(about), _BLOCK)
    blocks = (np.partition(about[k : k + _BLOCK], rank, axis=-1)[..., rank] for k in starts)
    return np.concatenate(list(blocks))


def compute_running_median(values: NDArray[np.floating[Any]], size: int) -> Floats:
    """Compute the median of the window about each value; the upper median of an even size."""
    return compute_running_rank(values, size, size // 2)


MANY_INSTANTS = 100
"""Number of instants from which repeated pieces are computed only once.

With so many instants, usually those of many states at once, many are in the same pieces.
"""


class _Pieces(NamedTuple):
    """M pieces of a smooth path: origin, and the cubic from there in s from 0 to 1.

    Attributes
    ----------
    origin
        (M, 3) positions or (M, 3, 3) rotations at which they start.
    linear, square, cube
        (M, 3) coefficients of s, s^2 and s^3.
    width
        (M, 1) [s].
    """

    origin: Floats
    linear: Floats
    square: Floats
    cube: Floats
    width: Floats

    @classmethod
    def hermite(
        cls, origin: Floats, change: Floats, rates: tuple[Floats, Floats], width: Floats
    ) -> _Pieces:
        """Create pieces (M,) from their change (M, 3) and the rates (M, 3) at both ends."""
        start, end = rates[0] * width, rates[1] * width
        square, cube = 3.0 * change - 2.0 * start - end, start + end - 2.0 * change
        return cls(origin, start, square, cube, width)

    def at(self, fraction: Floats) -> tuple[Floats, Floats]:
        """Compute the change (M, 3) since the origin at fractions (M,), and its rate [1/s]."""
        s = fraction[:, None]
        moved = s * (self.linear + s * (self.square + s * self.cube))
        slope = self.linear + s * (2.0 * self.square + 3.0 * s * self.cube)
        return moved, slope / self.width


class _SmoothPath:
    """Samples, and the pieces between them, which each kind of path computes in its own way."""

    def __init__(self, time_s: Floats, sample: Floats) -> None:
        self._time = _check_times(time_s)
        self._sample = np.asarray(sample, np.float64)
        # An adjustment evaluates nearly the same instants repeatedly.
        self._pieces = lru_cache(maxsize=2)(self._of)

    def _of(self, index: bytes) -> _Pieces:
        """Return the pieces (M,) of the indices given as bytes; indices may repeat."""
        piece = np.frombuffer(index, np.int64)
        if len(piece) < MANY_INSTANTS:
            return self._make(piece)
        piece, place = np.unique(piece, return_inverse=True)
        return _Pieces(*(one[place] for one in self._make(piece)))

    def _make(self, index: Ints) -> _Pieces:
        """Compute the pieces (M,) of some indices."""
        raise NotImplementedError

    def _since_origin(self, at_s: Floats) -> tuple[Floats, Floats, Floats]:
        """Compute the origins (M,) of the pieces of instants, the change since, and its rate."""
        index, fraction = _locate(self._time, at_s)
        pieces = self._pieces(index.tobytes())
        return pieces.origin, *pieces.at(fraction)


class SmoothPositions(_SmoothPath):
    """Positions by cubic Hermite pieces through the samples, with continuous velocity.

    Parameters
    ----------
    time_s
        (N,) strictly increasing, N >= 2.
    position
        (N, 3) [m].

    Raises
    ------
    ValueError
        The times do not increase.

    Notes
    -----
    Velocities at the samples are those of the parabola through each and its neighbours (Catmull and
    Rom 1974, for uneven spacing). Piecewise linear interpolation has kinks at the samples, which
    prevent an adjustment of the clock from converging.
    """

    def at(self, at_s: Floats) -> tuple[Floats, Floats]:
        """Compute positions and velocities at instants within the span.

        Parameters
        ----------
        at_s
            (M,) on the samples' clock.

        Returns
        -------
        position : (M, 3)
        velocity : (M, 3)
            [m/s], the exact derivative.

        Raises
        ------
        ValueError
            An instant is outside the span.
        """
        origin, moved, velocity = self._since_origin(at_s)
        return origin + moved, velocity

    def _make(self, index: Ints) -> _Pieces:
        around, width = _find_surrounding_samples(self._time, index)
        sample = self._sample[around]
        change = np.diff(sample, axis=1)
        rates = _end_rates(change, width)
        return _Pieces.hermite(sample[:, 1], change[:, 1], rates, width[:, 1:2])


class SmoothRotations(_SmoothPath):
    """Rotations by cubic Hermite pieces of the rotation vector from sample to sample.

    Parameters
    ----------
    time_s
        (N,) strictly increasing, N >= 2.
    xyzw
        (N, 4) quaternions world_from_body; q and -q are the same rotation.

    Raises
    ------
    ValueError
        The times do not increase.

    Notes
    -----
    Within a piece R = R0 exp(phi), the rate is Jr(phi) dphi/dt (Sola et al. 2018, eq. 67). The
    rates at the samples are computed as in `SmoothPositions`, so that they are continuous from
    piece to piece.
    """

    def at(self, at_s: Floats) -> tuple[Floats, Floats]:
        """Compute rotations and their rates at instants within the span.

        Parameters
        ----------
        at_s
            (M,) on the samples' clock.

        Returns
        -------
        world_from_body : (M, 3, 3)
        rate_body : (M, 3)
            Angular velocity in body axes [rad/s], the exact derivative: R(t + dt) = R(t) exp(rate
            dt).

        Raises
        ------
        ValueError
            An instant is outside the span.
        """
        origin, phi, slope = self._since_origin(at_s)
        turn, jacobian = exp_with_right_jacobian(phi)
        return origin @ turn, (jacobian @ slope[..., None])[..., 0]

    def _make(self, index: Ints) -> _Pieces:
        around, width = _find_surrounding_samples(self._time, index)
        rotation = matrix_from_xyzw(self._sample[around])
        turn = log_so3(np.swapaxes(rotation[:, :-1], -1, -2) @ rotation[:, 1:])
        start, end = _end_rates(turn, width)
        # Convert the angular rate at the far end, where phi is the whole turn, to dphi/dt.
        end = np.einsum("nij,nj->ni", right_jacobian_inverse(turn[:, 1]), end)
        return _Pieces.hermite(rotation[:, 1], turn[:, 1], (start, end), width[:, 1:2])


def _find_surrounding_samples(time: Floats, piece: Ints) -> tuple[Ints, Floats]:
    """Find the samples before, at both ends of, and after each of M pieces.

    Returns
    -------
    around : (M, 4)
        Their indices; at the ends of the span the outer ones are repeated.
    width : (M, 3)
        Widths of the three pieces between them [s]; 0 where there is none.
    """
    around = np.clip(piece[:, None] + np.arange(-1, 3), 0, len(time) - 1)
    return around, np.diff(time[around], axis=1)


def _end_rates(change: Floats, width: Floats) -> tuple[Floats, Floats]:
    """Compute rates (M, 3) at both ends of the middle one of three pieces.

    They follow from the changes (M, 3, 3) over all three: a rate is the slope of the parabola
    through three samples, or that of the piece itself where a neighbour is missing.
    """
    before, middle, after = (width[:, i : i + 1] for i in range(3))
    slope = change / np.where(width > 0, width, 1.0)[:, :, None]
    start = (slope[:, 0] * middle + slope[:, 1] * before) / (before + middle)
    end = (slope[:, 1] * after + slope[:, 2] * middle) / (middle + after)
    return np.where(before > 0, start, slope[:, 1]), np.where(after > 0, end, slope[:, 1])


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
        of the interval which starts there (at the end of the span: which ends there).

    Raises
    ------
    ValueError
        An instant is outside the span, or the times do not increase.
    """
    time, xyzw = _check_times(time_s), np.asarray(xyzw, np.float64)
    index, fraction = _locate(time, at_s)
    width = time[index + 1] - time[index]
    start, end = matrix_from_xyzw(xyzw[index]), matrix_from_xyzw(xyzw[index + 1])
    turn = log_so3(
        np.swapaxes(start, -1, -2) @ end
    )  # at most pi: the shortest arc for any signs of q
    return start @ exp_so3(fraction[:, None] * turn), turn / width[:, None]


def _check_times(time_s: Floats) -> Floats:
    """Return the times of samples (N,) if there are at least two and they increase."""
    time = np.asarray(time_s, np.float64)
    if len(time) < 2:
        raise ValueError(f"interpolation needs at least two samples, got {len(time)}")
    if not (np.diff(time) > 0).all():
        raise ValueError("interpolation needs strictly increasing times")
    return time


def _locate(time: Floats, at_s: Floats) -> tuple[Ints, Floats]:
    """Find the interval (M,) of each instant, and its fraction (M,) within it (0 to 1)."""
    at = np.asarray(at_s, np.float64)
    outside = ~((at >= time[0]) & (at <= time[-1]))
    if outside.any():
        raise ValueError(
            f"{int(outside.sum())} of {len(at)} instants lie outside the samples' span "
            f"{time[0]:.6f} to {time[-1]:.6f} s, the first at {at[outside][0]:.6f} s"
        )
    index = np.minimum(time.searchsorted(at, side="right") - 1, len(time) - 2)
    return index, (at - time[index]) / (time[index + 1] - time[index])
