"""Probable mistakes in stated coordinates or units, in words."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from uavgram.model.arrays import Floats
from uavgram.model.naming import format_digits

UNITS = (
    (1000.0, "millimetres"),
    (100.0, "centimetres"),
    (1.0 / 0.0254, "inches"),
    (1.0 / 0.3048, "feet"),
    (0.001, "kilometres"),
)
"""Number of each unit in a metre: exact, the inch by definition of 1959."""

DECIMALS = (
    (10.0, "the decimal point one place off"),
    (0.1, "the decimal point one place off"),
    (0.01, "the decimal point two places off"),
)
CONVERSIONS = (
    (0.3048, "turned from feet into metres twice"),
    (0.0254, "turned from inches into metres twice"),
)

MAX_RATIO_DIFFERENCE = 0.01
"""Relative difference up to which a ratio is that of a unit, however precise the ratio is."""

MAX_RATIO_DIFFERENCE_OF_ALL = 0.2
"""Upper bound of that difference, however imprecise the ratio is: any two of these ratios differ by
more."""

MAX_RATIO_SIGMAS = 3.0


def explain_ratio(ratio: float, relative_sigma: float) -> str:
    """Return the mistake that explains a ratio of lengths, such as ``in feet``; empty if none does.

    Parameters
    ----------
    ratio
        Written over correct value.
    relative_sigma
        Relative sigma of that ratio.
    """
    known = [*((size, f"in {unit}") for size, unit in UNITS), *DECIMALS, *CONVERSIONS]
    off = np.abs(np.log(ratio / np.array([size for size, _ in known])))
    nearest = int(off.argmin())
    if off[nearest] > min(
        max(MAX_RATIO_DIFFERENCE, MAX_RATIO_SIGMAS * relative_sigma), MAX_RATIO_DIFFERENCE_OF_ALL
    ):
        return ""
    return known[nearest][1]


def explain_length(taped_m: float, taped_sigma_m: float, seen_m: float, sigma_m: float) -> str:
    """Find the probable mistake in a length; empty if no mistake fits.

    Parameters
    ----------
    taped_m, taped_sigma_m
        Written length, and its sigma.
    seen_m, sigma_m
        Correct length, and its sigma.
    """
    if not seen_m > 0:
        return ""
    ratio = taped_m / seen_m
    return explain_ratio(ratio, float(np.hypot(sigma_m, taped_sigma_m / ratio)) / seen_m)


FAR_M = 10_000.0
"""Distance beyond which a point is outside any survey [m]: its coordinates are those of another
place."""

MAX_EXCHANGED_SHARE = 0.1
"""Largest share of a distance that remains when east and north are exchanged back."""

MIN_COMPONENT = 0.6
"""Smallest component of a unit vector along one axis that counts as its main direction."""

SIDES = (("west", "east"), ("south", "north"), ("below", "above"))


def describe_displacement(off_m: Floats, sigma_m: Floats) -> str:
    """Describe distance, sigma and direction of stated coordinates from the estimated point.

    Parameters
    ----------
    off_m, sigma_m
        (3,) stated minus found, east, north, up; and the sigma of each.
    """
    distance = float(np.linalg.norm(off_m))
    direction = off_m / distance
    sigma = float(np.linalg.norm(sigma_m * direction))
    unit, one_m = ("km", 1000.0) if distance > FAR_M else ("m", 1.0)
    size = f"{format_digits(distance / one_m, 4)} {unit} (± {format_digits(sigma)} m)"
    return f"{size} from where it was found, {_describe_direction(direction)}"


def explain_coordinates(
    stated_m: Floats, found_m: Floats, every_m: Mapping[str, Floats] | None = None
) -> str:
    """Return the probable mistake in wrong coordinates, in brackets; empty if none is likely.

    Parameters
    ----------
    stated_m, found_m
        (3,) east, north, up of a point, as stated and as found.
    every_m
        Stated coordinates (3,) of all points, by label.
    """
    off_m = float(np.linalg.norm(stated_m - found_m))
    turned_off_m = float(np.linalg.norm(stated_m[[1, 0, 2]] - found_m))
    if turned_off_m < MAX_EXCHANGED_SHARE * off_m:
        return " (east and north exchanged?)"
    # Another point's coordinates, if this is much nearer than all others.
    away_m = {name: float(np.linalg.norm(at - found_m)) for name, at in (every_m or {}).items()}
    nearest, *rest = sorted(away_m, key=away_m.__getitem__) or [""]
    if rest and away_m[nearest] < MAX_EXCHANGED_SHARE * min(off_m, away_m[rest[0]]):
        return f" (found at the coordinates of {nearest!r}: exchanged?)"
    is_far = off_m > FAR_M
    return " (latitude and longitude swapped, a wrong sign, another system?)" if is_far else ""


def _describe_direction(direction: Floats) -> str:
    """Describe the direction of a unit vector (3,)."""
    axis = int(np.abs(direction).argmax())
    if abs(direction[axis]) < MIN_COMPONENT:
        return "to no one side"
    side = SIDES[axis][int(direction[axis] > 0)]
    return f"mostly {side}" if axis == 2 else f"mostly to the {side}"
