"""Progress by injection: long loops pass their items through a function that the caller gives."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Protocol, TypeVar

from uavgram.model.work import report_work

Item = TypeVar("Item")


class Progress(Protocol):
    """Function that passes on `items`; `what` names the work, `total` counts it."""

    def __call__(self, items: Iterable[Item], what: str, total: int, /) -> Iterable[Item]:
        """Yield items, one by one, as they are taken."""


def silent(items: Iterable[Item], what: str, total: int, /) -> Iterable[Item]:
    """Pass on the items and show nothing; a watcher of this thread learns of each.

    Parameters
    ----------
    items
        Any items.
    what
        Name of the work.
    total
        Number of items.
    """
    for k, item in enumerate(items):
        report_work(f"{what}: {k + 1} of {total}")
        yield item
