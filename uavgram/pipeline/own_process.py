"""What a process of ours alone does without: the command line's, or a worker of a batch."""

from __future__ import annotations

import atexit
import gc
import sys
from collections.abc import Sequence
from importlib.abc import MetaPathFinder
from types import ModuleType


def seldom_look_for_cycles() -> None:
    """Collect garbage seldom, and none of it at the end.

    The half thousand modules of a run are a million objects that stay. To look through them for
    cycles again and again takes a twentieth of a short run, to do so once more before the process
    ends as long.
    """
    gc.set_threshold(100_000, 20, 100)
    atexit.register(gc.freeze)


def never_load_pandas() -> None:
    """No command needs pandas, but Arrow, in which recordings are written, loads it where it is.

    That takes a third of a second. Where the search for a module fails, it is not installed.
    """
    sys.meta_path.insert(0, _NoPandas())


class _NoPandas(MetaPathFinder):
    def find_spec(self, fullname: str, *_: Sequence[str] | ModuleType | None) -> None:
        """None, so that others go on looking, of everything else."""
        if fullname.partition(".")[0] == "pandas":
            raise ModuleNotFoundError(fullname, name=fullname)
