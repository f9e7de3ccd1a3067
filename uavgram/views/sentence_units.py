"""Conversion of the lengths and speeds in sentences to the units of the project.

Messages and tables are made in metres, in the form ``1.40 m``: number, blank, unit.
`convert_sentence` converts them for display, from the exact numbers where these are known: 3.20 m
may be the rounded value of the 10.5 ft that a user typed.
"""

from __future__ import annotations

import math
import re
from bisect import bisect_left
from collections.abc import Iterable, Sequence
from typing import NamedTuple

from uavgram.model.naming import FOOT_M, Units
from uavgram.model.provenance import case_from_options
from uavgram.model.result.result import Result
from uavgram.views.units import (
    INCH_M,
    INCHES,
    display_unit,
    feet_inches,
    format_fixed,
    quantity,
    step_in_of,
)

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
    return sorted_magnitudes(values)


def sorted_magnitudes(values: Iterable[float | None]) -> tuple[float, ...]:
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
        return sign + quantity(value, sigma, "m", units).replace("±", between[0].strip())
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
    words = [_rescaled(one, factor, places) for one in told]
    return "".join(w + b for w, b in zip(words, [*between, ""], strict=True)) + f" {symbol}"


def _places(told: _ExactNumber, factor: float) -> int:
    """Return the decimals of a converted number: as exact as the text, at least two digits."""
    value = told.value * factor
    places = max(0, math.ceil(-math.log10(_resolution(told.text) * factor) - 1e-9))
    return min(max(places, 1 - math.floor(math.log10(abs(value)))), 6) if value else places


def _rescaled(told: _ExactNumber, factor: float, places: int) -> str:
    value = told.value * factor
    return ("+" if told.text.startswith("+") and value else "") + format_fixed(value, places)


def _resolution(text: str) -> float:
    mantissa, _, power = text.partition("e")
    return 10.0 ** (int(power or 0) - len(mantissa.partition(".")[2]))


def _sentence_in(told: _ExactNumber, inches: float) -> str:
    value, exact = told.value * inches, _resolution(told.text) * inches
    if abs(value) < INCHES:
        return f"{_rescaled(told, inches, _places(told, inches))} in"
    step = step_in_of(exact)
    while step > abs(value) / 10 and step > 1 / 16:
        step = 1.0 if step > 1.0 else step / 2
    return feet_inches(value, step, signed=told.text.startswith("+"))
