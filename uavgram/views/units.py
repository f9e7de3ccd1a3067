"""Lengths, areas, volumes and speeds as text, and those in sentences, in the units of the project.

All computations are in metres. ``picking/page/elements/units.js`` has the same rules.

Messages and tables are made in metres, too, in the form ``1.40 m``: number, blank, unit.
`convert_sentence` converts them for display, from the exact numbers where these are known: 3.20 m
may be the rounded value of the 10.5 ft that a user typed.
"""

from __future__ import annotations

import math
import re
from bisect import bisect_left
from collections.abc import Iterable, Sequence
from typing import NamedTuple

from uavgram.model.naming import FOOT_M, METRIC, Units, round_down, units_from_options
from uavgram.model.provenance import case_from_options
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
_SPEED_UNITS = {
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
        return _SPEED_UNITS[units.speed]
    table = _SAME if units.length == "m" else _FEET
    found = table.get(unit, DisplayUnit(1.0, "°" if unit == "deg" else unit, 0, 4))
    is_large = unit == "m3" and found.symbol == "ft³" and abs(value) * found.factor >= YARD_FT3
    return _YARDS if is_large else found


def decimals(sigma: float, one: DisplayUnit) -> int:
    """Return the decimals that show two significant digits of a sigma, given in the shown unit."""
    if not math.isfinite(sigma) or sigma <= 0:
        return max(one.least, 2)
    return min(max(1 - math.floor(math.log10(sigma)), one.least), one.most)


def format_quantity(value: float, sigma: float, unit: str, units: Units = METRIC) -> str:
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
        return _format_inches(value / INCH_M, sigma / INCH_M)
    one = display_unit(unit, units, value)
    places = decimals(sigma * one.factor, one)
    return (
        f"{format_fixed(value * one.factor, places)} ± {sigma * one.factor:.{places}f} {one.symbol}"
    )


def format_value(value: float, sigma: float, unit: str, units: Units = METRIC) -> str:
    """Format a value alone, with the decimals that its sigma justifies: ``12.345 m``.

    Parameters
    ----------
    value
        NaN: an en dash.
    sigma
        Its standard deviation, both in `unit`.
    unit, units
        See `format_quantity`.
    """
    if not math.isfinite(value):
        return "–"
    return format_values((value,), sigma, unit, units, "")


def format_sigma(sigma: float, unit: str, units: Units = METRIC) -> str:
    """Format a standard deviation alone: ``0.021 m``.

    Parameters
    ----------
    sigma
        In `unit`; NaN: an en dash.
    unit, units
        See `format_quantity`.
    """
    if not math.isfinite(sigma):
        return "–"
    if unit == "m" and units.length == "ft-in":
        return _spread_in(sigma / INCH_M)
    one = display_unit(unit, units)
    return f"{sigma * one.factor:.{decimals(sigma * one.factor, one)}f} {one.symbol}"


def format_values(
    several: Iterable[float], sigma: float, unit: str, units: Units, between: str
) -> str:
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


def _format_inches(value_in: float, sigma_in: float) -> str:
    spread = _spread_in(sigma_in)
    if abs(value_in) < INCHES and sigma_in < INCHES:
        return f"{format_fixed(value_in, _places_in(sigma_in))} ± {spread}"
    return f"{format_feet_inches(value_in, step_in_of(sigma_in))} ± {spread}"


def _length_in(value_in: float, sigma_in: float) -> str:
    if abs(value_in) < INCHES and sigma_in < INCHES:
        return f"{format_fixed(value_in, _places_in(sigma_in))} in"
    return format_feet_inches(value_in, step_in_of(sigma_in))


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


def format_feet_inches(value_in: float, step_in: float, *, signed: bool = False) -> str:
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


def format_fixed(value: float, places: int, *, signed: bool = False) -> str:
    """Format a number with fixed decimals, without a negative zero.

    Parameters
    ----------
    value, places
        The number, and how many decimals it gets.
    signed
        Whether positive numbers get a plus sign.
    """
    text = f"{value:+.{places}f}" if signed else f"{value:.{places}f}"
    return text if float(text) else f"{0:.{places}f}"


def format_length(
    length_m: float, units: Units, places: int = 2, unit: str = "m", *, signed: bool = False
) -> str:
    """Format a length as exactly as with so many decimals in metres: ``1.40 m`` or ``4.59 ft``.

    Parameters
    ----------
    length_m
        The length.
    units
        Units in which it is shown.
    places, unit
        Decimals, of metres or of centimetres (``cm``).
    signed
        Whether a positive length has a plus sign.
    """
    value = length_m / _SCALES[unit]
    text = format_fixed(value, places, signed=signed)
    if units.length == "m":
        return f"{text} {unit}"
    return _one_by_one([_ExactNumber(text, value)], [], unit, units)


def format_reading(length_m: float, units: Units) -> str:
    """Format the reading of a tape with all its decimals, at least two: ``2.925 m``.

    Parameters
    ----------
    length_m
        The reading.
    units
        Units in which it is shown.
    """
    one = table_unit(units)
    decimals_read = len(f"{length_m * one.factor:.8g}".partition(".")[2])
    if units.length == "ft-in" or decimals_read > one.most:  # read in another unit
        return format_length(length_m, units)
    return f"{format_fixed(length_m * one.factor, max(decimals_read, one.least))} {one.symbol}"


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
    length = round_down(most_m * one.factor)
    return length / one.factor, f"{length:g} {one.symbol}"


_NUMBER = r"[+\-−]?\d+(?:\.\d+)?(?:e[+\-]?\d+)?"
_SURE = r"\s?(?:±|\+-|×|–)\s?| x | to "
_PATTERN = re.compile(
    rf"(?<![\w.\-/'\"])(?P<numbers>{_NUMBER}(?:(?:{_SURE}|, | and | or ){_NUMBER})*)[ \u00a0]"
    r"(?P<unit>km/h|m/s|mm|cm|km|m²|m³|m2|m3|m)(?![\w²³/^])(?!-\w)(?!\.\w)"
)
_QUOTED = re.compile(r"(?<!\w)'[^'\n]*'(?!\w)|\"[^\"\n]*\"|`[^`\n]*`")
_OPTICS = re.compile(r"focal|film|35 mm|EXIF|lens\b|drone camera", re.IGNORECASE)
_SCALES = {"m": 1.0, "cm": 0.01, "mm": 0.001, "km": 1000.0, "m/s": 1.0, "km/h": 1 / 3.6}
_METRES = frozenset({"m", "cm", "mm", "km"})
_POWERS = {"m²": "m2", "m2": "m2", "m³": "m3", "m3": "m3"}
_SPEEDS = {"m/s", "km/h"}
_MILE_M = 5280 * FOOT_M


def convert_sentence(
    text: str, units: Units, keep: Iterable[str] = (), exact: Sequence[float] = ()
) -> str:
    """Convert the lengths and speeds in a sentence; quoted text is not changed.

    Parameters
    ----------
    text
        A sentence with numbers in the form ``1.40 m``: number, blank, unit.
    units
        Units of the project.
    keep
        Names given by people, which are not changed even if they look like lengths.
    exact
        Exact lengths [m], ascending: a number that is one of them, rounded, is converted from it.
    """
    if units.length == "m" and not any(speed in text for speed in _SPEEDS - {units.speed}):
        return text
    if not _PATTERN.search(text):
        return text
    kept = [match.span() for match in _QUOTED.finditer(text)]
    kept += [m.span() for name in keep if name for m in re.finditer(re.escape(name), text)]
    is_optical = _OPTICS.search(text) is not None

    def replaced(match: re.Match[str]) -> str:
        start, end = match.span()
        if any(a <= start and end <= b for a, b in kept):
            return match[0]
        if match["unit"] == "mm" and is_optical:
            return match[0]
        return _convert(match["numbers"], match["unit"], units, exact) or match[0]

    return _PATTERN.sub(replaced, text)


def list_names_like_lengths(result: Result) -> tuple[str, ...]:
    """Return the names that `convert_sentence` would take for lengths, such as ``wall 4 m``."""
    named = (
        *result.points.label,
        *result.lines.name,
        *result.measurements.name,
        *result.known.name,
        *result.frames.frame_id,
        result.name,
        *(text for row in case_from_options(result.provenance.options) for text in row),
    )
    return select_like_lengths(named)


def exact_lengths(result: Result) -> tuple[float, ...]:
    """Return the lengths of a result that its sentences show rounded [m], ascending."""
    lines, measured = result.lines, result.measurements
    values = [*lines.length_m, *lines.adjusted_m, *lines.residual_m, *lines.mdb_m]
    for unit, value, sigma in zip(measured.unit, measured.value, measured.sigma, strict=True):
        values += [value, sigma] if unit == "m" else []
    return sort_magnitudes(values)


def sort_magnitudes(values: Iterable[float | None]) -> tuple[float, ...]:
    """Return the absolute values of the finite numbers, each once, ascending."""
    sizes = {abs(float(one)) for one in values if one is not None}
    return tuple(sorted(one for one in sizes if math.isfinite(one)))


def select_like_lengths(names: Iterable[str]) -> tuple[str, ...]:
    """Return the names that `convert_sentence` would take for lengths."""
    return tuple(name for name in names if _PATTERN.search(name))


class _ExactNumber(NamedTuple):
    """Number of a sentence: its text, and its exact value in its unit."""

    text: str
    value: float


def _find_exact(text: str, metres: float, exact: Sequence[float]) -> _ExactNumber:
    """Find the exact value of a number: the nearest that rounds to it; `metres` is its unit."""
    value = float(_plain(text))
    size, half = abs(value) * metres, 0.5 * _resolution(text) * metres
    at = bisect_left(exact, size)
    near = min(exact[max(at - 1, 0) : at + 1], key=lambda one: abs(one - size), default=math.inf)
    if abs(near - size) > half * (1 + 1e-6):
        return _ExactNumber(text, value)
    return _ExactNumber(text, math.copysign(near / metres, value))


def _convert(numbers: str, unit: str, units: Units, exact: Sequence[float]) -> str:
    """Convert numbers to other units; return an empty text if they are not changed."""
    is_speed = unit in _SPEEDS
    if (is_speed and unit == units.speed) or (not is_speed and units.length == "m"):
        return ""
    parts = re.split(rf"({_SURE}|, | and | or )(?={_NUMBER})", numbers)
    told, between = parts[::2], parts[1::2]
    if any(b in (", ", " and ", " or ") for b in between) and not _alike(told):
        # "in photos 3 and 5.2 m": only the last number belongs to the unit
        lead = numbers[: len(numbers) - len(told[-1])]
        return lead + _convert(told[-1], unit, units, exact)
    known = exact if unit in _METRES else ()
    read = [_find_exact(text, _SCALES.get(unit, 1.0), known) for text in told]
    if (
        len(told) == 2
        and between[0].strip() in ("±", "+-")
        and not is_speed
        and unit not in _POWERS
    ):
        value, sigma = (one.value * _SCALES[unit] for one in read)
        sign = "+" if told[0].startswith("+") else ""
        return sign + format_quantity(value, sigma, "m", units).replace("±", between[0].strip())
    return _one_by_one(read, between, unit, units)


def _alike(told: list[str]) -> bool:
    places = {len(text.partition(".")[2]) for text in told}
    return len(places) == 1 and places != {0}


def _plain(text: str) -> str:
    return text.replace("−", "-")


def _one_by_one(told: list[_ExactNumber], between: list[str], unit: str, units: Units) -> str:
    if units.length == "ft-in" and unit in ("m", "cm", "mm"):
        words = [_sentence_in(one, _SCALES[unit] / INCH_M) for one in told]
        return "".join(w + b for w, b in zip(words, [*between, ""], strict=True))
    if unit in _POWERS:
        one = display_unit(_POWERS[unit], units, max(abs(each.value) for each in told))
        factor, symbol = one.factor, one.symbol
    elif unit == "km":
        factor, symbol = 1000.0 / _MILE_M, "mi"
    else:
        one = display_unit("m/s" if unit in ("m/s", "km/h") else "m", units)
        factor, symbol = one.factor * _SCALES[unit], one.symbol
    places = max(_places(one, factor) for one in told)
    words = [_rescale(one, factor, places) for one in told]
    return "".join(w + b for w, b in zip(words, [*between, ""], strict=True)) + f" {symbol}"


def _places(told: _ExactNumber, factor: float) -> int:
    """Return the decimals of a converted number: as exact as the text, at least two digits."""
    value = told.value * factor
    places = max(0, math.ceil(-math.log10(_resolution(told.text) * factor) - 1e-9))
    return min(max(places, 1 - math.floor(math.log10(abs(value)))), 6) if value else places


def _rescale(told: _ExactNumber, factor: float, places: int) -> str:
    value = told.value * factor
    return ("+" if told.text.startswith("+") and value else "") + format_fixed(value, places)


def _resolution(text: str) -> float:
    mantissa, _, power = text.partition("e")
    return 10.0 ** (int(power or 0) - len(mantissa.partition(".")[2]))


def _sentence_in(told: _ExactNumber, inches: float) -> str:
    value, exact = told.value * inches, _resolution(told.text) * inches
    if abs(value) < INCHES:
        return f"{_rescale(told, inches, _places(told, inches))} in"
    step = step_in_of(exact)
    while step > abs(value) / 10 and step > 1 / 16:
        step = 1.0 if step > 1.0 else step / 2
    return format_feet_inches(value, step, signed=told.text.startswith("+"))
