"""A log's camera events in order, and their image numbers: which repeat and which are missing."""

from __future__ import annotations

from typing import Literal

import numpy as np

from uavgram.io.logs.quality.samples import Found
from uavgram.model.arrays import Floats, Ints
from uavgram.model.flight.log import CameraEvents

_LARGEST_NUMBER = 1e6  # more exposures than any flight: damaged bytes
_MANY = 20


def image_numbers(stated: Floats) -> Ints:
    """(N,) image numbers as integers; -1 where a log has none or a senseless one."""
    sane = (stated >= 0) & (stated < _LARGEST_NUMBER)  # NaN compares False
    return np.where(sane, stated, -1.0).astype(np.int64)


def _repeated_numbers(number: Ints) -> tuple[int, ...]:
    """Numbers (N,) that occur more than once; -1 is none."""
    seen, count = np.unique(number[number >= 0], return_counts=True)
    return tuple(seen[count > 1].tolist())


def _lost_numbers(number: Ints) -> tuple[int, ...]:
    """Numbers that are missing between the first and the last of (N,); -1 is none.

    Where more are missing than are there, the numbers are no count of exposures and nothing is
    said.
    """
    seen = np.unique(number[number >= 0])
    if len(seen) < 2 or seen[-1] - seen[0] >= 2 * len(seen):
        return ()
    return tuple(np.setdiff1d(np.arange(seen[0], seen[-1]), seen).tolist())


def events_of(
    source: str,
    instant: Literal["feedback", "command"],
    exposures: tuple[Floats, Ints, Floats],
    missed: tuple[Floats, Ints] | None = None,
) -> Found[CameraEvents]:
    """Exposures in the order of time, each instant once; what is odd about their numbers.

    Parameters
    ----------
    source, instant
        As in `CameraEvents`.
    exposures
        Times since boot, image numbers (-1: none), and whether each is confirmed; each (N,).
    missed
        Times and numbers (M,) of commands that no exposure answers; None where nobody can know.
    """
    time, number, confirmed = exposures
    repeated = _repeated_numbers(number)
    if missed is not None:
        time, number = (np.concatenate(pair) for pair in zip(exposures[:2], missed, strict=True))
        confirmed = np.append(confirmed, np.zeros(len(missed[0])))
    order = np.argsort(time, kind="stable")
    rows = order[np.diff(time[order], prepend=-np.inf) > 0]
    if not len(rows):
        return None, ()
    events = CameraEvents(
        time_boot_s=time[rows],
        image_number=number[rows],
        confirmed=confirmed[rows],
        source=source,
        instant=instant,
        repeated=repeated,
        lost=_lost_numbers(number),
    )
    return events, _notes(events)


def _notes(events: CameraEvents) -> tuple[str, ...]:
    """Missed, repeated and lost shots in plain words."""
    untimed = events.confirmed == 0
    notes = []
    if untimed.any() and not untimed.all():
        missed = _listed(events.image_number[untimed].tolist())
        notes.append(f"{int(untimed.sum())} triggers without feedback (image {missed})")
    if events.repeated:
        notes.append(
            f"{len(events.repeated)} image numbers occur more than once in {events.source}: "
            f"{_listed(events.repeated)}"
        )
    if events.lost:
        notes.append(
            f"{len(events.lost)} image numbers are missing in {events.source}: "
            f"{_listed(events.lost)}"
        )
    return tuple(notes)


def _listed(numbers: list[int] | tuple[int, ...]) -> str:
    """Numbers as text, the first twenty."""
    more = f", ... {len(numbers) - _MANY} more" if len(numbers) > _MANY else ""
    return ", ".join(str(n) for n in numbers[:_MANY]) + more
