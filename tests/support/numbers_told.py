"""Numbers as they are told, against those that they should be."""

from __future__ import annotations

import re
from collections.abc import Iterable

NUMBER = re.compile(r"(?<![\w.])[+-]?\d+(?:\.\d+)?")


def agree(cells: Iterable[str], *wanted: float | None) -> None:
    """All numbers of these cells are the wanted ones, and none is left over."""
    found = NUMBER.findall(" ".join(cells))
    numbers = [value for value in wanted if value is not None]
    assert len(found) == len(numbers), (cells, numbers)
    for shown, value in zip(found, numbers, strict=True):
        assert abs(float(shown) - value) <= 0.5001 * 10.0 ** -len(shown.partition(".")[2])
