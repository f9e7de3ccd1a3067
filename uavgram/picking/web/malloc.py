"""Memory that goes back to the system when it is not needed any more."""

from __future__ import annotations

import ctypes
import sys

LARGE_BYTES = 1 << 20
FEW_ARENAS = 2
"""Heaps that all threads share: a thread that has one of its own keeps in it what others need."""
_M_MMAP_THRESHOLD, _M_ARENA_MAX = -3, -8  # malloc.h


def give_back_large_blocks() -> bool:
    """From 1 MB on, give each block of memory back as soon as it is freed; and few heaps.

    glibc raises the size from which it does so to that of every larger block that was freed, up to
    32 MB, and keeps smaller ones for its thread (mallopt(3), M_MMAP_THRESHOLD). Each of the threads
    that cut tiles, a few megabytes at a time, would keep that much for good.

    Returns
    -------
    Whether the C library knows such a bound; others are left as they are.
    """
    if sys.platform != "linux":
        return False
    mallopt = getattr(ctypes.CDLL(None), "mallopt", None)
    if mallopt is None:
        return False
    gives_back = bool(mallopt(_M_MMAP_THRESHOLD, LARGE_BYTES) == 1)
    shares = bool(mallopt(_M_ARENA_MAX, FEW_ARENAS) == 1)
    return gives_back and shares
