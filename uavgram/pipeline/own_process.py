"""What a process of ours alone does without: the command line's, or a worker of a batch."""

from __future__ import annotations

import atexit
import gc
import sys
from collections.abc import Sequence
from importlib.abc import Loader, MetaPathFinder
from importlib.machinery import ModuleSpec, PathFinder
from importlib.util import LazyLoader
from types import ModuleType

NEVER = frozenset({"pandas"})
"""No command needs it, but Arrow, in which recordings are written, loads it where it is: a third of
a second. Where the search for a module fails, it is not installed."""

LATE = frozenset(
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
"""scipy loads all of numpy, down to its compiler of Fortran, Rerun all that one can do with its
viewer, and ezdxf all hatches and fonts of CAD. These are executed when somebody asks for something
in them, which hardly anybody does. What threads may ask for at once is none of them: while the
first executes it, the others find half of it. So numpy.ma, which each median asks, is loaded."""


def seldom_look_for_cycles() -> None:
    """Collect garbage hardly ever, and none of it at the end.

    The half thousand modules of a run are a million objects that stay. To look through them for
    cycles again and again takes a twentieth of a short run, to do so once more before the process
    ends as long.
    """
    gc.set_threshold(1_000_000, 20, 100)
    atexit.register(gc.freeze)


def load_little() -> None:
    """From now on load no module for nothing: see `NEVER` and `LATE`."""
    sys.meta_path.insert(0, _Little())


class _Little(MetaPathFinder):
    def find_spec(
        self, fullname: str, path: Sequence[str] | None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        """None, so that others go on looking, of everything else."""
        if fullname.partition(".")[0] in NEVER:
            raise ModuleNotFoundError(fullname, name=fullname)
        spec = PathFinder.find_spec(fullname, path, target) if fullname in LATE else None
        if spec is not None and isinstance(spec.loader, Loader):
            spec.loader = LazyLoader(spec.loader)
        return spec
