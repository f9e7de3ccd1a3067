"""Return of freed memory to the system."""

from __future__ import annotations

import ctypes
import sys

LARGE_BYTES = 1 << 20
FEW_ARENAS = 2
"""Number of heaps that all threads share: a heap of its own would keep memory that others need."""
_M_MMAP_THRESHOLD, _M_ARENA_MAX = -3, -8  # malloc.h


def return_large_blocks() -> bool:
    """Return each block of 1 MB or more to the system as soon as it is freed; use few heaps.

    glibc raises this size to that of every larger block that was freed, up to 32 MB, and keeps
    smaller ones for its thread (mallopt(3), M_MMAP_THRESHOLD). Each of the threads that cut tiles,
    a few megabytes at a time, would keep that much for good.

    Returns
    -------
    Whether the C library supports this; others are left as they are.
    """
    if sys.platform != "linux":
        return False
    mallopt = getattr(ctypes.CDLL(None), "mallopt", None)
    if mallopt is None:
        return False
    gives_back = bool(mallopt(_M_MMAP_THRESHOLD, LARGE_BYTES) == 1)
    shares = bool(mallopt(_M_ARENA_MAX, FEW_ARENAS) == 1)
    return gives_back and shares
