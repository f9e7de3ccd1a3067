"""Shapes of marks as the paths of drawings, in hundredths of their unit.

Shapes that look the same are joined to one path: a program that draws sets all that a look is for
each path of its own.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple


class Mark(NamedTuple):
    """A pick: where, its colour, and two paths: its outline, and a cross in its middle."""

    x: float
    y: float
    colour: str
    outline: str
    middle: str


def ring(x: float, y: float, r: float) -> str:
    """Four curves, off a circle by 0.03 % of its radius: arcs take some readers thrice as long."""
    k = round(0.5523 * r, 2)
    q = round(r - k, 2)
    return (
        f"M{round(x - r, 2)} {round(y, 2)} c0 {-k} {q} {-r} {r} {-r} {k} 0 {r} {q} {r} {r} "
        f"0 {k} {-q} {r} {-r} {r} {-k} 0 {-r} {-q} {-r} {-r} Z"
    )


def rings(places: Iterable[tuple[float, float]], r: float) -> str:
    """One about each place, as one path."""
    return "".join(ring(x, y, r) for x, y in places)


def cross(x: float, y: float, r: float) -> str:
    """Two strokes from corner to corner of a square."""
    left, top, right, bottom = (round(part, 2) for part in (x - r, y - r, x + r, y + r))
    return f"M{left} {top} L{right} {bottom} M{left} {bottom} L{right} {top}"


def square(x: float, y: float, r: float) -> str:
    """Of twice that width."""
    return f"M{round(x - r, 2)} {round(y - r, 2)} h{2 * r} v{2 * r} h{-2 * r} Z"


def diamond(x: float, y: float, r: float) -> str:
    """A square that stands on a corner."""
    top, right, bottom, left = (round(part, 2) for part in (y - r, x + r, y + r, x - r))
    return f"M{x} {top} L{right} {y} L{x} {bottom} L{left} {y} Z"


SHAPES = {"match": square, "target": diamond, "hand": ring, "removed": cross}
"""Of picks that fit or may not, by who made them; and of those that were taken out."""
