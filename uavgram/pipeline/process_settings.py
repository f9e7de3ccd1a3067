"""Settings of processes of this program only, the command line's or a worker's; their cores.

Separate from `threads.py`: a worker reads it before it loads numpy.
"""

from __future__ import annotations

import atexit
import gc
import os
import sys
from collections.abc import Sequence
from importlib.abc import Loader, MetaPathFinder
from importlib.machinery import ModuleSpec, PathFinder
from importlib.util import LazyLoader
from types import ModuleType

UNUSED_MODULES = frozenset({"pandas"})
"""Modules that no command needs, but that Arrow, in which recordings are written, loads if
installed: a third of a second. Where the search for a module fails, it counts as not installed."""

LATE_MODULES = frozenset(
    {
        "ezdxf.fonts.lff",
        "ezdxf.fonts.shapefile",
        "ezdxf.tools.pattern",
        "ezdxf.tools.text_size",
        "numpy.ctypeslib",
        "numpy.f2py",
        "numpy.polynomial",
        "numpy.testing",
        "psutil",
        "pydoc",
        "rerun.experimental",
        "rerun.server",
        "rerun.urdf",
        "scipy.spatial.transform",
    }
)
"""Modules that are executed at their first use, which is rare: scipy loads all of numpy, including
its Fortran compiler, Rerun its complete viewer interface, and ezdxf all hatches and fonts of CAD.
Modules that threads may use simultaneously are excluded: while the first thread executes the
module, the others find half of it. So numpy.ma, which each median uses, is loaded."""


def collect_garbage_rarely() -> None:
    """Collect garbage rarely, and not at the end.

    The half thousand modules of a run are a million permanent objects. Repeated searches for cycles
    among them take a twentieth of a short run, and another one before the process ends as long.
    """
    gc.set_threshold(1_000_000, 20, 100)
    atexit.register(gc.freeze)


def avoid_modules() -> None:
    """Avoid unnecessary modules from now on: see `UNUSED_MODULES` and `LATE_MODULES`."""
    sys.meta_path.insert(0, _ModuleFilter())


class _ModuleFilter(MetaPathFinder):
    def find_spec(
        self, fullname: str, path: Sequence[str] | None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        """Return None for all other modules, so that the search continues."""
        if fullname.partition(".")[0] in UNUSED_MODULES:
            raise ModuleNotFoundError(fullname, name=fullname)
        spec = PathFinder.find_spec(fullname, path, target) if fullname in LATE_MODULES else None
        if spec is not None and isinstance(spec.loader, Loader):
            spec.loader = LazyLoader(spec.loader)
        return spec


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
    import ctypes  # noqa: PLC0415  (only the page needs it)

    mallopt = getattr(ctypes.CDLL(None), "mallopt", None)
    if mallopt is None:
        return False
    gives_back = bool(mallopt(_M_MMAP_THRESHOLD, LARGE_BYTES) == 1)
    shares = bool(mallopt(_M_ARENA_MAX, FEW_ARENAS) == 1)
    return gives_back and shares


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
