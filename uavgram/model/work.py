"""Long work that is watched: its stages are named, and it can be stopped."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar

Watcher = Callable[[str], None]
"""Called with the name of a stage as it begins, and with "" while it goes on; raises to stop."""

_watcher: ContextVar[Watcher | None] = ContextVar("watcher", default=None)


@contextmanager
def watch_work(watcher: Watcher) -> Iterator[None]:
    """Watch the work of this thread."""
    token = _watcher.set(watcher)
    try:
        yield
    finally:
        _watcher.reset(token)


def report_work(stage: str = "") -> None:
    """Report to the watcher of this thread, if any, that a stage begins or that it goes on."""
    watcher = _watcher.get()
    if watcher is not None:
        watcher(stage)
