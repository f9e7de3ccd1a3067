"""Frames that a fault of the log touches: how far their seed is no longer believed.

A jump does not say which side of it is right. The side with the most photos keeps its sigmas; of
every other the size of the jump is added to each frame's own variance. What all frames share (the
biases of the flight) has to cover the other case, so it is widened by as much.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from uavgram.model.arrays import Bools, Floats
from uavgram.model.flight.frames import Frames
from uavgram.model.flight.second_opinions import LogFault

Faults = Sequence[LogFault]
_UNKNOWN_RAD = np.pi


class Freed(NamedTuple):
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
        """(N,) which frames are freed."""
        return np.asarray((self.position > 0).any(axis=1) | (self.attitude > 0).any(axis=1))


def freed_by(faults: Faults, time_s: Floats, unsure_s: Floats) -> Freed:
    """What faults of a log add to the variances of N frames.

    Horizontal directions are treated alike: the size of a jump is known, which of the places about
    it is right is not.

    Parameters
    ----------
    faults
        In the order of time.
    time_s
        (N,) instants of the frames.
    unsure_s
        (N,) by how much these may be wrong: so near a jump, a frame may be on its other side.
    """
    jumps, turns = (
        [f for f in faults if f.kind == kind] for kind in ("position-jump", "attitude-jump")
    )
    position, position_bias = _by_jumps(jumps, time_s, unsure_s)
    turned, turned_bias = _by_jumps(turns, time_s, unsure_s)
    for fault in faults:
        if fault.is_jump:
            continue
        inside = (time_s >= fault.start_s - unsure_s) & (time_s <= fault.end_s + unsure_s)
        part = turned if fault.is_of_attitude else position
        part[inside] += _square(np.array(fault.change))
    turned = np.minimum(turned, _UNKNOWN_RAD**2)
    return Freed(position, turned, position_bias, float(min(turned_bias[2], _UNKNOWN_RAD**2)))


def unsure_s(frames: Frames) -> Floats:
    """(N,) by how much the instants of the matched frames may be wrong: three sigmas."""
    own_s = np.nan_to_num(frames.sigma_time_s[frames.matched], nan=0.0)
    return np.asarray(3.0 * np.hypot(own_s, frames.clock_offset_sigma_s))


def _by_jumps(jumps: Faults, time_s: Floats, unsure_s: Floats) -> tuple[Floats, Floats]:
    """(N, 3) variances of frames off the level on which most of them are; (3,) the largest."""
    level = np.zeros((len(time_s), 3))
    between = np.zeros((len(time_s), 3))
    side = np.zeros(len(time_s), dtype=np.int64)
    for jump in jumps:
        behind = time_s >= jump.end_s
        level[behind] += jump.change
        side[behind] += 1
        # Between two samples the way bends to and fro: as wrong as the whole jump.
        during = (time_s > jump.start_s - unsure_s) & (time_s < jump.end_s + unsure_s)
        between[during] += _square(np.array(jump.change))
    if not len(time_s) or not jumps:
        return between, np.zeros(3)
    most = int(np.bincount(side).argmax())
    off = _square(level - level[side == most][0])
    return off + between, (off + between).max(axis=0)


def _square(change: Floats) -> Floats:
    """(..., 3) squares, both horizontal ones that of the horizontal size."""
    horizontal = np.sum(change[..., :2] ** 2, axis=-1)
    return np.stack([horizontal, horizontal, change[..., 2] ** 2], axis=-1)
