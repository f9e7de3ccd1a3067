"""Image numbers of a log's camera events: which repeat and which are missing."""

from __future__ import annotations

import numpy as np

from uavgram.model.arrays import Bools, Floats, Ints
from uavgram.model.flight.log import CameraEvents

_LARGEST_NUMBER = 1e6  # more exposures than any flight: damaged bytes
_MANY = 20


def image_numbers(stated: Floats) -> Ints:
    """(N,) image numbers as integers; -1 where a log has none or a senseless one."""
    sane = (stated >= 0) & (stated < _LARGEST_NUMBER)  # NaN compares False
    return np.where(sane, stated, -1.0).astype(np.int64)


def repeated_numbers(number: Ints) -> tuple[int, ...]:
    """Numbers (N,) that occur more than once; -1 is none."""
    seen, count = np.unique(number[number >= 0], return_counts=True)
    return tuple(seen[count > 1].tolist())


def lost_numbers(number: Ints) -> tuple[int, ...]:
    """Numbers that are missing between the first and the last of (N,); -1 is none.

    Where more are missing than are there, the numbers are no count of exposures and nothing is
    said.
    """
    seen = np.unique(number[number >= 0])
    if len(seen) < 2 or seen[-1] - seen[0] >= 2 * len(seen):
        return ()
    return tuple(np.setdiff1d(np.arange(seen[0], seen[-1]), seen).tolist())


def shot_notes(events: CameraEvents) -> tuple[str, ...]:
    """Missed, repeated and lost shots in plain words."""
    untimed = events.confirmed == 0
    notes = []
    if untimed.any() and not untimed.all():
        missed = listed(events.image_number[untimed].tolist())
        notes.append(f"{int(untimed.sum())} triggers without feedback (image {missed})")
    if events.repeated:
        notes.append(
            f"{len(events.repeated)} image numbers occur more than once in {events.source}: "
            f"{listed(events.repeated)}"
        )
    if events.lost:
        notes.append(
            f"{len(events.lost)} image numbers are missing in {events.source}: "
            f"{listed(events.lost)}"
        )
    return tuple(notes)


def listed(numbers: list[int] | tuple[int, ...]) -> str:
    """Numbers as text, the first twenty."""
    more = f", ... {len(numbers) - _MANY} more" if len(numbers) > _MANY else ""
    return ", ".join(str(n) for n in numbers[:_MANY]) + more


def first_of_instant(time_s: Floats) -> Bools:
    """(N,) of increasing times, whether this is the first of its instant."""
    return np.diff(time_s, prepend=-np.inf) > 0
