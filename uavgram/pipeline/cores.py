"""Number of cores that this process may use.

Separate from `threads.py`: a worker reads it before it loads numpy.
"""

from __future__ import annotations

import os

_allowed: list[int] = []
"""Number of cores assigned to this process, if any."""


def use_one_core() -> None:
    """Use one core from now on: this process is one of as many as there are cores."""
    _allowed[:] = [1]


def cores() -> int:
    """Return the number of cores that this process may use."""
    if _allowed:
        return _allowed[0]
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1
