"""Parser of JSON from unknown sources, safe against malformed content."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

from uavgram.errors import InputError

_MOST_DIGITS = 300  # of a whole number: more do not fit a float


def parse_json(
    path: Path, text: str | bytes, *, constant: Callable[[str], object] | None = None
) -> object:
    """Parse a file's text.

    Parameters
    ----------
    path
        Names the file in messages.
    text
        Its content; bytes are UTF-8.
    constant
        Called with NaN, Infinity and -Infinity, which are not JSON; None reads them as numbers.

    Raises
    ------
    InputError
        It is nested too deeply, or holds a number of thousands of digits.
    json.JSONDecodeError
        It is not JSON; the caller knows the file and explains that.
    """

    def whole(digits: str) -> int:
        if len(digits) > _MOST_DIGITS:
            raise InputError(
                path, f"holds a number of {len(digits)} digits: it is damaged; make it again"
            )
        return int(digits)

    try:
        return json.loads(text, parse_constant=constant, parse_int=whole)
    except RecursionError as fault:
        raise InputError(
            path, "has too many brackets inside each other: it is damaged; make it again"
        ) from fault
