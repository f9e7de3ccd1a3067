"""Lengths, areas, volumes and speeds as text, in the units of the project.

All computations are in metres. ``picking/page/elements/units.js`` has the same rules; sentences
are converted by `views.unit_words.in_units`.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import NamedTuple

from uavgram.model.naming import FOOT_M, METRIC, Units, units_from_options
from uavgram.model.result.result import Result

INCHES = 12
"""Inches of a foot."""

INCH_M = FOOT_M / INCHES
YARD_FT3 = 27.0
"""Cubic feet of a cubic yard; larger volumes are shown in cubic yards."""

_STEPS_IN = ((0.1, 1 / 16), (0.3, 1 / 8), (0.75, 1 / 4), (1.5, 1 / 2), (12.0, 1.0))
"""Upper limit of sigma [in] and the fraction of an inch shown: rounding stays below the sigma."""
_SIXTEENTHS = 16


class DisplayUnit(NamedTuple):
    """Display of a unit of results.json: factor, symbol, least and largest number of decimals."""

    factor: float
    symbol: str
    least: int
    most: int


_SAME = {
    "m": DisplayUnit(1.0, "m", 2, 4),
    "m2": DisplayUnit(1.0, "m²", 0, 4),
    "m3": DisplayUnit(1.0, "m³", 0, 4),
}
_FEET = {
    "m": DisplayUnit(1 / FOOT_M, "ft", 2, 4),
    "m2": DisplayUnit(FOOT_M**-2, "ft²", 0, 4),
    "m3": DisplayUnit(FOOT_M**-3, "ft³", 0, 4),
}
_YARDS = DisplayUnit(FOOT_M**-3 / YARD_FT3, "yd³", 0, 4)
_SPEEDS = {
    "km/h": DisplayUnit(3.6, "km/h", 0, 4),
    "mph": DisplayUnit(3600 / (5280 * FOOT_M), "mph", 0, 4),
    "m/s": DisplayUnit(1.0, "m/s", 0, 4),
}


def units_of(result: Result) -> Units:
    """Return the units in which a result is shown, from its project."""
    return units_from_options(result.provenance.options)


def display_unit(unit: str, units: Units, value: float = math.inf) -> DisplayUnit:
    """Return how values of a unit are shown; feet and inches become feet with decimals.

    Parameters
    ----------
    unit
        As in results.json.
    units
        Units of the project.
    value
        Value in that unit: small volumes are shown in cubic feet.
    """
    if unit == "m/s":
        return _SPEEDS[units.speed]
    table = _SAME if units.length == "m" else _FEET
    found = table.get(unit, DisplayUnit(1.0, "°" if unit == "deg" else unit, 0, 4))
    is_large = unit == "m3" and found.symbol == "ft³" and abs(value) * found.factor >= YARD_FT3
    return _YARDS if is_large else found


def decimals(sigma: float, one: DisplayUnit) -> int:
    """Return the decimals that show two significant digits of a sigma, given in the shown unit."""
    if not math.isfinite(sigma) or sigma <= 0:
        return max(one.least, 2)
    return min(max(1 - math.floor(math.log10(sigma)), one.least), one.most)


def quantity(value: float, sigma: float, unit: str, units: Units = METRIC) -> str:
    """Format a value: ``12.345 ± 0.021 m``, ``40.502 ± 0.069 ft`` or ``40 ft 6 in ± 0.83 in``.

    Parameters
    ----------
    value, sigma
        Finite, in `unit`; a value that is not gives an en dash.
    unit
        As in results.json.
    units
        Units in which it is shown.
    """
    if not math.isfinite(value):
        return "–"
    if unit == "m" and units.length == "ft-in":
        return _with_inches(value / INCH_M, sigma / INCH_M)
    one = display_unit(unit, units, value)
    places = decimals(sigma * one.factor, one)
    return (
        f"{format_fixed(value * one.factor, places)} ± {sigma * one.factor:.{places}f} {one.symbol}"
    )


def value_text(value: float, sigma: float, unit: str, units: Units = METRIC) -> str:
    """Format a value alone, with the decimals that its sigma justifies: ``12.345 m``.

    Parameters
    ----------
    value
        NaN: an en dash.
    sigma
        Its standard deviation, both in `unit`.
    unit, units
        See `quantity`.
    """
    if not math.isfinite(value):
        return "–"
    return values((value,), sigma, unit, units, "")


def spread_text(sigma: float, unit: str, units: Units = METRIC) -> str:
    """Format a standard deviation alone: ``0.021 m``.

    Parameters
    ----------
    sigma
        In `unit`; NaN: an en dash.
    unit, units
        See `quantity`.
    """
    if not math.isfinite(sigma):
        return "–"
    if unit == "m" and units.length == "ft-in":
        return _spread_in(sigma / INCH_M)
    one = display_unit(unit, units)
    return f"{sigma * one.factor:.{decimals(sigma * one.factor, one)}f} {one.symbol}"


def values(several: Iterable[float], sigma: float, unit: str, units: Units, between: str) -> str:
    """Format values with the decimals that their sigma justifies: ``12.304 to 12.386 m``.

    Parameters
    ----------
    several
        Values in `unit`.
    sigma
        Standard deviation of each.
    unit, units
        Unit as in results.json, and units in which it is shown.
    between
        Text between two values.
    """
    all_of = tuple(several)
    if unit == "m" and units.length == "ft-in":
        return between.join(_length_in(v / INCH_M, sigma / INCH_M) for v in all_of)
    one = display_unit(unit, units, max(map(abs, all_of), default=0.0))
    places = decimals(sigma * one.factor, one)
    return f"{between.join(format_fixed(v * one.factor, places) for v in all_of)} {one.symbol}"


def _with_inches(value_in: float, sigma_in: float) -> str:
    spread = _spread_in(sigma_in)
    if abs(value_in) < INCHES and sigma_in < INCHES:
        return f"{format_fixed(value_in, _places_in(sigma_in))} ± {spread}"
    return f"{feet_inches(value_in, step_in_of(sigma_in))} ± {spread}"


def _length_in(value_in: float, sigma_in: float) -> str:
    if abs(value_in) < INCHES and sigma_in < INCHES:
        return f"{format_fixed(value_in, _places_in(sigma_in))} in"
    return feet_inches(value_in, step_in_of(sigma_in))


def _spread_in(sigma_in: float) -> str:
    if sigma_in >= INCHES:
        feet = sigma_in / INCHES
        return f"{feet:.{0 if feet >= 10 else 1}f} ft"
    return f"{sigma_in:.{_places_in(sigma_in)}f} in"


def _places_in(sigma_in: float) -> int:
    if not math.isfinite(sigma_in) or sigma_in <= 0:
        return 2
    return min(max(1 - math.floor(math.log10(sigma_in)), 0), 2)


def step_in_of(sigma_in: float) -> float:
    """Return the fraction of an inch to which a length is rounded."""
    if not sigma_in > 0:
        return 1 / _SIXTEENTHS
    return next((step for most, step in _STEPS_IN if sigma_in < most), float(INCHES))


def feet_inches(value_in: float, step_in: float, *, signed: bool = False) -> str:
    """Format feet and inches: ``40 ft 6 1/8 in``; ``41 ft`` if only feet are known.

    Parameters
    ----------
    value_in
        Length in inches.
    step_in
        Rounding step in inches: from a sixteenth of an inch to a foot.
    signed
        Whether a positive length has a plus sign.
    """
    sixteenths = round(_SIXTEENTHS * step_in) * math.floor(abs(value_in) / step_in + 0.5)
    sign = "-" if value_in < 0 and sixteenths else "+" if signed and sixteenths else ""
    feet, rest = divmod(sixteenths, _SIXTEENTHS * INCHES)
    inches, part = divmod(rest, _SIXTEENTHS)
    if step_in >= INCHES:
        return f"{sign}{feet} ft"
    common = math.gcd(part, _SIXTEENTHS)
    fraction = f"{part // common}/{_SIXTEENTHS // common}" if part else ""
    told = " ".join(filter(None, (f"{inches}" if inches or not part else "", fraction)))
    return f"{sign}{feet} ft {told} in" if feet else f"{sign}{told} in"


def table_unit(units: Units) -> DisplayUnit:
    """Return how lengths are shown in a table with the unit in its head: feet have decimals."""
    return display_unit("m", units)


def format_fixed(value: float, places: int) -> str:
    """Format a number with fixed decimals and without a negative zero."""
    text = f"{value:.{places}f}"
    return text if float(text) else f"{0:.{places}f}"


def round_bar(most_m: float, units: Units) -> tuple[float, str]:
    """Choose a scale bar: length [m], a round number of metres or feet, and its text.

    Parameters
    ----------
    most_m
        Largest length of the bar.
    units
        Units of the project.
    """
    one = table_unit(units)
    if one.symbol == "m" and most_m < 1.0:
        one = DisplayUnit(100.0, "cm", 0, 0)
    elif units.length == "ft-in" and most_m < FOOT_M:
        one = DisplayUnit(1 / INCH_M, "in", 0, 0)
    power = 10.0 ** math.floor(math.log10(most_m * one.factor))
    length = power * max(f for f in (1, 2, 5) if f * power <= most_m * one.factor * (1 + 1e-9))
    return length / one.factor, f"{length:g} {one.symbol}"
