"""Known lengths of coded plates: sides and diagonals of every plate that was found."""

from __future__ import annotations

import numpy as np

from uavgram.model.arrays import Floats
from uavgram.model.naming import corner_label, plate_of
from uavgram.model.observations import KnownLines, Picks

PLATE_TAPE = "targets"
"""Name of the tape of all plates, as one printer made them: they share its scale."""

OWN_SIGMA_SHARE = 0.5
"""Share of the sigma of a plate's side that differs from side to side."""

SIDES = ((0, 1), (1, 2), (2, 3), (3, 0), (0, 2), (1, 3))
"""Pairs of corners whose distance is known: sides and diagonals."""

SQUARE = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])


def own_scale_sigma(outline_m: Floats, sigma_m: float) -> tuple[tuple[str, float], ...]:
    """Return the prior of the common scale of all plates.

    Parameters
    ----------
    outline_m
        (4, 2) corners of a plate.
    sigma_m
        Standard deviation of its longest side.
    """
    return ((PLATE_TAPE, sigma_m / _longest(outline_m)),)


def add_plate_sides(
    lines: KnownLines, picks: Picks, outline_m: Floats, sigma_m: float
) -> KnownLines:
    """Add lengths between the corners of every plate that was found.

    Where a person measured between two corners of a plate, only that length is used.

    Parameters
    ----------
    lines
        Lengths of the project.
    picks
        All picks; those of source ``target`` give the plates.
    outline_m
        (4, 2) corners of a plate.
    sigma_m
        Standard deviation of its longest side.
    """
    taken = set(lines.name) | {
        f"{a} {b}"
        for a, b in zip((*lines.start, *lines.end), (*lines.end, *lines.start), strict=True)
    }
    pairs = [
        (
            corner_label(plate, a),
            corner_label(plate, b),
            float(np.linalg.norm(outline_m[b] - outline_m[a])),
        )
        for plate, corners in sorted(_find_plates(picks).items())
        for a, b in SIDES
        if {a, b} <= set(corners)
    ]
    new = [one for one in pairs if f"{one[0]} {one[1]}" not in taken]
    if not new:
        return lines
    sides = KnownLines(
        name=tuple(f"{a} {b}" for a, b, _ in new),
        start=tuple(a for a, _, _ in new),
        end=tuple(b for _, b, _ in new),
        length_m=np.array([length for _, _, length in new]),
        sigma_m=np.full(len(new), OWN_SIGMA_SHARE * sigma_m),
        adjust=np.ones(len(new), dtype=np.bool_),
        tape=(PLATE_TAPE,) * len(new),
    )
    return lines.with_more(sides)


def _find_plates(picks: Picks) -> dict[int, set[int]]:
    """Return the plates that the program found, with the numbers of all picked corners."""
    found: dict[int, set[int]] = {}
    made = picks.of_source("target")
    plates = {plate_of(label) for label, by_us in zip(picks.label, made, strict=True) if by_us}
    for label in dict.fromkeys(picks.label):
        plate = plate_of(label)
        if plate is not None and plate in plates:
            found.setdefault(plate, set()).add(int(label[-1]) - 1)
    return found


def _longest(outline_m: Floats) -> float:
    return float(np.linalg.norm(np.roll(outline_m, -1, axis=0) - outline_m, axis=1).max())
