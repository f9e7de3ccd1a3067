"""By which unit a number that should be in metres was probably taken, in words."""

from __future__ import annotations

import numpy as np

UNITS = (
    (1000.0, "millimetres"),
    (100.0, "centimetres"),
    (1.0 / 0.0254, "inches"),
    (1.0 / 0.3048, "feet"),
    (0.001, "kilometres"),
)
"""How many of a unit a metre has: exact, the inch by definition of 1959."""

DECIMALS = (
    (10.0, "the decimal point one place off"),
    (0.1, "the decimal point one place off"),
    (0.01, "the decimal point two places off"),
)
CONVERSIONS = (
    (0.3048, "turned from feet into metres twice"),
    (0.0254, "turned from inches into metres twice"),
)

CLOSE = 0.01
"""Relative difference up to which a ratio is that of a unit, however well it is known."""

FARTHEST = 0.2
"""The same, however badly it is known: so far no two of these ratios lie apart."""

SIGMAS = 3.0


def likely_mistake(ratio: float, relative_sigma: float) -> str:
    """What makes a length so many times too long, such as ``in feet``; empty where nothing does.

    Parameters
    ----------
    ratio
        As written, over what it should be.
    relative_sigma
        Of that ratio.
    """
    known = [*((size, f"in {unit}") for size, unit in UNITS), *DECIMALS, *CONVERSIONS]
    off = np.abs(np.log(ratio / np.array([size for size, _ in known])))
    nearest = int(off.argmin())
    if off[nearest] > min(max(CLOSE, SIGMAS * relative_sigma), FARTHEST):
        return ""
    return known[nearest][1]


def mistake(taped_m: float, taped_sigma_m: float, seen_m: float, sigma_m: float) -> str:
    """Find what was probably mistaken in a length; empty where nothing fits.

    Parameters
    ----------
    taped_m, taped_sigma_m
        As written, and its sigma.
    seen_m, sigma_m
        What it should be, and the sigma of that.
    """
    if not seen_m > 0:
        return ""
    ratio = taped_m / seen_m
    return likely_mistake(ratio, float(np.hypot(sigma_m, taped_sigma_m / ratio)) / seen_m)
