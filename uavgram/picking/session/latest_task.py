"""Background workers that process only the newest of their tasks."""

from __future__ import annotations

import threading
from collections.abc import Callable, Mapping
from typing import Generic, TypeVar

Task = TypeVar("Task")


class LatestTask(Generic[Task]):
    """The newest task, and the threads that work on it; older tasks are skipped.

    Parameters
    ----------
    workers
        Function that each thread runs, by its name: until `newer` returns None.

    Attributes
    ----------
    changed
        Condition held while the attributes are read or set; notified when they change.
    task
        The newest task; None before the first.
    is_over
        Whether the threads are to end.
    """

    def __init__(self, workers: Mapping[str, Callable[[], None]]) -> None:
        self.changed = threading.Condition()
        self.task: Task | None = None
        self.is_over = False
        self._threads = [
            threading.Thread(target=work, name=name, daemon=True) for name, work in workers.items()
        ]

    def start(self) -> None:
        """Start the threads."""
        for thread in self._threads:
            thread.start()

    def submit(self, task: Task) -> None:
        """Make this the newest task."""
        with self.changed:
            self.task = task
            self.changed.notify_all()

    def newer(self, than: Task | None) -> Task | None:
        """Wait for a task newer than the last one; None after `stop`."""
        with self.changed:
            self.changed.wait_for(lambda: self.task is not than or self.is_over)
            return None if self.is_over else self.task

    def is_outdated(self, task: Task) -> bool:
        """Return whether there is a newer task, or `stop` was called."""
        with self.changed:
            return self.task is not task or self.is_over

    def stop(self) -> None:
        """End the threads, each after its present task."""
        with self.changed:
            self.is_over = True
            self.changed.notify_all()
        for thread in self._threads:
            if thread.is_alive():
                thread.join()
