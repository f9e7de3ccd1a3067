"""Progress by injection: long loops pass their items through a function that the caller gives."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Protocol, TypeVar

Item = TypeVar("Item")


class Progress(Protocol):
    """Hands on `items`; `what` names the work, `total` counts it."""

    def __call__(self, items: Iterable[Item], what: str, total: int, /) -> Iterable[Item]:
        """Items, one by one, as they are taken."""


def silent(items: Iterable[Item], what: str, total: int, /) -> Iterable[Item]:  # noqa: ARG001
    """Hand on the items and show nothing.

    Parameters
    ----------
    items
        Anything.
    what
        What is being done.
    total
        Number of items.
    """
    return items
