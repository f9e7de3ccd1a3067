"""How many cores this process may use.

Apart from `threads.py`: a worker reads it before anything that loads numpy.
"""

from __future__ import annotations

import os

_allowed: list[int] = []
"""How many cores this process was told to use, if it was."""


def use_one_core() -> None:
    """From now on use one core: this process is one of as many as there are cores."""
    _allowed[:] = [1]


def cores() -> int:
    """Cores that this process may use."""
    if _allowed:
        return _allowed[0]
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1
