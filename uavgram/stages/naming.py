"""Names in plain sentences and on buttons: without quotation marks, and not more than one reads."""

from __future__ import annotations

from collections.abc import Iterable

MOST_NAMED = 5


def photo_name(frame: str) -> str:
    """``IMG_0046`` of ``IMG_0046.jpg``."""
    return frame.rpartition(".")[0] or frame


def listed(names: Iterable[str], link: str = "and") -> str:
    """``A, B and C``, or the first five and how many more.

    Parameters
    ----------
    names
        At least one.
    link
        What stands before the last one.
    """
    every = list(dict.fromkeys(names))
    if len(every) > MOST_NAMED:
        return f"{', '.join(every[:MOST_NAMED])} and {len(every) - MOST_NAMED} more"
    return f" {link} ".join(filter(None, (", ".join(every[:-1]), every[-1])))


def listed_photos(frames: Iterable[str]) -> str:
    """The same of photos."""
    return listed(photo_name(frame) for frame in frames)
