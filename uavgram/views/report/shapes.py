"""Shapes of marks as paths of drawings, in hundredths of their unit.

Shapes of one style are joined to one path, as programs that draw set the whole style again for
each path.
"""

from __future__ import annotations

from collections.abc import Iterable
from functools import lru_cache
from typing import NamedTuple


class Mark(NamedTuple):
    """Pick: its place, its colour, and two paths: its outline, and a cross in its middle."""

    x: float
    y: float
    colour: str
    outline: str
    middle: str


def mark(
    place: tuple[float, float], kind: str, colour: str, half_widths: tuple[float, float]
) -> Mark:
    """Draw a pick.

    Parameters
    ----------
    place
        Place of its middle.
    kind
        Its origin as in `Source`; or ``removed`` for a removed one.
    colour
        Colour of its lines.
    half_widths
        Half widths of the outline, and of the cross in its middle.
    """
    outer, inner = half_widths
    return Mark(*place, colour, _SHAPES[kind](*place, outer), _cross(*place, inner))


def rings(places: Iterable[tuple[float, float]], r: float) -> str:
    """Draw one ring about each place, as one path."""
    return "".join(_ring(x, y, r) for x, y in places)


def _ring(x: float, y: float, r: float) -> str:
    return f"M{round(x - r, 2)} {round(y, 2)} {_curves(r)}"


@lru_cache(64)
def _curves(r: float) -> str:
    """Return four curves that differ from a circle by 0.03 % of its radius.

    With arcs some readers take thrice as long. Hundreds of rings of a page have the same size.
    """
    k = round(0.5523 * r, 2)
    q = round(r - k, 2)
    return (
        f"c0 {-k} {q} {-r} {r} {-r} {k} 0 {r} {q} {r} {r} "
        f"0 {k} {-q} {r} {-r} {r} {-k} 0 {-r} {-q} {-r} {-r} Z"
    )


def _cross(x: float, y: float, r: float) -> str:
    left, top, right, bottom = (round(part, 2) for part in (x - r, y - r, x + r, y + r))
    return f"M{left} {top} L{right} {bottom} M{left} {bottom} L{right} {top}"


def _square(x: float, y: float, r: float) -> str:
    return f"M{round(x - r, 2)} {round(y - r, 2)} h{2 * r} v{2 * r} h{-2 * r} Z"


def _diamond(x: float, y: float, r: float) -> str:
    left, top, right, bottom = (round(part, 2) for part in (x - r, y - r, x + r, y + r))
    return f"M{x} {top} L{right} {y} L{x} {bottom} L{left} {y} Z"


_SHAPES = {"match": _square, "target": _diamond, "hand": _ring, "removed": _cross}
