"""Memory that goes back to the system when it is not needed any more."""

from __future__ import annotations

import ctypes
import sys

LARGE_BYTES = 1 << 20
_M_MMAP_THRESHOLD = -3  # malloc.h


def give_back_large_blocks() -> bool:
    """From 1 MB on, give each block of memory back as soon as it is freed.

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
    return mallopt is not None and mallopt(_M_MMAP_THRESHOLD, LARGE_BYTES) == 1
