"""What a process of ours alone does without: the command line's, or a worker of a batch."""

from __future__ import annotations

import ast
import atexit
import gc
import sys
from collections.abc import Iterator, Sequence
from importlib import import_module
from importlib.abc import InspectLoader, Loader, MetaPathFinder
from importlib.machinery import ModuleSpec, PathFinder
from importlib.util import LazyLoader, find_spec, resolve_name
from types import ModuleType

NEVER = frozenset({"pandas"})
"""No command needs it, but Arrow, in which recordings are written, loads it where it is: a third of
a second. Where the search for a module fails, it is not installed."""

LATE = frozenset({"numpy.ctypeslib", "numpy.f2py", "numpy.polynomial", "numpy.testing"})
"""scipy loads all of numpy, down to its compiler of Fortran. These are executed when somebody asks
for something in them, which nobody does."""

PIECEMEAL = frozenset(
    {"rerun", "rerun.archetypes", "rerun.components", "rerun.encodings", "rerun.blueprint"}
    | {f"rerun.blueprint.{one}" for one in ("archetypes", "components", "encodings", "views")}
)
"""Packages that hardly do more than name what their modules define. Each module is loaded when
somebody asks for a name of it, as for imports that Python 3.15 calls lazy (PEP 810): of Rerun's 500
a recording needs 200."""


def seldom_look_for_cycles() -> None:
    """Collect garbage hardly ever, and none of it at the end.

    The half thousand modules of a run are a million objects that stay. To look through them for
    cycles again and again takes a twentieth of a short run, to do so once more before the process
    ends as long.
    """
    gc.set_threshold(1_000_000, 20, 100)
    atexit.register(gc.freeze)


def load_little() -> None:
    """From now on load no module for nothing: see `NEVER`, `LATE` and `PIECEMEAL`."""
    sys.meta_path.insert(0, _Little())


class _Little(MetaPathFinder):
    def find_spec(
        self, fullname: str, path: Sequence[str] | None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        """None, so that others go on looking, of everything else."""
        if fullname.partition(".")[0] in NEVER:
            raise ModuleNotFoundError(fullname, name=fullname)
        if fullname not in LATE | PIECEMEAL:
            return None
        spec = PathFinder.find_spec(fullname, path, target)
        if spec is not None and isinstance(spec.loader, InspectLoader):
            loader = spec.loader
            spec.loader = LazyLoader(loader) if fullname in LATE else _Piecemeal(loader)
        return spec


class _Piecemeal(Loader):
    """Loads what a package names when it is asked for; for anything else the package itself."""

    def __init__(self, whole: InspectLoader) -> None:
        self._whole = whole

    def create_module(self, spec: ModuleSpec) -> None:
        """As Python does it by itself."""

    def exec_module(self, module: ModuleType) -> None:
        package = module.__name__
        defined = dict(_named(self._whole.get_source(package) or "", package))

        def look_up(name: str) -> object:
            if name in defined:
                where, what = defined[name]
                found = import_module(where)
                value = getattr(found, what) if what else found
            elif not name.startswith("__") and find_spec(f"{package}.{name}") is not None:
                value = import_module(f"{package}.{name}")
            elif name.startswith("__") and name != "__version__":
                raise AttributeError(name)
            else:
                del module.__dict__["__getattr__"]
                self._whole.exec_module(module)
                return getattr(module, name)
            setattr(module, name, value)
            return value

        module.__dict__["__getattr__"] = look_up


def _named(source: str, package: str) -> Iterator[tuple[str, tuple[str, str]]]:
    """Names that a package imports; of each the module, and what it is there ("": the module)."""
    for statement in ast.parse(source).body:
        if isinstance(statement, ast.Import):
            yield from ((one.asname or one.name, (one.name, "")) for one in statement.names)
        elif isinstance(statement, ast.ImportFrom) and statement.level and statement.module:
            where = resolve_name("." * statement.level + statement.module, package)
            yield from ((one.asname or one.name, (where, one.name)) for one in statement.names)
