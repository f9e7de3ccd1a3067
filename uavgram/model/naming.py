"""Names and numbers in plain sentences and on buttons: not more of them than one reads."""

from __future__ import annotations

from collections.abc import Iterable

MOST_NAMED = 5


def photo_name(frame: str) -> str:
    """``IMG_0046`` of ``IMG_0046.jpg``."""
    return frame.rpartition(".")[0] or frame


def listed(names: Iterable[str], most: int | None = MOST_NAMED, *, link: str = "and") -> str:
    """``A, B and C``, or the first few and how many more; each once.

    Parameters
    ----------
    names
        In their order; without any, the text is empty.
    most
        That are named; None: all.
    link
        What stands before the last one.
    """
    every = list(dict.fromkeys(names))
    if most is not None and len(every) > most:
        every, link = [*every[:most], f"{len(every) - most} more"], "and"
    return f" {link} ".join(filter(None, (", ".join(every[:-1]), *every[-1:])))


def listed_photos(frames: Iterable[str]) -> str:
    """The same of photos."""
    return listed(photo_name(frame) for frame in frames)


def counted(number: int, what: str) -> str:
    """``1 photo``, ``2 photos``.

    Parameters
    ----------
    number
        How many.
    what
        One of them, in a word to which an s can be added.
    """
    return f"{number} {what}{'' if number == 1 else 's'}"


def figures(value: float, digits: int = 2, sign: str = "") -> str:
    """Write a number with so many significant digits, and no power of ten for a large one.

    ``0.012``, ``1.2``, ``960``, ``4500``: of 963 and 4510 as well.

    Parameters
    ----------
    value
        Any number.
    digits
        That are significant.
    sign
        ``+`` where a positive number has a sign too.
    """
    text = format(value, f"{sign}.{digits}g")
    return format(float(text), f"{sign}.0f") if "e+" in text else text
