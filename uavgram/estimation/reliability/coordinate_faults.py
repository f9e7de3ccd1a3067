"""How a point lies beside its stated coordinates, in words."""

from __future__ import annotations

import numpy as np

from uavgram.model.arrays import Floats

FAR_M = 10_000.0
"""Distance beyond which a point lies outside any survey: its coordinates are another place's."""

EXCHANGED_SHARE = 0.1
"""Of a distance, that is left at most where east and north are put back."""

MOSTLY = 0.6
"""Share of a distance from which on it lies mostly along one axis."""

SIDES = (("west", "east"), ("south", "north"), ("below", "above"))


def displaced(off_m: Floats, sigma_m: Floats) -> str:
    """How far, how surely and whither stated coordinates lie from where a point was found.

    Parameters
    ----------
    off_m, sigma_m
        (3,) stated minus found, east, north, up; and the sigma of each.
    """
    distance = float(np.linalg.norm(off_m))
    direction = off_m / distance
    sigma = float(np.linalg.norm(sigma_m * direction))
    size = f"{distance / 1000:.4g} km" if distance > FAR_M else f"{distance:.4g} m"
    return f"{size} from where it was found (sigma {sigma:.2g} m), {_whither(direction)}"


def likely_fault(stated_m: Floats, found_m: Floats) -> str:
    """What may be wrong with coordinates that are off, in brackets; empty where nothing is likely.

    Parameters
    ----------
    stated_m, found_m
        (3,) east, north, up of a point as stated, and where it was found.
    """
    off_m = float(np.linalg.norm(stated_m - found_m))
    turned_off_m = float(np.linalg.norm(stated_m[[1, 0, 2]] - found_m))
    if turned_off_m < EXCHANGED_SHARE * off_m:
        return " (east and north exchanged?)"
    return " (a wrong sign, another coordinate system?)" if off_m > FAR_M else ""


def _whither(direction: Floats) -> str:
    """Where a unit vector (3,) points."""
    axis = int(np.abs(direction).argmax())
    if abs(direction[axis]) < MOSTLY:
        return "to no one side"
    side = SIDES[axis][int(direction[axis] > 0)]
    return f"mostly {side}" if axis == 2 else f"mostly to the {side}"
